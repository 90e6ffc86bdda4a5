//! Tuning whose table is proved: search, proof, and again with as much more room as the proof lacked.
//!
//! In: a machine with its files, a spec, the box that the table is to hold over. Out: the outcome, its gain table and the certificate of that
//! table. The search carries the corners of the box along; what the bounds add to them becomes room in the next round.
//! Spec: `specs/certificate.md`.

use super::{
    BoxWatch, Certificate, Inputs, LEAST_DAMPING, LimitVerdict, SourceFile, Stability, Uncertainty, VerifyError,
    VerifySettings, Word, certify_watched,
};
use crate::controller::Controller;
use crate::frf::Sweep;
use crate::lti::Plant;
use crate::numeric::random::Random;
use crate::tune::{
    GainTable, InputDigest, Machine, Outcome, Requirement, SearchWatch, Spec, TuneSettings, What, tune_watched,
    unwatched,
};

/// What a table is tuned and proved on.
#[derive(Clone, Copy, Debug)]
pub enum ProvedOn<'a> {
    /// A plant model and its file.
    Plant {
        /// The model.
        plant: &'a Plant,
        /// The file that the certificate names.
        source: &'a SourceFile,
    },
    /// A sweep, with the machine made from it.
    Sweep {
        /// The sweep.
        sweep: &'a Sweep,
        /// As it is tuned on.
        machine: Machine<'a>,
    },
}

/// A tuning that is to be proved.
#[derive(Clone, Debug)]
pub struct Assurance<'a> {
    /// The machine.
    pub ground: ProvedOn<'a>,
    /// Limits and objective.
    pub spec: &'a Spec,
    /// The spec's file, and the profile's.
    pub spec_source: &'a SourceFile,
    /// See above.
    pub profile: Option<&'a SourceFile>,
    /// Box around the plant; of a sweep the gain alone.
    pub uncertainty: Uncertainty,
    /// Controller to start from.
    pub start: Option<&'a Controller>,
    /// Units of position and command.
    pub units: (&'a str, &'a str),
    /// Digests of the inputs, for the table.
    pub inputs: &'a [InputDigest],
    /// The table's file, named in errors.
    pub gains: &'a std::path::Path,
}

/// A tuned table with its certificate.
#[derive(Clone, Debug)]
pub struct Assured {
    /// What the search says.
    pub outcome: Outcome,
    /// The table.
    pub table: GainTable,
    /// Its certificate, that of a compromise included; the reason where nothing can be proved.
    pub certificate: Result<Certificate, String>,
    /// Tunings.
    pub rounds: usize,
}

/// Who is told how far search and proof are.
#[derive(Clone, Copy)]
pub struct Watched<'a> {
    /// After each round of a search.
    pub search: &'a SearchWatch<'a>,
    /// After each box of the proof of a write.
    pub proof: &'a BoxWatch<'a>,
}

impl Watched<'_> {
    /// Nobody.
    pub const NOBODY: Watched<'static> = Watched { search: &unwatched, proof: &|_, _| {} };
}

/// Tunings at most.
const ROUNDS: usize = 6;
/// How far beyond what a bound lacks the next round keeps room.
const BEYOND: f64 = 1.15;
/// Most room that is asked for, as a share of a limit. What lacks more, such as the margin of a crossing that may hide anywhere, no room mends.
const MOST: f64 = 0.4;
/// Room of |L| from 1 that a crossing elsewhere asks for in one round.
const ELSEWHERE: f64 = 0.08;
/// Share of a later round's starts: the last table is near.
const LATER: usize = 4;

/// Tunes, proves, and tunes again with more room until the table is proved or a limit cannot have that much; `said` is told each round, `watch` how far it is.
pub fn tune_assured(
    job: &Assurance<'_>,
    settings: &TuneSettings,
    said: &mut dyn FnMut(&str),
    watch: &Watched<'_>,
) -> Result<Assured, VerifyError> {
    let corners: Vec<Plant> = match &job.ground {
        ProvedOn::Plant { plant, .. } => corners(plant, &job.uncertainty),
        ProvedOn::Sweep { .. } => Vec::new(),
    };
    let machines: Vec<Machine<'_>> = match &job.ground {
        ProvedOn::Plant { plant, .. } => {
            std::iter::once(Machine::Model(plant)).chain(corners.iter().map(Machine::Model)).collect()
        }
        ProvedOn::Sweep { machine, .. } => vec![*machine],
    };
    let settings = TuneSettings { nominal_first: true, ..*settings };
    let later = TuneSettings { starts: settings.starts.div_ceil(LATER), rounds: 2, ..settings };
    let wanted = Requirement::list(&job.spec.margins, &job.spec.limits);
    let mut spec = job.spec.clone();
    let mut near: Vec<Controller> = Vec::new();
    let mut best: Option<Assured> = None;
    for round in 1..=ROUNDS {
        let settings = if round == 1 { &settings } else { &later };
        let outcome = tune_watched(&machines, &spec, job.start, &near, settings, watch.search)?;
        let inputs = job.inputs.to_vec();
        let sha256 = job.spec_source.sha256();
        let table = GainTable::of_first(&outcome, spec.search.seed, sha256, inputs)?.in_units(job.units.0, job.units.1);
        if outcome.tuned().is_none() || (best.is_some() && !matches!(outcome, Outcome::Tuned(_))) {
            // That much room is not to be had: the table before stands, with what is proved of it.
            return Ok(best.unwrap_or_else(|| assured(job, outcome, table, round, watch)));
        }
        let now = assured(job, outcome, table, round, watch);
        let Ok(c) = &now.certificate else { return Ok(now) };
        if c.proved {
            return Ok(now);
        }
        let (lacking, mended) = room(c, &wanted, spec.guard, &mut spec.further_room);
        if !mended {
            return Ok(better(best, now));
        }
        said(&format!("proof, round {round}: {} without enough room; tuning again with more", lacking.join(", ")));
        near = vec![now.outcome.controller().clone()];
        best = Some(better(best, now));
    }
    match best {
        Some(b) => Ok(b),
        None => Err(VerifyError::NoRound),
    }
}

