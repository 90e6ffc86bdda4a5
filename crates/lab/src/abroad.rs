//! The diagnosis away from home: machines of another make and real recordings, before and after.
//!
//! In: the folder of measured records. Out: one table; what stood there before this page was first made is `abroad_before.json`, written by the
//! same command on the program as it was.

use super::abroad_records::{guide, motor_bench, oscillator, pulley};
use super::foreign_case::{Foretold, foretold};
use super::foreign_stage::{BARE, Stage};
use super::{Study, StudyError};
use serde::{Deserialize, Serialize};
use servotune::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use servotune::lti::Plant;
use servotune::recording::Case;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// One case as it came out.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    id: String,
    what: String,
    expected: String,
    verdict: String,
    findings: String,
    /// Simulation of held-out rows: given, refit, with findings (position_unit).
    holdout: [f64; 3],
    floor: f64,
    unit: String,
    seconds: f64,
    /// What the diagnosis says of itself: its findings and remarks.
    #[serde(default)]
    says: Vec<String>,
}

fn row(id: &str, what: &str, expected: &str, unit: &str, d: &Diagnosis, seconds: f64) -> Row {
    let h = d.fit.holdout.unwrap_or(d.fit.fit);
    Row {
        id: id.into(),
        what: what.into(),
        expected: expected.into(),
        verdict: serde_json::to_string(&d.verdict).unwrap_or_default().trim_matches('"').into(),
        findings: d.findings.iter().map(|f| f.family.join(" or ")).collect::<Vec<_>>().join(", "),
        // What is no number is written as a very large one: JSON has no infinity.
        holdout: [h.rms_before, h.rms_refit_linear, h.rms_after].map(|v| if v.is_finite() { v } else { 1e300 }),
        floor: h.noise_floor,
        unit: unit.into(),
        seconds,
        says: d.findings.iter().map(|f| f.says.clone()).chain(d.remarks.iter().cloned()).collect(),
    }
}

fn foreign(f: &Foretold) -> Result<Row, StudyError> {
    let (case, plant, controller) = f.trial.made(f.id)?;
    let began = Instant::now();
    let d = diagnose(&case, &plant, Some(&controller), &DiagnoseSettings::default(), |_| {})?.diagnosis;
    let seconds = began.elapsed().as_secs_f64();
    let expected = if f.expected.is_empty() { "no finding".to_owned() } else { f.expected.join(", ") };
    Ok(row(f.id, f.what, &expected, "track", &d, seconds))
}

/// The slow stage: what acts, what is expected, and the size of the multisine that the given model was fitted to.
fn stages() -> Vec<(&'static str, &'static str, &'static str, Stage, Option<f64>)> {
    let friction = |level: f64, rise: f64| Stage { friction: [level, rise, 2.0, 6e-3, 1e-3], ..BARE };
    vec![
        ("stage_sound", "stage in mm and A at 2 kHz, nothing", "no finding", BARE, None),
        (
            "stage_friction",
            "the same, dry friction of 0.3 A, a fifth more at rest, model fitted under it at the large multisine",
            "coulomb_friction",
            friction(0.3, 0.2),
            Some(0.8),
        ),
        (
            "stage_dead_band",
            "the same, dead band of 0.1 A, model fitted under it at the small multisine",
            "dead_band",
            Stage { dead_band: 0.1, ..BARE },
            Some(0.25),
        ),
        (
            "stage_friction_small",
            "the same, dry friction of 0.12 A, model fitted under it at the small multisine",
            "coulomb_friction",
            friction(0.12, 0.0),
            Some(0.25),
        ),
    ]
}

fn staged(id: &str, what: &str, expected: &str, stage: &Stage, size: Option<f64>) -> Result<Row, StudyError> {
    let (case, plant, controller) = stage.made(id, size)?;
    let began = Instant::now();
    let d = diagnose(&case, &plant, Some(&controller), &DiagnoseSettings::default(), |_| {})?.diagnosis;
    Ok(row(id, what, expected, "mm", &d, began.elapsed().as_secs_f64()))
}

