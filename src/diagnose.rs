//! `servotune diagnose`: a case folder, or records straight from CSV files, to a diagnosis.

use super::diagnose_arguments::DiagnoseArguments;
use super::{Ending, Failure, Screen, diagnose_effects, diagnose_rules, load};
use servotune::diagnose::{Coupling, DiagnoseSettings, Diagnosis, Rule, decision_rules, diagnose};
use servotune::document::{FileSet, check_target};
use servotune::gate::features::csv_field;
use servotune::recording::{Case, NominalNoise, Record, RecordEntry, Role};
use servotune_answer::{case_provenance, conclude, sure};
use servotune_report::diagnosis::{diagnosis_page, diagnosis_sentence};
use servotune_report::number::NumberFormat;
use std::fmt::Write;
use std::path::PathBuf;

/// The file of the corrected model, in the output folder.
const CORRECTED: &str = "plant_corrected.toml";
/// Impulse responses of further inputs, beside it.
const COUPLING: &str = "coupling.csv";
/// The page for people, beside it.
pub(super) const REPORT: &str = "report.html";

/// Three digits.
fn three(value: f64) -> String {
    NumberFormat::Significant(3).text(value)
}

/// The impulse responses as comma-separated columns over time, each headed by its input and its unit.
fn coupling_table(couplings: &[Coupling], sample_time_s: f64, unit: &str) -> String {
    let heading = |c: &Coupling| csv_field(&format!("{}_{unit}_per_unit", c.input));
    let mut text = format!("time_s,{}\n", couplings.iter().map(heading).collect::<Vec<_>>().join(","));
    for k in 0..couplings.iter().map(|c| c.response.len()).max().unwrap_or(0) {
        let _ = write!(text, "{}", k as f64 * sample_time_s);
        for c in couplings {
            let _ = write!(text, ",{}", c.response.get(k).copied().unwrap_or(0.0));
        }
        text.push('\n');
    }
    text
}

fn case(a: &DiagnoseArguments) -> Result<Case, Failure> {
    if let Some(folder) = &a.case {
        return Ok(Case::read(folder, &a.settings(None))?);
    }
    let entry = |file: &PathBuf, role, group: Option<String>, suffix: &str| RecordEntry {
        file: PathBuf::from(format!("{}{suffix}", file.display())),
        role,
        repeat_group: group,
    };
    let mut records = Vec::new();
    for file in &a.record {
        let group = a.repeats.then(|| "repeats".to_owned());
        records.push((entry(file, Role::Fit, group, ""), Record::read(file, &a.settings(a.rows))?));
        if a.holdout_rows.is_some() {
            let held = Record::read(file, &a.settings(a.holdout_rows))?;
            records.push((entry(file, Role::Holdout, None, "#holdout"), held));
        }
    }
    for file in &a.holdout {
        records.push((entry(file, Role::Holdout, None, ""), Record::read(file, &a.settings(None))?));
    }
    let id =
        a.record.first().and_then(|f| f.file_stem()).map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let case = Case {
        id: id.trim_end_matches(".csv").to_owned(),
        plant: a.plant.clone().unwrap_or_default(),
        controller: a.controller.clone(),
        spindle_hz: a.spindle_hz,
        further_inputs: vec![],
        records,
    };
    let first = a.record.first().cloned().unwrap_or_default();
    Ok(case.checked(&first)?)
}

pub(super) fn run(a: &DiagnoseArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    if a.rules {
        let rules: Vec<&Rule> = decision_rules().collect();
        screen.result(&rules, &diagnose_rules::text(&rules))?;
        return Ok(Ending::Accepted);
    }
    if a.effects {
        screen.result(&diagnose_effects::document(), &diagnose_effects::text())?;
        return Ok(Ending::Accepted);
    }
    let (diagnosis, text) = make(a, screen)?;
    screen.result(&diagnosis, &text)?;
    Ok(if sure(&diagnosis) { Ending::Accepted } else { Ending::Rejected })
}

