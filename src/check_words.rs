//! What a file means in words: units, points, band, what a spec asks for.

use super::check_kind::FileKind;
use super::{Failure, load};
use servotune::controller::Controller;
use servotune::document::read_text;
use servotune::frf::{ReadSettings, read_file};
use servotune::gate::Gate;
use servotune::lti::{Body, Plant};
use servotune::pes::{Profile, Reference};
use servotune::recording::{Case, Record, RecordSettings, Role};
use servotune::tune::{GainTable, Requirement, Side, Spec, TuneError};
use std::f64::consts::TAU;
use std::path::Path;

/// What stands in a file.
#[derive(Default)]
pub(super) struct Meaning {
    pub says: Vec<String>,
    /// What a person should look at before he goes on: the file can be read, and is hardly meant so.
    pub doubts: Vec<String>,
    /// What margins can be judged of.
    pub plant: Option<Plant>,
    pub controller: Option<Controller>,
}

impl Meaning {
    fn of(says: Vec<String>) -> Meaning {
        Meaning { says, ..Meaning::default() }
    }
}

/// Reads the file as what it is.
pub(super) fn meaning(kind: FileKind, file: &Path) -> Result<Meaning, Failure> {
    match kind {
        FileKind::Sweep => sweep(file),
        FileKind::Record => Ok(Meaning::of(record(&Record::read(file, &RecordSettings::default())?))),
        FileKind::Plant => load::plant(file).map(plant),
        FileKind::Controller => load::controller(file).map(controller),
        FileKind::GainTable => gain_table(file),
        FileKind::Spec => Ok(Meaning::of(spec(&Spec::read(file).map_err(TuneError::from)?))),
        FileKind::Profile => Ok(Meaning::of(profile(&load::profile(file)?))),
        FileKind::Case => case(file),
        FileKind::Fleet => fleet(file),
        FileKind::Gate => {
            let g = Gate::read(file)?;
            Ok(Meaning::of(vec![format!(
                "label `{}`, {} judges, made by servotune {}",
                g.label,
                g.members.len() + 1,
                g.program
            )]))
        }
        FileKind::Certificate | FileKind::Diagnosis => json(file),
    }
}

fn sweep(file: &Path) -> Result<Meaning, Failure> {
    let s = read_file(file, &ReadSettings::default())?;
    let (w, v) = (s.frf.w_rad_s(), s.frf.value());
    let last = w.len() - 1;
    let db = |i: usize| 20.0 * v[i].norm().log10();
    let mut says = vec![format!(
        "{} points from {} to {} Hz, {:.1} dB at the first and {:.1} dB at the last{}",
        w.len(),
        short(w[0] / TAU),
        short(w[last] / TAU),
        db(0),
        db(last),
        if s.frf.relative_std().is_some() { ", with deviations" } else { ", without deviations" }
    )];
    says.extend(s.notes.iter().map(ToString::to_string));
    says.push("units are not in a sweep: --position-unit and --command-unit say them".to_owned());
    Ok(Meaning::of(says))
}

fn record(r: &Record) -> Vec<String> {
    let seconds = r.len() as f64 * r.sample_time_s;
    let columns = [
        ("reference", r.reference.is_some()),
        ("pes", r.pes.is_some()),
        ("spindle_rad", r.spindle_rad.is_some()),
        ("temperature_c", r.temperature_c.is_some()),
    ];
    let has: Vec<&str> = columns.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect();
    let mut says = vec![format!(
        "{} samples at {} Hz, {} s; command, position{}{}",
        r.len(),
        short(1.0 / r.sample_time_s),
        short(seconds),
        if has.is_empty() { "" } else { ", " },
        has.join(", ")
    )];
    if !r.gaps.is_empty() {
        says.push(format!("the clock misses a step in {} places, first at row {}", r.gaps.len(), r.gaps[0].row));
    }
    says
}

