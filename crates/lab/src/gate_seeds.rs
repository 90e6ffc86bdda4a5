//! The gate over many seeds: each trains on a line of its own and judges a fresh line and five unknown kinds.
//!
//! In: how many seeds. Out: `gate_seeds.md` and `gate_seeds.json`: every number of every seed, then mean, least and most.

use super::gate::{table, table_of};
use super::{Study, StudyError};
use rayon::prelude::*;
use serde::Serialize;
use servotune::gate::features::RawMachine;
use servotune::gate::{Action, Doubt, Gate, GateVerdict, Table, TrainSettings, calibration_error, train};
use servotune::twin::line::{LineSettings, UnknownKind, unknown_line};
use servotune_report::number::NumberFormat;
use servotune_report::table::{self as sheet, Column};
use std::collections::BTreeMap;

/// Seeds of the study.
const SEEDS: u64 = 20;
/// A fresh line has another seed than any training line.
const FRESH: u64 = 1000;
/// Machines of each unknown kind for each seed.
const STRANGERS: usize = 20;

/// What one seed gave.
#[derive(Clone, Debug, Serialize)]
struct Seed {
    seed: u64,
    machines: usize,
    accuracy: f64,
    /// Share of test rows of its own training.
    test_accuracy: f64,
    calibration_error: f64,
    coverage_stated: f64,
    coverage: f64,
    set_size: f64,
    broken: usize,
    broken_tuned: usize,
    broken_left_alone: usize,
    wrong_decisions: usize,
    abstained: usize,
    /// Rows by the reason not to decide; a row may have several.
    reasons: BTreeMap<&'static str, usize>,
    /// Machines of each unknown kind that were not decided, and how many there were.
    strangers: BTreeMap<&'static str, Stranger>,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Stranger {
    machines: usize,
    abstained: usize,
    tuned: usize,
    left_alone: usize,
}

fn reason(doubt: &Doubt) -> &'static str {
    match doubt {
        Doubt::SeveralClasses { .. } => "several classes possible",
        Doubt::Cost { .. } => "inspection costs less",
        Doubt::OtherAction { .. } => "another action costs less",
        Doubt::Unknown { .. } => "of no known class",
        Doubt::PlantDisagrees { .. } => "plant disagrees",
        Doubt::Missing { .. } => "features missing",
        #[allow(unreachable_patterns)]
        _ => "other",
    }
}

/// Makes the study.
pub fn gate_seeds() -> Result<Study, StudyError> {
    let found = (1..=SEEDS).into_par_iter().map(one).collect::<Result<Vec<Seed>, StudyError>>()?;
    let mut study = Study::default();
    study.page("gate_seeds.md", page(&found)?);
    study.page("gate_seeds.json", serde_json::to_string_pretty(&found)? + "\n");
    Ok(study)
}

fn one(seed: u64) -> Result<Seed, StudyError> {
    let of = |seed: u64| LineSettings { seed, ..LineSettings::default() };
    let settings = TrainSettings { seed, ..TrainSettings::default() };
    let trained = train(&table_of(&of(seed))?, &settings)?;
    let gate = &trained.gate;
    let fresh = table_of(&of(FRESH + seed))?;
    let said = gate.classify(&fresh)?;
    let truth = truths(gate, &fresh);
    let names = |v: &GateVerdict| gate.classes.labels.iter().position(|l| *l == v.class);
    let n = said.len().max(1) as f64;
    let right = said.iter().zip(&truth).filter(|(v, t)| names(v) == **t).count();
    let known: Vec<(usize, Vec<f64>)> =
        said.iter().zip(&truth).filter_map(|(v, t)| Some(((*t)?, v.probabilities.clone()))).collect();
    let (class, p): (Vec<usize>, Vec<Vec<f64>>) = known.into_iter().unzip();
    let covered = said.iter().zip(&truth).filter(|(v, t)| t.is_some_and(|t| v.set.contains(&gate.classes.labels[t])));
    let is_broken = |t: &Option<usize>| t.is_some_and(|t| gate.classes.actions[t].repairs());
    let broken = || said.iter().zip(&truth).filter(|(_, t)| is_broken(t)).map(|(v, _)| v.action);
    let mut reasons = BTreeMap::new();
    for doubt in said.iter().flat_map(|v| &v.doubts) {
        *reasons.entry(reason(doubt)).or_default() += 1;
    }
    let mut strangers = BTreeMap::new();
    for kind in UnknownKind::ALL {
        let machines: Vec<RawMachine> =
            unknown_line(kind, FRESH + seed, STRANGERS)?.into_iter().map(|m| m.record).collect();
        strangers.insert(kind.name(), stranger(gate, &machines, &fresh)?);
    }
    Ok(Seed {
        seed,
        machines: said.len(),
        accuracy: right as f64 / n,
        test_accuracy: trained.report.accuracy,
        calibration_error: calibration_error(&p, &class),
        coverage_stated: gate.conformal.coverage,
        coverage: covered.count() as f64 / n,
        set_size: said.iter().map(|v| v.set.len()).sum::<usize>() as f64 / n,
        broken: broken().count(),
        broken_tuned: broken().filter(|a| *a == Action::Tune).count(),
        broken_left_alone: broken().filter(|a| *a == Action::None).count(),
        wrong_decisions: said.iter().zip(&truth).filter(|(v, t)| !v.abstained && names(v) != **t).count(),
        abstained: said.iter().filter(|v| v.abstained).count(),
        reasons,
        strangers,
    })
}

