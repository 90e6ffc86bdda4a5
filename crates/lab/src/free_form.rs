//! Curves without a name on real recordings: the pulley drive whose speed sensor does not see the sign, the electronic Duffing oscillator,
//! the motor bench. Errors on held-out rows before and after, and pictures of the curves.
//!
//! Data: sources and licences are on the page. Each diagnosis is given a linear model and nothing else.

use super::recordings::{Recording, case, motor, silverbox};
use super::{Study, StudyError};
use servotune::diagnose::{DiagnoseSettings, Diagnosed, diagnose, missing_curve};
use servotune::lti::{Body, Plant};
use servotune::numeric::statistics::rms_of;
use servotune::recording::{Case, ColumnNames, Record, RecordEntry, RecordSettings, Role};
use servotune_report::diagnosis::diagnosis_page;
use servotune_report::diagnosis_curve::curve_figure;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Rows of each record that are fitted and held out.
const FITTED: [usize; 2] = [0, 300];
const HELD: [usize; 2] = [300, 500];

/// Three records side by side in one file, under one linear model: a rough guess, the refit does the rest.
fn pulley(data: &Path) -> Result<(Case, Plant), StudyError> {
    let file = data.join("ced_prbs/ced_prbs.csv");
    if !file.exists() {
        return Err(StudyError::Absent { file });
    }
    let mut records = Vec::new();
    for size in ["1V", "1p5V", "0p5V"] {
        for (rows, role, part) in [(FITTED, Role::Fit, "fit"), (HELD, Role::Holdout, "held")] {
            let names = ColumnNames {
                time: "t_s".into(),
                reference: String::new(),
                command: format!("u_{size}"),
                position: format!("z_{size}"),
                ..ColumnNames::default()
            };
            let settings = RecordSettings { names, sample_time_s: None, rows: Some(rows), further: vec![] };
            let entry = RecordEntry { file: PathBuf::from(format!("{size}_{part}")), role, repeat_group: None };
            records.push((entry, Record::read(&file, &settings)?));
        }
    }
    let plant = Plant {
        position_unit: "tick/s".into(),
        command_unit: "V".into(),
        body: Body::SecondOrder { dc_gain: 2.0, natural_frequency_rad_s: 10.0, damping_ratio: 0.3 },
        delay_s: 0.02,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    };
    Ok((
        Case {
            id: "Pulley drive".into(),
            plant: PathBuf::new(),
            controller: None,
            spindle_hz: None,
            further_inputs: vec![],
            records,
        },
        plant,
    ))
}

/// Root mean square behind the first samples.
fn rms(errors: &[f64], skip: usize) -> f64 {
    rms_of(errors.iter().skip(skip).copied())
}

/// What a diagnosis says, and its held-out errors record by record.
fn told(text: &mut String, made: &Diagnosed, (factor, unit): (f64, &str), skip: usize) {
    let d = &made.diagnosis;
    let verdict = serde_json::to_string(&d.verdict).unwrap_or_default();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "Verdict: **{}**.\n", verdict.trim_matches('"'));
    for f in &d.findings {
        let _ = writeln!(text, "- {}: {}", f.effect, f.says);
        for (name, e) in &f.parameters {
            let _ = writeln!(text, "  - {name} = {:.4} ({:.4} to {:.4}) {}", e.value, e.low, e.high, e.unit);
        }
    }
    let _ =
        writeln!(text, "\n| held-out record | model as given ({unit} rms) | linear refit | after |\n|---|---|---|---|");
    for (i, run) in made.data.runs.iter().enumerate().filter(|(_, r)| r.role == Role::Holdout) {
        let [given, refit, after] = [0, 1, 2].map(|m| factor * rms(&made.errors[m][i], skip));
        let _ = writeln!(text, "| {} | {given:.4} | {refit:.4} | {after:.4} |", run.name);
    }
    if let Some(curve) = &d.free_form {
        let _ = writeln!(text, "\n{}", curve.says);
    }
    text.push('\n');
}