/// Diagnoses and writes every file; gives the diagnosis and what a person reads of it.
pub(super) fn make(a: &DiagnoseArguments, screen: &mut Screen) -> Result<(Diagnosis, String), Failure> {
    check_target(&a.out.join(CORRECTED))?;
    let case = case(a)?;
    let plant = load::plant(&case.plant)?;
    let controller = case.controller.as_ref().map(|f| load::controller(f)).transpose()?;
    let mut settings = DiagnoseSettings::default();
    settings.select.bootstrap = a.bootstrap as usize;
    if let Some(folder) = &a.case {
        settings.noise = NominalNoise::read(folder)?;
    }
    let mut made =
        diagnose(&case, &plant, controller.as_ref(), &settings, |m| screen.say(&format!("{}: {m}", case.id)))?;
    // Model, page and findings belong together: all of them appear or none.
    let mut files = FileSet::default();
    let conclusion = conclude(&mut made, CORRECTED);
    if let Some(plant) = &conclusion.corrected {
        files.write(&a.out.join(CORRECTED), toml::to_string(plant).map_err(|source| Failure::Toml { source })?);
    }
    screen.say(&format!("{}: drawing the report", case.id));
    let page = diagnosis_page(&made, case_provenance(&case))?;
    let sentence = diagnosis_sentence(&made);
    files.write(&a.out.join(REPORT), page.html());
    let diagnosis = made.diagnosis;
    let json = serde_json::to_string_pretty(&diagnosis).map_err(|source| Failure::Json { source })?;
    files.write(&a.out.join("diagnosis.json"), format!("{json}\n"));
    if !diagnosis.coupling.is_empty() {
        let responses = coupling_table(&diagnosis.coupling, made.data.scene.sample_time_s, &plant.position_unit);
        files.write(&a.out.join(COUPLING), responses);
    }
    files.commit()?;
    let verdict = serde_json::to_string(&diagnosis.verdict).unwrap_or_default();
    let mut text = format!("{}: {}\n{sentence}\n", diagnosis.id, verdict.trim_matches('"'));
    // Writing to a String cannot fail.
    for f in &diagnosis.findings {
        let _ = writeln!(text, "  {}: {}", f.effect, f.says);
        if f.family.len() > 1 {
            let _ = writeln!(text, "    these records do not tell apart: {}", f.family.join(", "));
        }
        for (name, e) in &f.parameters {
            let _ =
                writeln!(text, "    {name} = {} ({} to {}) {}", three(e.value), three(e.low), three(e.high), e.unit);
        }
    }
    let unit = &plant.position_unit;
    let mut figures = |name: &str, f: &servotune::diagnose::FitFigures| {
        let _ = writeln!(
            text,
            "  {name}: rms {} before, {} after a linear refit, {} with the findings; noise floor {} {unit}",
            three(f.rms_before),
            three(f.rms_refit_linear),
            three(f.rms_after),
            three(f.noise_floor)
        );
    };
    if let Some(h) = &diagnosis.fit.holdout {
        figures("hold-out", h);
    }
    figures("fit", &diagnosis.fit.fit);
    if let Some(o) = &diagnosis.fit.open_loop {
        figures("open loop", o);
    }
    for r in &diagnosis.remarks {
        let _ = writeln!(text, "  {r}");
    }
    if !diagnosis.coupling.is_empty() {
        let _ = writeln!(text, "  impulse responses of the further inputs: {}", a.out.join(COUPLING).display());
    }
    let next = &diagnosis.next_experiment;
    // Without a rival there is nothing to separate.
    let gain = if next.expected_separation > 0.0 {
        format!(" (expected separation {})", three(next.expected_separation))
    } else {
        String::new()
    };
    let _ = writeln!(text, "  next: {}{gain}", next.what);
    Ok((diagnosis, text))
}