fn truths(gate: &Gate, t: &Table) -> Vec<Option<usize>> {
    t.labels().unwrap_or_default().iter().map(|l| gate.classes.find(l)).collect()
}

fn stranger(gate: &Gate, machines: &[RawMachine], like: &Table) -> Result<Stranger, StudyError> {
    let t = table(machines, "unknown kind", Some(like))?;
    let said = gate.classify(&t)?;
    let acted = |action: Action| said.iter().filter(|v| v.action == action).count();
    Ok(Stranger {
        machines: said.len(),
        abstained: said.iter().filter(|v| v.abstained).count(),
        tuned: acted(Action::Tune),
        left_alone: acted(Action::None),
    })
}

/// Mean, least and most of a number over the seeds.
fn row(t: &mut sheet::Table, name: &str, of: impl Fn(&Seed) -> f64, found: &[Seed]) -> Result<(), StudyError> {
    let v: Vec<f64> = found.iter().map(of).collect();
    let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
    let low = v.iter().copied().fold(f64::INFINITY, f64::min);
    let high = v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    t.push(vec![name.into(), mean.into(), low.into(), high.into()])?;
    Ok(())
}

fn page(found: &[Seed]) -> Result<String, StudyError> {
    let number = |name: &str| Column::numbers(name, "", NumberFormat::Significant(4));
    let columns = || vec![Column::words("over the seeds"), number("mean"), number("least"), number("most")];
    let share = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    let mut known = sheet::Table::new("Fresh line of known classes", columns());
    row(&mut known, "accuracy (%)", |s| 100.0 * s.accuracy, found)?;
    row(&mut known, "accuracy on the test part of the training (%)", |s| 100.0 * s.test_accuracy, found)?;
    row(&mut known, "expected calibration error", |s| s.calibration_error, found)?;
    row(&mut known, "coverage of the sets, stated (%)", |s| 100.0 * s.coverage_stated, found)?;
    row(&mut known, "coverage of the sets, found (%)", |s| 100.0 * s.coverage, found)?;
    row(&mut known, "classes in a set", |s| s.set_size, found)?;
    row(&mut known, "broken machines sent to tuning (%)", |s| share(s.broken_tuned, s.broken), found)?;
    row(&mut known, "broken machines left alone (%)", |s| share(s.broken_left_alone, s.broken), found)?;
    row(&mut known, "wrong decisions (%)", |s| share(s.wrong_decisions, s.machines), found)?;
    row(&mut known, "left to a person (%)", |s| share(s.abstained, s.machines), found)?;
    let mut why = sheet::Table::new("Left to a person, by reason (% of the machines; one may have several)", columns());
    let kinds: std::collections::BTreeSet<&str> = found.iter().flat_map(|s| s.reasons.keys().copied()).collect();
    for kind in kinds {
        row(&mut why, kind, |s| share(s.reasons.get(kind).copied().unwrap_or(0), s.machines), found)?;
    }
    let mut strange = sheet::Table::new("Unknown kinds left to a person (%)", columns());
    for kind in UnknownKind::ALL {
        let of = |s: &Seed| s.strangers.get(kind.name()).map_or(f64::NAN, |k| share(k.abstained, k.machines));
        row(&mut strange, kind.name(), of, found)?;
    }
    let sum = |f: fn(&Seed) -> usize| found.iter().map(f).sum::<usize>();
    let strangers = |f: fn(&Stranger) -> usize| found.iter().flat_map(|s| s.strangers.values()).map(f).sum::<usize>();
    Ok(format!(
        "# The gate over {} seeds\n\n\
         Made by `lab gate-seeds --out results`; every number of every seed: [gate_seeds.json](gate_seeds.json). Simulated machines\n\
         (`specs/gate_twin.md`). Seed s trains with the default settings on the line of seed s (486 drives) and judges the line of seed {FRESH} + s\n\
         (486 others) and {STRANGERS} machines of each of five kinds that no class knows.\n\n\
         Counts over all seeds: {} machines of known classes, {} of them broken; {} broken sent to tuning, {} broken left alone, {} wrong decisions,\n\
         {} left to a person. {} strangers: {} left to a person, {} sent to tuning, {} left alone.\n\n\
         ```text\n{}\n{}\n{}```\n\n\
         Aims: no broken machine sent to tuning with at most 2 % of known machines left to a person; at least 95 % of each unknown kind\n\
         left to a person.\n",
        found.len(),
        sum(|s| s.machines),
        sum(|s| s.broken),
        sum(|s| s.broken_tuned),
        sum(|s| s.broken_left_alone),
        sum(|s| s.wrong_decisions),
        sum(|s| s.abstained),
        strangers(|k| k.machines),
        strangers(|k| k.abstained),
        strangers(|k| k.tuned),
        strangers(|k| k.left_alone),
        known.text(),
        why.text(),
        strange.text(),
    ))
}