/// The curve estimated on a bench whatever the verdict, with its picture and held-out error.
fn curve(study: &mut Study, text: &mut String, made: &Diagnosed, name: &str, r: &Recording) -> Result<(), StudyError> {
    let Some(found) = missing_curve(&made.data, &made.selection) else {
        text.push_str("No curve foretells clearly better than a linear plant.\n\n");
        return Ok(());
    };
    let held = made.data.runs.iter().position(|run| run.role == Role::Holdout).unwrap_or(0);
    let (factor, unit) = r.metric;
    let _ = writeln!(
        text,
        "The curve alone, beside a linear plant and no named law: {:.4} {unit} on the held-out rows. {} Best port by what was left out: {} over {}.\n\n![curve](../figures/{name}.svg)\n",
        factor * rms(&found.errors[held], r.skip),
        found.curve.says,
        found.curve.port,
        found.curve.argument,
    );
    let ports: Vec<String> = found.curve.ports.iter().map(|(p, e)| format!("{p} {e:.4e}")).collect();
    let _ = writeln!(text, "Left-out error by port (rms, {}): {}.\n", made.refitted.position_unit, ports.join(", "));
    study.picture(name, &curve_figure(&found.curve)?);
    Ok(())
}

/// Makes the page from the folder of measured records.
pub fn free_form(data: &Path) -> Result<Study, StudyError> {
    let mut study = Study::default();
    let mut text = String::from(
        "# Curves without a name\n\nMade by `lab free-form --data DATA --out results`, DATA being the folder with `ced_prbs/`, `silverbox/` and `motor_bench/`. Each diagnosis \
         is given a linear model and nothing else; errors are of the open-loop simulation driven by the recorded command, each record's own start estimated.\n\n\
         Sources: pulley drive, T. Wigren, M. Schoukens, Uppsala University technical report 2017-024, by way of RomanFoell/DRGP-VSS (MIT). Silverbox, T. Wigren, J. Schoukens, ECC 2013. Motor \
         bench, Hori-Fujimoto Lab (FdiTools), MIT.\n\n## Pulley drive\n\nTwo motors drive a pulley over a belt; a pulse counter gives the speed without its sign. Three records of 500 samples at \
         50 Hz; the first 300 rows of each fitted, the last 200 held out. A crude third-order linear fit leaves 1.58, 3.13 and 0.68 at 1, 1.5 and 0.5 V, the same followed by an absolute value \
         0.51, 0.55 and 0.50 (description of the data).\n\n",
    );
    let (drive, plant) = pulley(data)?;
    let made = diagnose(&drive, &plant, None, &DiagnoseSettings::default(), |_| {})?;
    told(&mut text, &made, (1.0, "tick/s"), 0);
    if let Some(found) = missing_curve(&made.data, &made.selection) {
        let _ = writeln!(
            text,
            "The sensor's curve, estimated freely: {}\n\n![curve](../figures/free_form_pulley.svg)\n",
            found.curve.says
        );
        study.picture("free_form_pulley", &curve_figure(&found.curve)?);
    }
    study.page("mismatch/pulley_drive.html", page(&made, "ced_prbs/ced_prbs.csv")?);
    text.push_str("Report with pictures: [pulley_drive.html](pulley_drive.html).\n\n");
    for (r, name) in [(silverbox(), "free_form_silverbox"), (motor(data)?, "free_form_motor")] {
        let read = case(&r, data)?;
        let made = diagnose(&read, &r.plant, None, &DiagnoseSettings::default(), |_| {})?;
        let _ = writeln!(text, "## {}\n\n{}\n", r.name, r.words);
        told(&mut text, &made, r.metric, r.skip);
        curve(&mut study, &mut text, &made, name, &r)?;
    }
    study.page("mismatch/free_form.md", text);
    Ok(study)
}

fn page(made: &Diagnosed, file: &str) -> Result<String, StudyError> {
    Ok(diagnosis_page(made, vec![("Records".to_owned(), file.to_owned())])?.html())
}
