//! The write over boxes of parameters: proved bounds beside members drawn from the box and simulated by another algorithm.

use super::hdd::{cases, joint};
use super::{Study, StudyError};
use servotune::controller::Controller;
use servotune::frf::Frf;
use servotune::identify::{BodyChoice, IdentifySettings, identify};
use servotune::lti::Plant;
use servotune::numeric::random::Random;
use servotune::pes::{Profile, figures, simulate};
use servotune::tune::{Machine, Spec, TuneSettings, tune};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use servotune::verify::{
    BoxSettings, BoxedLoop, Stability, Uncertainty, VerifySettings, WriteBox, WriteOpen, bound_write, prove_loop,
};
use std::path::Path;
use std::time::Instant;

/// Half widths of gain, frequencies, dampings and delay alike.
const SHARES: [f64; 3] = [0.01, 0.02, 0.05];
/// The benchmark's models stand next to their limits; a narrow box too.
const NARROW: [f64; 4] = [0.0, 0.002, 0.01, 0.02];
/// Members drawn from each box, every second one a corner.
const DRAWS: usize = 200;

/// Makes the study; `data` is the folder with the benchmark plant, `say` hears how far it is.
pub fn certificate_write(data: &Path, say: &mut dyn FnMut(&str)) -> Result<Study, StudyError> {
    let mut rows = String::new();
    let mut tally = Tally::default();
    let paper = Spec::parse(
        include_str!("../../../specs/limits/paper.toml"),
        include_str!("../../../specs/profiles/spiral.toml"),
    )?;
    for class in MachineClass::ALL {
        let (plant, profile) = (paper_machine(class)?, paper_profile(class)?);
        let spec = Spec { profile: Some(profile.clone()), ..paper.clone() };
        let outcome = tune(&Machine::Model(&plant), &spec, Some(&nominal_controller()?), &TuneSettings::default())?;
        rows += &machine(class.name(), &plant, outcome.controller(), &profile, &[1, 3], &SHARES, &mut tally)?;
        say(&format!("{}: done", class.name()));
    }
    let hdd = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_profile.toml"))?;
    let cases = cases(data)?;
    let outcome = joint(&cases)?;
    say("benchmark plant: tuned");
    for case in &cases {
        let plant = model(&case.frf)?;
        rows += &machine(&case.name, &plant, outcome.controller(), hdd.write("a study")?, &[1], &NARROW, &mut tally)?;
        say(&format!("{}: done", case.name));
    }
    let mut study = Study::default();
    study.page("certificate_write.md", page(&rows, &tally));
    Ok(study)
}

/// The benchmark has no model in product form: the one identified from its response.
fn model(frf: &Frf) -> Result<Plant, StudyError> {
    let settings = IdentifySettings { body: BodyChoice::Auto, ..IdentifySettings::default() };
    Ok(identify(frf, &settings)?.plant)
}

/// What the rows come to.
#[derive(Default)]
struct Tally {
    boxes: usize,
    open: usize,
    /// Draws above their bound.
    broken: usize,
    /// Ratio of bound to worst seen or drawn, per figure.
    ratios: Vec<f64>,
}

