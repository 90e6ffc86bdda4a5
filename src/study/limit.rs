//! How far tuned gains are from the best possible: the four machine classes and the nine cases of the HDD benchmark plant.

use super::hdd::{RATE_HZ, benchmark};
use super::{Study, StudyError};
use crate::controller::Controller;
use crate::lti::Plant;
use crate::report::number::NumberFormat;
use crate::report::table::{Column, Table};
use crate::tune::{
    GainsBound, GainsSettings, Hold, Limit, LimitPlant, LimitSettings, Machine, Outcome, Spec, Standing,
    StructureBound, StructureSettings, TuneSettings, Verdict, gains_bound, limit, standing, structure_bound, tune,
};
use crate::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use rayon::prelude::*;
use std::path::Path;

/// Starts of the wide search, beside the 12 of an ordinary one.
const WIDE: usize = 60;
/// Rounds of each bound: later ones raise it by less than a percent.
const ROUNDS: usize = 8;
/// Boxes of the bound of the structure for the nine cases: of thirteen numbers without noise only small boxes have a bound.
const FEW: usize = 6_000;

/// One machine, tuned and bounded.
struct Case {
    name: String,
    met: bool,
    tuned: Standing,
    /// The better of the ordinary and the wide search.
    best: Standing,
    limit: Limit,
    /// What all numbers of the structure could still do.
    structure: StructureBound,
    /// What the tuned PID gains could still do with the tuned filters.
    alone: GainsBound,
}

/// One machine as the study takes it.
struct Subject<'a> {
    name: String,
    machine: Machine<'a>,
    seen: LimitPlant,
    spec: Spec,
    start: Option<Controller>,
    sample_time_s: f64,
    /// Boxes of the bound of the structure, at most.
    boxes: usize,
}

/// Makes the study; `data` holds the published parameters of the benchmark plant, `say` hears how far it is.
pub fn limits(data: &Path, say: &mut dyn FnMut(&str)) -> Result<Study, StudyError> {
    let plants = MachineClass::ALL.into_iter().map(paper_machine).collect::<Result<Vec<_>, _>>()?;
    let four =
        MachineClass::ALL.into_iter().zip(&plants).map(|(c, plant)| class(c, plant)).collect::<Result<_, _>>()?;
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_limit_profile.toml"))?;
    let nine = benchmark(data)?;
    let nine: Vec<Subject<'_>> = nine
        .iter()
        .map(|(name, frf, pulse)| Subject {
            name: name.clone(),
            machine: Machine::Response { frf, hold: Hold::Included, continuation: None },
            seen: LimitPlant::Pulse { response: pulse.clone(), integrators: 2 },
            spec: spec.clone(),
            start: None,
            sample_time_s: 1.0 / RATE_HZ,
            boxes: FEW,
        })
        .collect();
    let classes = cases(four, say)?;
    let nine = cases(nine, say)?;
    let mut study = Study::default();
    study.page("limit.md", page(&classes, &nine)?);
    Ok(study)
}

fn class(class: MachineClass, plant: &Plant) -> Result<Subject<'_>, StudyError> {
    let mut spec =
        Spec::parse(include_str!("../../specs/limits/paper.toml"), include_str!("../../specs/profiles/spiral.toml"))?;
    spec.profile = paper_profile(class)?;
    let start = nominal_controller()?;
    let sample_time_s = start.sample_time_s;
    let seen = LimitPlant::of_model(plant, sample_time_s)?;
    let name = class.name().to_owned();
    let boxes = StructureSettings::default().boxes;
    Ok(Subject { name, machine: Machine::Model(plant), seen, spec, start: Some(start), sample_time_s, boxes })
}

/// Each machine in turn: what is made of it uses all threads but for the bound of all loops, of which as many run at once as there are threads.
fn cases(subjects: Vec<Subject<'_>>, say: &mut dyn FnMut(&str)) -> Result<Vec<Case>, StudyError> {
    let mut limits = Vec::new();
    for some in subjects.chunks(rayon::current_num_threads().max(1)) {
        let found: Vec<Limit> = some.par_iter().map(all_loops).collect::<Result<_, StudyError>>()?;
        some.iter().for_each(|s| say(&format!("{}: bound of all loops", s.name)));
        limits.extend(found);
    }
    subjects.into_iter().zip(limits).map(|(s, limit)| case(s, limit, say)).collect()
}

fn all_loops(s: &Subject<'_>) -> Result<Limit, StudyError> {
    let settings = LimitSettings { rounds: ROUNDS, alone: 0, ..LimitSettings::default() };
    Ok(limit(&s.seen, s.sample_time_s, None, &s.spec, &settings)?)
}

fn case(s: Subject<'_>, limit: Limit, say: &mut dyn FnMut(&str)) -> Result<Case, StudyError> {
    let Subject { name, machine, seen, spec, start, sample_time_s, boxes } = s;
    let start = start.as_ref();
    let settings = TuneSettings { sample_time_s, ..TuneSettings::default() };
    let ordinary = tune(&machine, &spec, start, &settings)?;
    say(&format!("{name}: tuned"));
    let mut other = spec.clone();
    other.search.seed += 1;
    let wide = tune(&machine, &other, start, &TuneSettings { starts: WIDE, ..settings })?;
    say(&format!("{name}: tuned from {WIDE} starts"));
    let tuned = standing(&seen, ordinary.controller(), &spec)?;
    let found = standing(&seen, wide.controller(), &spec)?;
    let met = matches!(ordinary, Outcome::Tuned(_));
    let better = matches!(wide, Outcome::Tuned(_)) && found.figures.objective < tuned.figures.objective;
    let alone = gains_bound(&machine, ordinary.controller(), &spec, &GainsSettings::default())?;
    say(&format!("{name}: bound of the gains, {} boxes", alone.boxes));
    let settings = StructureSettings { boxes, ..StructureSettings::default() };
    let structure = structure_bound(&machine, ordinary.controller(), &spec, &settings)?;
    say(&format!("{name}: bound of the structure, {} boxes", structure.boxes));
    Ok(Case { name, met, tuned, best: if better { found } else { tuned }, limit, structure, alone })
}