/// The table with fewer limits left open; of equals the earlier one, which gave away less of the objective.
fn better(before: Option<Assured>, now: Assured) -> Assured {
    let open = |a: &Assured| match &a.certificate {
        Ok(c) => c.cases.iter().flat_map(|c| &c.limits).filter(|l| l.verdict != LimitVerdict::Proved).count(),
        Err(_) => usize::MAX,
    };
    match before {
        Some(b) if open(&b) <= open(&now) => b,
        _ => now,
    }
}

fn assured(job: &Assurance<'_>, outcome: Outcome, table: GainTable, rounds: usize, watch: &Watched<'_>) -> Assured {
    let certificate = prove(job, &table, watch).map_err(|e| e.to_string());
    Assured { outcome, table, certificate, rounds }
}

/// The certificate of a table that lies in no file yet.
fn prove(job: &Assurance<'_>, table: &GainTable, watch: &Watched<'_>) -> Result<Certificate, VerifyError> {
    let gains = SourceFile { file: job.gains.to_owned(), text: table.text()? };
    let (mut plants, mut sweeps) = (Vec::new(), Vec::new());
    match &job.ground {
        ProvedOn::Plant { source, .. } => plants.push((*source).clone()),
        ProvedOn::Sweep { sweep, .. } => sweeps.push((*sweep).clone()),
    }
    let inputs = Inputs {
        gains: &gains,
        plants: &plants,
        sweeps: &sweeps,
        least_damping: LEAST_DAMPING,
        spec: job.spec_source,
        profile: job.profile,
        word: Word::Double,
        uncertainty: job.uncertainty,
    };
    certify_watched(&inputs, &VerifySettings::default(), watch.proof)
}

/// What each limit lacks to its proof is added to the room it keeps: the names of the lacking ones, and whether any room has grown.
fn room(c: &Certificate, wanted: &[Requirement], guard: f64, room: &mut Vec<f64>) -> (Vec<String>, bool) {
    room.resize(wanted.len(), 0.0);
    let (mut names, mut grown) = (Vec::new(), false);
    // What may hide between a sweep's points and leaves its stability open is for another sweep, not for more room.
    let open = |s: Stability| c.sweep.is_some() && s != Stability::Stable;
    for case in c.cases.iter().filter(|case| !open(case.bounds.stability)) {
        for ((limit, w), room) in case.limits.iter().zip(wanted).zip(room.iter_mut()) {
            if limit.verdict == LimitVerdict::Proved {
                continue;
            }
            let lacks = match w.side {
                crate::tune::Side::AtLeast => limit.proven.low.map(|low| 1.0 - low / limit.required),
                crate::tune::Side::AtMost => limit.proven.high.map(|high| high / limit.required - 1.0),
            };
            // Without a bound there is nothing that room could mend.
            let Some(lacks) = lacks.filter(|l| l.is_finite() && *l > 0.0) else { continue };
            // A crossing that may lie at a mode elsewhere is as far away as the mode: there |L| is to keep away from 1.
            let lacks = if w.what == What::GainCrossover { lacks.min(ELSEWHERE) } else { lacks };
            let more = guard.max(*room) + BEYOND * lacks;
            if more > *room && more <= MOST {
                *room = more;
                grown = true;
                names.push(limit.name.clone());
            }
        }
    }
    names.dedup();
    (names, grown)
}

/// Members drawn from the box where frequencies or dampings move, each on its own.
const DRAWN: u64 = 6;

/// The corners of gain and dead time, and drawn members where frequencies or dampings move too.
fn corners(plant: &Plant, u: &Uncertainty) -> Vec<Plant> {
    if !u.any() {
        return Vec::new();
    }
    let mut all = vec![plant.clone()];
    let mut part = |share: f64, moved: &dyn Fn(&Plant, f64) -> Plant| {
        if share > 0.0 {
            all = all.iter().flat_map(|p| [moved(p, 1.0 - share), moved(p, 1.0 + share)]).collect();
        }
    };
    part(u.gain, &|p, by| Plant { resonance_gain: p.resonance_gain * by, ..p.clone() });
    part(u.delay, &|p, by| Plant { delay_s: p.delay_s * by, ..p.clone() });
    if u.frequency > 0.0 || u.damping > 0.0 {
        all.extend((0..DRAWN).map(|i| u.draw(plant, &mut Random::stream(SEED, i))));
    }
    all
}

/// Fixes the drawn members.
const SEED: u64 = 0x5eed_0003;