fn machine(
    name: &str,
    plant: &Plant,
    c: &Controller,
    profile: &Profile,
    harmonics: &[usize],
    shares: &[f64],
    tally: &mut Tally,
) -> Result<String, StudyError> {
    let sections = c.sections()?.chain;
    let mut text = String::new();
    for &share in shares {
        let u = Uncertainty { gain: share, frequency: share, damping: share, delay: share };
        let clock = Instant::now();
        let bounds = prove_loop(plant, &sections, c.sample_time_s, &u, &VerifySettings::default())?;
        let stable = bounds.stability == Stability::Stable;
        let l = BoxedLoop {
            plant,
            sections: &sections,
            controller: c,
            profile,
            bands_hz: [[600.0, 1500.0], [1500.0, 3000.0]],
            uncertainty: &u,
            max_sensitivity: bounds.max_sensitivity.high.filter(|_| stable),
        };
        let w = bound_write(&l, harmonics, &BoxSettings::default(), &|_, _| {});
        let seconds = clock.elapsed().as_secs_f64();
        let percent = 100.0 * share;
        tally.boxes += 1;
        if let Some(why) = w.open {
            tally.open += 1;
            let why = match why {
                WriteOpen::NotProvedStable => "the box is not proved stable",
                WriteOpen::MayClip => "a member may clip its command",
                WriteOpen::NoDecay => "a pair of poles does not decay",
                WriteOpen::ShallowRollOff => "the plant falls with less than 1/s²",
                WriteOpen::TooLong => "the record is too long",
            };
            text += &format!("| {name} | {percent} % | {why} | | | | | | | {seconds:.1} |\n");
            continue;
        }
        let nominal = exact(plant, c, profile, &w)?;
        let mut worst = nominal.clone();
        let mut r = Random::new(7);
        for _ in 0..DRAWS {
            for (w, x) in worst.iter_mut().zip(exact(&u.draw(plant, &mut r), c, profile, &w)?) {
                *w = w.max(x);
            }
        }
        for (i, (figure, most, seen)) in listed(&w).into_iter().enumerate() {
            tally.broken += usize::from(worst[i] > most);
            let ratio = most / worst[i].max(seen);
            // Every bin of the bands is bounded; the page has the figures that a spec limits.
            let asked = |k: &str| harmonics.iter().any(|h| h.to_string() == k);
            if figure.strip_prefix("harmonic ").is_some_and(|k| !asked(k)) {
                continue;
            }
            tally.ratios.push(ratio);
            let (time, boxes) =
                if i == 0 { (format!("{seconds:.1}"), w.boxes.to_string()) } else { Default::default() };
            text += &format!(
                "| {name} | {percent} % | {figure} | {:.4e} | {:.4e} | {seen:.4e} | {most:.4e} | {ratio:.3} | {boxes} | {time} |\n",
                nominal[i], worst[i]
            );
        }
    }
    Ok(text)
}

/// Name, bound and largest seen of every figure.
fn listed(w: &WriteBox) -> Vec<(String, f64, f64)> {
    let one = |name: &str, f: Option<servotune::verify::BoxFigure>| {
        let f = f.unwrap_or_default();
        (name.to_owned(), f.most, f.seen)
    };
    let harmonics = w.harmonics.iter().map(|h| (format!("harmonic {}", h.k), h.most, h.seen));
    [one("600-1500 Hz", w.dft_low), one("1500-3000 Hz", w.dft_high)]
        .into_iter()
        .chain(harmonics)
        .chain([one("command peak", w.command_peak)])
        .collect()
}

/// The same figures of one machine by partial fractions.
fn exact(plant: &Plant, c: &Controller, profile: &Profile, w: &WriteBox) -> Result<Vec<f64>, StudyError> {
    let run = simulate(plant, c, profile)?;
    let f = figures(&run.pes, profile);
    let peak = run.command.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let bins = w.harmonics.iter().map(|h| f.harmonics[h.k - 1].amplitude);
    Ok([f.dft_low, f.dft_high].into_iter().map(Option::unwrap_or_default).chain(bins).chain([peak]).collect())
}

fn page(rows: &str, tally: &Tally) -> String {
    let mut sorted = tally.ratios.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |q: f64| sorted.get((q * sorted.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN);
    let within = sorted.iter().filter(|r| **r <= 1.3).count();
    format!(
        "# The write over a box\n\n\
         Made by `lab certificate-write --data DATA --out results`, DATA being the folder with `hdd_benchmark_model/`; spec: `specs/certificate.md`.\n\n\
         Gain, every frequency, every damping ratio and the dead time move by the same share, each on its own. The four machines have the tables tuned to \
         `specs/limits/paper.toml` and their own noise; the nine cases of the HDD benchmark plant (source: `hdd_benchmark.md`) are the models identified from their responses, under the one \
         table tuned jointly. *Drawn*: the worst of {DRAWS} members, every second one a corner, simulated by partial fractions. *Seen*: the worst that the proof came across, simulated by \
         matrix exponentials: middles of its pieces and the corners that its slopes point to. *Bound*: no member has more. *Ratio*: bound over the larger of drawn and seen. *Seconds* are of one core, \
         with the proof of the margins.\n\n\
         {} boxes, {} of them without bounds of the write; {} figures; {} draws above their bound. Ratio: median {:.3}, nine of ten below {:.3}, largest {:.3}; {within} of {} at most 1.3.\n\n\
         | machine | box | figure | nominal | drawn | seen | bound | ratio | pieces | seconds |\n|---|---|---|---|---|---|---|---|---|---|\n{rows}",
        tally.boxes,
        tally.open,
        sorted.len(),
        tally.broken,
        at(0.5),
        at(0.9),
        at(1.0),
        sorted.len(),
    )
}