fn plant(p: Plant) -> Meaning {
    let (position, command) = (&p.position_unit, &p.command_unit);
    let body = match &p.body {
        Body::SecondOrder { natural_frequency_rad_s: w0, damping_ratio, .. } => {
            format!("a body at {} Hz with damping {}", short(w0 / TAU), short(*damping_ratio))
        }
        Body::FreeInertia { viscous_rate_per_s, .. } => {
            format!("a free inertia, viscous rate {} 1/s", short(*viscous_rate_per_s))
        }
        Body::Rational(r) => format!(
            "{} poles and {} zeros, {} in the right half-plane",
            r.poles.len(),
            r.zeros.len(),
            r.unstable_poles()
        ),
    };
    // Pairs are monic: each moves the gain at rest by (zero/pole)^2, so that the key `dc_gain` alone is not the gain at rest.
    let rest = p.modes.iter().map(|m| (m.zero_rad_s / m.pole_rad_s).powi(2)).product::<f64>() * p.resonance_gain;
    let gain = match &p.body {
        Body::SecondOrder { dc_gain, .. } => format!("gain at rest {} {position}/{command}", short(dc_gain * rest)),
        Body::FreeInertia { acceleration_gain, .. } => {
            format!("acceleration at low frequency {} {position}/s^2 per {command}", short(acceleration_gain * rest))
        }
        Body::Rational(_) => "gain as the roots give it".to_owned(),
    };
    let mut says = vec![
        format!(
            "position in {position}, command in {command}; {body}, {} resonance pairs, delay {} us",
            p.modes.len(),
            short(1e6 * p.delay_s)
        ),
        gain,
    ];
    if !p.physics.is_empty() {
        let names: Vec<&str> = p.physics.iter().map(|e| e.effect.as_str()).collect();
        says.push(format!("beyond linear: {}; left out of margins said here", names.join(", ")));
    }
    Meaning { says, plant: Some(p), ..Meaning::default() }
}

/// No servo samples slower than this (s): a larger number is mostly one in microseconds.
const SLOWEST_S: f64 = 0.1;

fn controller(c: Controller) -> Meaning {
    let p = &c.pid;
    let mut says = vec![format!(
        "{} Hz (sample time {} us); kp {}, ki {} 1/s, kd {} s, derivative filter {} us{}",
        short(1.0 / c.sample_time_s),
        short(1e6 * c.sample_time_s),
        short(p.kp),
        short(p.ki_per_s),
        short(p.kd_s),
        short(1e6 * p.derivative_filter_s),
        c.output_limit.map_or_else(String::new, |l| format!("; command clipped at {}", short(l)))
    )];
    says.extend(
        c.lowpass
            .iter()
            .map(|l| format!("low-pass at {} Hz, damping {}", short(l.frequency_hz), short(l.damping_ratio))),
    );
    says.extend(c.notch.iter().map(|n| {
        let depth = 20.0 * (n.zero_damping_ratio / n.pole_damping_ratio).log10();
        format!("notch at {} Hz, {depth:.1} dB", short(n.frequency_hz))
    }));
    if !c.biquad.is_empty() {
        says.push(format!("{} own second-order sections, which no search changes", c.biquad.len()));
    }
    let mut doubts = Vec::new();
    if c.sample_time_s > SLOWEST_S {
        let micro = 1e-6 * c.sample_time_s;
        doubts.push(format!(
            "sample_time_s = {} s is one sample in {} s; did you mean {} us, which is {micro:e}?",
            short(c.sample_time_s),
            short(c.sample_time_s),
            short(c.sample_time_s)
        ));
    }
    if p.kd_s == 0.0 && p.derivative_filter_s > 0.0 {
        doubts.push("there is a derivative filter, and kd_s is 0 or absent; was it forgotten?".to_owned());
    }
    Meaning { says, doubts, controller: Some(c), ..Meaning::default() }
}

fn gain_table(file: &Path) -> Result<Meaning, Failure> {
    let table = GainTable::read(file)?;
    let mut m = controller(table.controller());
    if let Some((position, command)) = table.units() {
        m.says.insert(0, format!("gains in {command} per {position}; made by servotune {}", table.provenance.program));
    }
    let a = &table.after;
    let shown = |x: Option<f64>| x.map_or_else(|| "none".to_owned(), short);
    m.says.push(format!(
        "as it was tuned: {}, phase margin {} deg, gain margin {} dB, crossover {} Hz, max sensitivity {}; sections agree with the gains",
        if a.stable { "stable" } else { "UNSTABLE" },
        shown(a.phase_margin_deg),
        shown(a.gain_margin_db),
        shown(a.gain_crossover_hz),
        short(a.max_sensitivity)
    ));
    if !table.provenance.feasible {
        m.doubts.push("it is a compromise: the limits of its spec are not met".to_owned());
    }
    Ok(m)
}