/// Three digits, and never seventy.
fn figure(v: f64) -> String {
    if v >= 1e6 || (v > 0.0 && v < 1e-4) {
        format!("{v:.2e}")
    } else {
        format!("{v:.*}", (2.0 - v.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize)
    }
}

fn page(rows: &[Row], before: &[Row]) -> String {
    let mut text = String::from(
        "# Away from home\n\nMade by `lab abroad --data ../shared/data --out results`: machines of another make (`crates/lab/src/foreign.rs`, `foreign_stage.rs`: other forms of the laws, other integrators) and real recordings, each \
         with a linear model. Figures are the reported simulation of held-out rows: given model, linear refit, with findings; floor is what repeats differ by. *Before* is the same command on the program as \
         it was (`crates/lab/src/abroad_before.json`); `--cases` makes single lines again.\n\n| case | expected | before | after | before: given / refit / findings | after: given / refit / findings | floor | s before | s after |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let b = before.iter().find(|b| b.id == r.id);
        let said = |r: &Row| format!("{} ({})", r.verdict, r.findings);
        let three = |r: &Row| r.holdout.map(figure).join(" / ");
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {}: {} | {} | {} | {} | {} | {} {} | {} | {} | {} |",
            r.id,
            r.what,
            r.expected,
            b.map_or("-".into(), said),
            said(r),
            b.map_or("-".into(), three),
            three(r),
            r.unit,
            figure(r.floor),
            b.map_or("-".into(), |b| figure(b.seconds)),
            figure(r.seconds)
        );
    }
    text.push_str("\n## Where it falls short\n\n");
    let short: Vec<String> = rows.iter().flat_map(shortfalls).collect();
    text.push_str(&if short.is_empty() { "Nowhere in these lines.\n".into() } else { short.concat() });
    text.push_str("\n## What each diagnosis says\n\n");
    for r in rows.iter().filter(|r| !r.says.is_empty()) {
        let _ = writeln!(text, "- {}\n  - {}", r.id, r.says.join("\n  - "));
    }
    text
}

/// Times the floor from which held-out rows count as not explained, and by how much a model that is offered may be above the given one.
const LEFT: f64 = 3.0;
const ALIKE: f64 = 1.01;

/// What is missing in one line, as items of a list: names that were expected, error that is left, models worse than the given one.
fn shortfalls(r: &Row) -> Vec<String> {
    let mut all = Vec::new();
    let silent = ["no finding", "no worse than given"].contains(&r.expected.as_str());
    let missing: Vec<&str> = r.expected.split(", ").filter(|e| !silent && !r.findings.contains(e)).collect();
    if !missing.is_empty() {
        all.push(format!("- {}: {} is not found, the verdict is {}\n", r.id, missing.join(" and "), r.verdict));
    }
    if r.expected == "no finding" && !r.findings.is_empty() {
        all.push(format!("- {}: a false alarm, {}\n", r.id, r.findings));
    }
    let [given, refit, after] = r.holdout;
    if after > LEFT * r.floor {
        all.push(format!(
            "- {}: {} {} are left of the held-out rows, {} times what counts as noise there\n",
            r.id,
            figure(after),
            r.unit,
            figure(after / r.floor)
        ));
    }
    for (what, error) in [("the linear refit", refit), ("the model with findings", after)] {
        if error > ALIKE * given {
            all.push(format!(
                "- {}: {what} is worse than the given model, {} against {} {}\n",
                r.id,
                figure(error),
                figure(given),
                r.unit
            ));
        }
    }
    all
}

/// Makes the page, of the cases that are asked for or of all; those that are not keep their lines of `known`, the page's last figures.
pub fn abroad(
    data: &Path,
    asked: &[String],
    known: Option<&str>,
    say: &mut dyn FnMut(&str),
) -> Result<Study, StudyError> {
    let known: Vec<Row> = known.map(serde_json::from_str).transpose()?.unwrap_or_default();
    let mut rows = Vec::new();
    let keep = |rows: &mut Vec<Row>, id: &str, say: &mut dyn FnMut(&str)| {
        let made_now = asked.is_empty() || asked.iter().any(|a| a == id);
        if made_now {
            say(id);
        } else {
            rows.extend(known.iter().find(|r| r.id == id).cloned());
        }
        !made_now
    };
    for f in &foretold() {
        if !keep(&mut rows, f.id, say) {
            rows.push(foreign(f)?);
        }
    }
    for (id, what, expected, stage, size) in stages() {
        if !keep(&mut rows, id, say) {
            rows.push(staged(id, what, expected, &stage, size)?);
        }
    }
    type Make = fn(&Path) -> Result<(Case, Plant), StudyError>;
    let real: [(&str, &str, Make); 4] = [
        ("motor_bench", "two masses and a shaft, real", motor_bench),
        ("linear_guide", "guide with two masses, real, 100 000 samples a record", guide),
        ("pulley", "pulley drive, sensor without a sign, real", pulley),
        ("silverbox", "electronic Duffing oscillator, real", oscillator),
    ];
    for (id, what, make) in real {
        if keep(&mut rows, id, say) {
            continue;
        }
        let (case, plant) = make(data)?;
        let began = Instant::now();
        let d = diagnose(&case, &plant, None, &DiagnoseSettings::default(), |step| say(&format!("{id}: {step}")))?
            .diagnosis;
        let seconds = began.elapsed().as_secs_f64();
        rows.push(row(id, what, "no worse than given", &plant.position_unit, &d, seconds));
    }
    let before: Vec<Row> = serde_json::from_str(include_str!("abroad_before.json"))?;
    let mut study = Study::default();
    study.page("mismatch/abroad.md", page(&rows, &before));
    study.page("mismatch/abroad.json", serde_json::to_string_pretty(&rows)? + "\n");
    Ok(study)
}
