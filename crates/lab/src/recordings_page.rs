//! The page of real recordings: EMPS, Silverbox, motor bench, pulley drive, linear guide, mirror. Given only a linear model, what does a diagnosis
//! say, and how well does the corrected model simulate rows that it never used?
//!
//! Data: sources and licences are on the page. Published figures are quoted from the data's own descriptions.

use super::abroad_records::{guide, pulley};
use super::recordings::{Recording, case, emps, motor, motor_speed, silverbox};
use super::{Study, StudyError};
use servotune::diagnose::{DiagnoseSettings, Diagnosed, diagnose};
use servotune::lti::Plant;
use servotune::numeric::digits::said;
use servotune::numeric::statistics::rms_of;
use servotune::recording::{Case, Role, read_columns};
use servotune_report::diagnosis::diagnosis_page;
use std::fmt::Write;
use std::path::Path;

/// A case of real records, and how it is shown.
struct Real {
    name: &'static str,
    file: &'static str,
    /// Which rows are fitted and which held out.
    split: String,
    skip: usize,
    metric: (f64, &'static str),
    words: &'static str,
    published: &'static str,
    case: Case,
    plant: Plant,
}

/// The pulley drive as a case.
fn pulley_drive(data: &Path) -> Result<Real, StudyError> {
    let (case, plant) = pulley(data)?;
    Ok(Real {
        name: "Pulley drive",
        file: "ced_prbs/ced_prbs.csv",
        split: "Rows 0 to 300 of each of three records fitted, 300 to 500 held out.".into(),
        skip: 0,
        metric: (1.0, "tick/s"),
        words: "A speed whose sensor does not see the sign. Yardstick of the data's description on the same rows: a third-order linear model, and the same behind an absolute value.",
        published: "0.51 / 0.55 / 0.50 at 1 / 1.5 / 0.5 V (linear 1.58 / 3.13 / 0.68)",
        case,
        plant,
    })
}

/// The linear guide as a case.
fn linear_guide(data: &Path) -> Result<Real, StudyError> {
    let (case, plant) = guide(data)?;
    Ok(Real {
        name: "Linear guide",
        file: "linear_guide/linear_guide_1.csv.gz",
        split: "The first file fitted, the second, of another multisine, held out; 100 000 samples each.".into(),
        skip: 0,
        metric: (1.0, "mm"),
        words: "Voltage to the motor's encoder. Yardstick of the data's description: a crude fit of two masses, a spring and friction.",
        published: "9 (two masses and friction, crude)",
        case,
        plant,
    })
}

impl Recording {
    /// The recording as a case.
    fn real(self, data: &Path) -> Result<Real, StudyError> {
        let split = format!(
            "Rows {} to {} fitted, {} to {} held out.",
            self.fit[0], self.fit[1], self.holdout[0], self.holdout[1]
        );
        let case = case(&self, data)?;
        let Recording { name, file, skip, metric, plant, words, published, .. } = self;
        Ok(Real { name, file, split, skip, metric, words, published, case, plant })
    }
}

/// Errors of held-out records in the metric's unit: given, refit, findings; one row of three a record.
fn errors_of(r: &Real, m: &Diagnosed) -> Vec<(String, [f64; 3])> {
    let held = (0..m.data.runs.len()).filter(|&i| m.data.runs[i].role == Role::Holdout);
    let row = |i: usize| {
        let rmse = |e: &Vec<Vec<f64>>| r.metric.0 * rms_of(e[i].iter().skip(r.skip).copied());
        (m.data.runs[i].name.clone(), [&m.errors[0], &m.errors[1], &m.errors[2]].map(rmse))
    };
    held.map(row).collect()
}

fn verdict_of(m: &Diagnosed) -> String {
    serde_json::to_string(&m.diagnosis.verdict).unwrap_or_default().trim_matches('"').to_owned()
}

/// Rows of the table at the top of the page.
fn table(r: &Real, m: &Diagnosed) -> String {
    let errors = errors_of(r, m);
    let names: Vec<&str> = m.diagnosis.findings.iter().map(|f| f.effect.as_str()).collect();
    let row = |(record, [given, refit, after]): &(String, [f64; 3])| {
        let which = if errors.len() > 1 { format!(", `{record}`") } else { String::new() };
        let says = format!("{}: {}", verdict_of(m), names.join(", "));
        let figures = format!("{given:.4} | {refit:.4} | **{after:.4}**");
        format!("| {}{which} | {} | {figures} | {} | {says} |\n", r.name, r.metric.1, r.published)
    };
    errors.iter().map(row).collect()
}

/// What a diagnosis of one recording says, as lines of the page.
fn section(r: &Real, m: &Diagnosed) -> String {
    let (d, unit) = (&m.diagnosis, r.metric.1);
    let mut text = format!("## {}\n\n{} {}\n\nVerdict: **{}**.", r.name, r.split, r.words, verdict_of(m));
    // Writing to a String cannot fail.
    for (record, [given, refit, after]) in errors_of(r, m) {
        let _ = write!(
            text,
            " Simulation of `{record}` in open loop: {given:.4} {unit} with the model as given, {refit:.4} {unit} after a linear refit, **{after:.4} {unit}** with the findings."
        );
    }
    text.push_str("\n\n");
    for f in &d.findings {
        let _ = writeln!(text, "- {}: {}", f.family.join(" or "), f.says);
        for (name, e) in &f.parameters {
            let [value, low, high] = [e.value, e.low, e.high].map(|v| said(v, 4));
            let _ = writeln!(text, "  - {name} = {value} ({low} to {high}) {}", e.unit);
        }
    }
    for remark in &d.remarks {
        let _ = writeln!(text, "- {remark}");
    }
    let _ = writeln!(text, "- next: {}\n", d.next_experiment.what);
    text
}

/// How much of the mirror's response is linear: the scatter from one random excitation to the next beside that from period to
/// period (Pintelon & Schoukens, System Identification, ch. 4).
fn mirror(data: &Path) -> Result<String, StudyError> {
    let file = data.join("fsm_100mV/fsm_100mV_frf.csv.gz");
    if !file.exists() {
        return Err(StudyError::Absent { file });
    }
    let mut text = String::from(
        "## Fine steering mirror\n\nNo diagnosis here: three inputs act at once, and `mirror_inputs.md` takes them together. What the response file tells: nonlinear distortion of a random excitation scatters \
         from realisation to realisation beyond the noise between periods. Medians over 10 to 2900 Hz, two realisations only.\n\n| entry | noise over response (%) | total scatter over \
         response (%) | nonlinear share of the power at most (%) |\n|---|---|---|---|\n",
    );
    let mut worst: f64 = 0.0;
    for i in 1..=3 {
        for j in 1..=3 {
            let [re, im, noise, total] =
                ["re_um_per_V", "im_um_per_V", "noise_std", "total_std"].map(|n| format!("G{i}{j}_{n}"));
            let c = read_columns(&file, &["f_Hz", &re, &im, &noise, &total])?;
            let inside: Vec<usize> =
                (0..c.get("f_Hz").len()).filter(|&k| (10.0..2900.0).contains(&c.get("f_Hz")[k])).collect();
            let median = |of: &dyn Fn(usize) -> f64| {
                let mut all: Vec<f64> = inside.iter().map(|&k| of(k)).collect();
                all.sort_by(f64::total_cmp);
                all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
            };
            let size = |k: usize| c.get(&re)[k].hypot(c.get(&im)[k]);
            let share = |k: usize| (c.get(&total)[k].powi(2) - c.get(&noise)[k].powi(2)).max(0.0) / size(k).powi(2);
            worst = worst.max(100.0 * median(&share));
            let _ = writeln!(
                text,
                "| G{i}{j} | {:.2} | {:.2} | {:.3} |",
                100.0 * median(&|k| c.get(&noise)[k] / size(k)),
                100.0 * median(&|k| c.get(&total)[k] / size(k)),
                100.0 * median(&share),
            );
        }
    }
    let _ = writeln!(text, "\nAt the median line at most {worst:.3} % of the power is nonlinear; no effect is named.");
    Ok(text)
}

/// Makes the page from the folder of measured records.
pub fn recordings(data: &Path, say: &mut dyn FnMut(&str)) -> Result<Study, StudyError> {
    let angle = motor(data)?;
    let speed = motor_speed(&angle);
    let mut all = Vec::new();
    for r in [emps(), silverbox(), angle, speed] {
        all.push(r.real(data)?);
    }
    all.extend([pulley_drive(data)?, linear_guide(data)?]);
    let (mut study, mut rows, mut sections) = (Study::default(), String::new(), String::new());
    for r in &all {
        say(r.name);
        let made = diagnose(&r.case, &r.plant, None, &DiagnoseSettings::default(), |_| {})?;
        let page = format!("{}.html", r.name.to_lowercase().replace(", ", "_").replace(' ', "_"));
        rows.push_str(&table(r, &made));
        sections.push_str(&section(r, &made));
        let _ = writeln!(sections, "Report with pictures, written beside this page by the command: `{page}`.\n");
        let source = [("Records".to_owned(), r.file.to_owned()), ("Rows".to_owned(), r.split.clone())];
        study.page(&format!("mismatch/{page}"), diagnosis_page(&made, source.to_vec())?.html());
    }
    let head = "# Real recordings\n\nMade by `lab recordings --data DATA --out results`, DATA being the folder with `emps/`, `silverbox/`, `motor_bench/`, `ced_prbs/`, `linear_guide/` and `fsm_100mV/`. Each \
         diagnosis is given a linear model and nothing else. Errors are of the open-loop simulation driven by the recorded command; position, velocity and a constant \
         torque at the start of the held-out rows are fitted to them, which the published figures do not do. No noise level is given: it comes from laps of one drive where there are any, and \
         otherwise from what the best model leaves.\n\nSources: EMPS, A. Janot, M. Gautier, M. Brunot, 2019 Workshop on Nonlinear System Identification Benchmarks. Silverbox, T. Wigren, J. Schoukens, \
         ECC 2013. Motor bench, Hori-Fujimoto Lab (FdiTools), MIT. Pulley drive, T. Wigren, M. Schoukens, coupled electric drives, 2017. Linear guide, as its folder says. Mirror, M. Floren et al., ISMA-USD 2024, CC BY 4.0.\n\n";
    let columns = "| record | unit | given | linear refit | with findings | best published, or yardstick | verdict |\n|---|---|---:|---:|---:|---|---|\n";
    study.page("mismatch/recordings.md", format!("{head}{columns}{rows}\n{sections}{}", mirror(data)?));
    Ok(study)
}