fn table(caption: &str, cases: &[Case]) -> Result<Table, StudyError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        caption,
        vec![
            Column::words("machine"),
            Column::words("limits"),
            Column::numbers("tuned", "", digits),
            Column::numbers("above best found in structure", "%", NumberFormat::Decimals(2)),
            Column::numbers("above best gains of its filters, at most", "%", NumberFormat::Decimals(2)),
            Column::numbers("boxes left", "", NumberFormat::Decimals(0)),
            Column::numbers("bound of the structure", "", digits),
            Column::numbers("above it", "%", NumberFormat::Decimals(1)),
            Column::numbers("boxes left", "", NumberFormat::Decimals(0)),
            Column::numbers("bound", "", digits),
            Column::numbers("above the bound", "%", NumberFormat::Decimals(1)),
            Column::numbers("demand missed", "", NumberFormat::Significant(2)),
            Column::numbers("tail of S", "", NumberFormat::Significant(2)),
            Column::words("in the class"),
            Column::words("proven impossible"),
        ],
    );
    for c in cases {
        let (tuned, best, bound) = (c.tuned.figures.objective, c.best.figures.objective, c.limit.sum.objective);
        table.push(vec![
            c.name.as_str().into(),
            if c.met { "met" } else { "missed" }.into(),
            tuned.into(),
            (100.0 * (tuned / best - 1.0)).into(),
            (c.alone.member && c.alone.objective > 0.0).then(|| 100.0 * (c.alone.own / c.alone.objective - 1.0)).into(),
            (c.alone.left as f64).into(),
            c.structure.objective.into(),
            (c.structure.member && c.structure.objective > 0.0)
                .then(|| 100.0 * (c.structure.own / c.structure.objective - 1.0))
                .into(),
            (c.structure.left as f64).into(),
            bound.into(),
            (bound > 0.0).then(|| 100.0 * (tuned / bound - 1.0)).into(),
            c.limit.sum.missed.into(),
            c.tuned.tail.into(),
            if c.tuned.tail <= c.limit.tail { "yes" } else { "no" }.into(),
            if c.limit.verdict == Verdict::Impossible { "yes" } else { "no" }.into(),
        ])?;
    }
    Ok(table)
}

fn page(classes: &[Case], nine: &[Case]) -> Result<String, StudyError> {
    let worst = |all: &[Case]| {
        all.iter().map(|c| c.tuned.figures.objective / c.best.figures.objective - 1.0).fold(0.0, f64::max) * 100.0
    };
    let boxes = StructureSettings::default().boxes;
    let work = classes.iter().chain(nine).map(|c| c.limit.work.taps).max().unwrap_or(0);
    Ok(format!(
        "# How far from the best possible\n\n\
         Made by `servotune study limits --data DATA --out results`. Machines: `specs/machines/` under `specs/limits/paper.toml`, each class \
         with its own noise; and the nine cases of the HDD benchmark plant (source: `hdd_benchmark.md`) under `src/study/specs/hdd.toml` with the window \
         of `hdd_limit_profile.toml`, half as long as there.\n\n\
         Each machine is tuned as `tune` does it (12 starts a notch), and again from {WIDE} starts a notch under another seed. *Tuned*: the weighted sum that tuning \
         minimises, expected over all draws of the noise. *Above best found in structure*: against the better of both searches; this is evidence, no \
         bound. *Bound*: no loop of the class is below it (`specs/performance_limit.md`); *demand missed*: by how much the last point of the programme still \
         breaks a demand of the class, 0 where the bound cannot rise further. Largest programme: {work} taps.\n\n\
         ```text\n{}```\n\n```text\n{}```\n\n\
         Furthest from the best found in its structure: {:.2} % (classes), {:.2} % (nine cases); the aim is 2 %.\n\n\
         *Above best gains of its filters, at most*: with the tuned filters as they stand, no PID gains from 1/1.5 to 1.5 times the tuned ones are \
         further below; proven by branch and bound on grids of frequency, ended at 1 % or at its number of boxes (*boxes left* is 0 where it came to its end). \
         *Bound of the structure*: no numbers between the spec's bounds that meet its demands have a smaller weighted sum, all of them free: gains, corners, centres, \
         depths, dampings; *above it*: the tuned gains are at most so far above the best of their structure, by the same figures (those of the measured route, within 2 % of *tuned*). It asks for no tail. \
         For loops of the class the bound of all loops holds within the structure too, and where it is higher it is the better of the two. *In the class* looks at the tail of S only.\n\n\
         What falls short. The bound of all loops leaves phase and gain margin out, because they are not convex, and looks at a grid of frequencies. The nine cases \
         have no noise and are judged on one move: a loop of some hundred taps can then cancel the window's bins nearly one by one, which no PID with notches can, so \
         that their bound is true and far away. It speaks of loops whose gain crossings all lie inside the spec's range. The bound of the structure is true and not tight: seven numbers \
         in {boxes} boxes (the nine cases: {FEW}) are a few pieces a number, and what a wide box could do at one frequency and what at another need not go together. Without noise only small boxes have a \
         bound at all, and thirteen numbers hardly come down to such: where it is 0, what remains is the bound of all loops and the searches from many starts.\n",
        table("Four machine classes", classes)?.text(),
        table("HDD benchmark plant, nine cases", nine)?.text(),
        worst(classes),
        worst(nine),
    ))
}