fn spec(s: &Spec) -> Vec<String> {
    let structure = format!(
        "{:?} with {} notches and {} low-passes to set",
        s.structure.controller, s.search.notches, s.search.lowpasses
    );
    let clock = s
        .sample_time_s
        .map_or("sample time: the controller's".to_owned(), |t| format!("sample time {} us", short(1e6 * t)));
    let mut says = vec![format!(
        "makes {} smallest; {}; {clock}; keeps {} % of room to every limit",
        s.objective.minimise.name(),
        structure.to_lowercase(),
        short(100.0 * s.guard)
    )];
    let wanted: Vec<String> = Requirement::list(&s.margins, &s.limits)
        .iter()
        .map(|r| {
            let side = if r.side == Side::AtLeast { "at least" } else { "at most" };
            format!("{} {side} {} {}", r.what, short(r.limit), r.what.unit())
        })
        .collect();
    says.push(if wanted.is_empty() { "no limits".to_owned() } else { format!("limits: {}", wanted.join(", ")) });
    if let Some(p) = &s.profile {
        says.extend(profile(p).into_iter().map(|line| format!("its profile: {line}")));
    }
    says
}

fn profile(p: &Profile) -> Vec<String> {
    let s = &p.spiral;
    let [first, last] = p.pes.window;
    let bins = p.pes.sample_rate_hz / (last - first) as f64;
    vec![
        format!(
            "moves {} at {} per second from {} ms to {} ms of {} ms",
            short(s.distance),
            short(s.velocity),
            short(1e3 * s.start_s),
            short(1e3 * Reference::of(s).end_s()),
            short(1e3 * s.duration_s)
        ),
        format!(
            "read at {} Hz; DFT over {} samples, a bin each {} Hz",
            short(p.pes.sample_rate_hz),
            last - first,
            short(bins)
        ),
    ]
}

fn case(file: &Path) -> Result<Meaning, Failure> {
    let folder = if file.is_dir() { file } else { file.parent().unwrap_or(Path::new(".")) };
    let c = Case::read(folder, &RecordSettings::default())?;
    let of = |role: Role| c.records.iter().filter(|(e, _)| e.role == role).count();
    let mut says = vec![format!("case {}: {} records to fit, {} held out", c.id, of(Role::Fit), of(Role::Holdout))];
    if !c.further_inputs.is_empty() {
        says.push(format!("further inputs that may act on the position: {}", c.further_inputs.join(", ")));
    }
    let read = load::plant(&c.plant)?;
    says.extend(plant(read).says.into_iter().map(|line| format!("its plant: {line}")));
    match &c.controller {
        Some(file) => {
            says.extend(controller(load::controller(file)?).says.into_iter().map(|l| format!("its controller: {l}")))
        }
        None => says.push("no controller: the command is taken as given".to_owned()),
    }
    says.extend(
        c.records.iter().flat_map(|(e, r)| record(r).into_iter().map(move |line| format!("{}: {line}", e.name()))),
    );
    Ok(Meaning::of(says))
}

fn fleet(file: &Path) -> Result<Meaning, Failure> {
    let f = servotune_fleet::Fleet::read(file)?.file;
    let input = match (&f.input.tree, &f.input.table) {
        (Some(tree), _) => format!("slots in the folders of {}", tree.display()),
        (_, Some(table)) => format!("slots in the table {}", table.display()),
        _ => "made-up slots".to_owned(),
    };
    let mut m = Meaning::of(vec![format!(
        "{input}; at most {} shared tables for {} % of the slots",
        f.tables.most,
        short(100.0 * f.tables.coverage)
    )]);
    m.says.extend(
        spec(&Spec::read(&f.spec).map_err(TuneError::from)?).into_iter().map(|line| format!("its spec: {line}")),
    );
    m.says
        .extend(controller(load::controller(&f.controller)?).says.into_iter().map(|l| format!("its controller: {l}")));
    for path in [&f.input.tree, &f.input.table, &f.gate].into_iter().flatten().filter(|p| !p.exists()) {
        m.doubts.push(format!("{}: is not there", path.display()));
    }
    Ok(m)
}

/// A result of this program: its own words.
fn json(file: &Path) -> Result<Meaning, Failure> {
    let value: serde_json::Value =
        serde_json::from_str(&read_text(file)?).map_err(|source| Failure::Json { source })?;
    let word = |key: &str| value.get(key).map(|v| v.as_str().map_or_else(|| v.to_string(), str::to_owned));
    let says = ["schema", "id", "verdict", "proved", "program"]
        .into_iter()
        .filter_map(|key| word(key).map(|v| format!("{key}: {v}")));
    Ok(Meaning::of(says.collect()))
}

/// Five digits are enough for a person.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) {
        let digits = (4.0 - x.abs().max(1e-300).log10().floor()).clamp(0.0, 8.0) as usize;
        let text = format!("{x:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{x:.4e}")
    }
}
