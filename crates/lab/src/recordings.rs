//! Real recordings: EMPS, Silverbox, motor bench, mirror. Given only a linear model, what does a diagnosis say, and how well does the
//! corrected model simulate rows that it never used?
//!
//! Data: sources and licences are on the page. Published figures are quoted from the data's own descriptions.

use super::{Study, StudyError};
use servotune::diagnose::{DiagnoseSettings, Diagnosed, diagnose};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::numeric::statistics::rms_of;
use servotune::recording::{Case, ColumnNames, Record, RecordEntry, RecordSettings, Role, read_columns};
use servotune_report::diagnosis::diagnosis_page;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// One recording and how it is split.
pub(super) struct Recording {
    pub name: &'static str,
    file: &'static str,
    names: ColumnNames,
    sample_time_s: Option<f64>,
    fit: [usize; 2],
    holdout: [usize; 2],
    /// First samples of the hold-out rows that the benchmark does not count.
    pub skip: usize,
    /// Factor and unit of the benchmark's metric.
    pub metric: (f64, &'static str),
    pub plant: Plant,
    pub words: &'static str,
}

pub(super) fn rigid(position: &str, command: &str, body: Body) -> Plant {
    Plant {
        position_unit: position.into(),
        command_unit: command.into(),
        body,
        delay_s: 0.0,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    }
}

fn columns(time: &str, reference: &str, command: &str, position: &str) -> ColumnNames {
    ColumnNames {
        time: time.into(),
        reference: reference.into(),
        command: command.into(),
        position: position.into(),
        ..ColumnNames::default()
    }
}

/// Axis of a machine tool; the linear plant is a least-squares fit of mass, viscous friction and offset.
fn emps() -> Recording {
    let body = Body::FreeInertia { acceleration_gain: 0.369_632_28, viscous_rate_per_s: 4.312_032_18 };
    Recording {
        name: "EMPS",
        file: "emps/emps_train.csv.gz",
        names: columns("t_s", "qg_m", "vir_V", "qm_m"),
        sample_time_s: None,
        fit: [0, 12480],
        holdout: [12480, 24841],
        skip: 20,
        metric: (1e3, "mm"),
        plant: rigid("m", "V", body),
        words: "Laps 1 and 2 fitted, 3 and 4 held out. Published on the benchmark's own test record, which adds force pulses and is not part of this data: linear \
                state space 5.53 mm, ARX 12.6, polynomial NARX 5.17, best listed 2.64 mm (arXiv 2405.10779). On the training record: linear 6.57 mm, with symmetric \
                Coulomb friction 2.55 mm (description of the data). Published inverse-model values: Coulomb 20.39 N, that is 0.580 V at 35.15 N/V; mass 95.11 kg, that is an \
                acceleration gain of 0.3696.",
    }
}

/// The electronic Duffing oscillator; the plant is a rough linear guess, the refit does the rest.
pub(super) fn silverbox() -> Recording {
    let body = Body::SecondOrder { dc_gain: 0.25, natural_frequency_rad_s: 440.0, damping_ratio: 0.05 };
    Recording {
        name: "Silverbox",
        file: "silverbox/silverbox_snls80mV.csv.gz",
        names: columns("", "", "V1_V", "V2_V"),
        sample_time_s: Some(16384.0 / 1e7),
        fit: [40650, 105_712],
        holdout: [105_712, 127_400],
        skip: 50,
        metric: (1e3, "mV"),
        plant: rigid("V", "V", body),
        words: "The official split of the multisine part; the first 50 samples of the test are not counted. Published on the same rows: linear state space 6.96 mV, \
                polynomial NARX 0.640, Gaussian-process NARX 0.301, best listed 0.36 among earlier work (arXiv 2405.10779).",
    }
}

/// Two masses and a shaft, identified from the record's own first periods.
pub(super) fn motor(data: &Path) -> Result<Recording, StudyError> {
    let file = data.join("motor_bench/motor_bench_multisineA.csv.gz");
    let record = read_columns(&file, &["t_s", "iq_meas_A", "theta_motor_rad"])?;
    let sample_time_s = record.sample_time_s("t_s", &file)?;
    let how =
        PeriodicSettings { period: 2500, discard: 2, lines: Some((11..=250).collect()), ..PeriodicSettings::default() };
    let last = 35_000;
    let estimate =
        periodic(&record.get("iq_meas_A")[..last], &record.get("theta_motor_rad")[..last], sample_time_s, &how)?;
    let settings = IdentifySettings {
        position_unit: "rad".into(),
        command_unit: "A".into(),
        body: BodyChoice::FreeInertia,
        order: OrderChoice::Fixed(1),
        ..IdentifySettings::default()
    };
    let plant = identify(&estimate.frf, &settings)?.plant;
    Ok(Recording {
        name: "Motor bench",
        file: "motor_bench/motor_bench_multisineA.csv.gz",
        names: columns("t_s", "iq_ref_A", "iq_meas_A", "theta_motor_rad"),
        sample_time_s: None,
        fit: [2500, 35_000],
        holdout: [35_000, 50_000],
        skip: 0,
        metric: (1e3, "mrad"),
        plant,
        words: "Periods 2 to 14 fitted, 15 to 20 held out, as the description suggests; no published error was found. One amplitude of one excitation: an \
                amplitude-dependent effect cannot be told from a linear one here.",
    })
}

/// The case of a recording: rows to fit, rows held out.
pub(super) fn case(r: &Recording, data: &Path) -> Result<Case, StudyError> {
    let file = data.join(r.file);
    if !file.exists() {
        return Err(StudyError::Absent { file });
    }
    let read = |rows: [usize; 2]| {
        let settings = RecordSettings {
            names: r.names.clone(),
            sample_time_s: r.sample_time_s,
            rows: Some(rows),
            further: vec![],
        };
        Record::read(&file, &settings)
    };
    let entry = |name: &str, role| RecordEntry { file: PathBuf::from(name), role, repeat_group: None };
    Ok(Case {
        id: r.name.into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records: vec![(entry("fit", Role::Fit), read(r.fit)?), (entry("holdout", Role::Holdout), read(r.holdout)?)],
    })
}

fn made(r: &Recording, data: &Path) -> Result<Diagnosed, StudyError> {
    Ok(diagnose(&case(r, data)?, &r.plant, None, &DiagnoseSettings::default(), |_| {})?)
}

/// What a diagnosis of one recording says, as lines of the page.
fn section(r: &Recording, m: &Diagnosed) -> String {
    let d = &m.diagnosis;
    let held = m.data.runs.iter().position(|run| run.role == Role::Holdout).unwrap_or(0);
    let rmse = |errors: &[Vec<f64>]| r.metric.0 * rms_of(errors[held].iter().skip(r.skip).copied());
    let verdict = serde_json::to_string(&d.verdict).unwrap_or_default();
    let unit = r.metric.1;
    let mut text = format!(
        "## {}\n\nRows {} to {} fitted, {} to {} held out. {}\n\nVerdict: **{}**. Simulation of the held-out rows in open loop: {:.4} {unit} with the model as given, {:.4} \
         {unit} after a linear refit, **{:.4} {unit}** with the findings.\n\n",
        r.name,
        r.fit[0],
        r.fit[1],
        r.holdout[0],
        r.holdout[1],
        r.words,
        verdict.trim_matches('"'),
        rmse(&m.errors[0]),
        rmse(&m.errors[1]),
        rmse(&m.errors[2]),
    );
    // Writing to a String cannot fail.
    for f in &d.findings {
        let _ = writeln!(text, "- {}: {}", f.family.join(" or "), f.says);
        for (name, e) in &f.parameters {
            let _ = writeln!(text, "  - {name} = {:.6} ({:.6} to {:.6}) {}", e.value, e.low, e.high, e.unit);
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
pub fn recordings(data: &Path) -> Result<Study, StudyError> {
    let mut text = String::from(
        "# Real recordings\n\nMade by `lab recordings --data DATA --out results`, DATA being the folder with `emps/`, `silverbox/`, `motor_bench/` and `fsm_100mV/`. Each \
         diagnosis is given a linear model and nothing else. Errors are of the open-loop simulation driven by the recorded command; position, velocity and a constant \
         torque at the start of the held-out rows are fitted to them, which the published figures do not do. No noise level is given: it comes from laps of one drive where there are any, and \
         otherwise from what the best model leaves.\n\nSources: EMPS, A. Janot, M. Gautier, M. Brunot, 2019 Workshop on Nonlinear System Identification Benchmarks. Silverbox, T. Wigren, J. Schoukens, \
         ECC 2013. Motor bench, Hori-Fujimoto Lab (FdiTools), MIT. Mirror, M. Floren et al., ISMA-USD 2024, CC BY 4.0.\n\n",
    );
    let mut study = Study::default();
    for r in [emps(), silverbox(), motor(data)?] {
        let made = made(&r, data)?;
        let page = format!("{}.html", r.name.to_lowercase().replace(' ', "_"));
        text.push_str(&section(&r, &made));
        let _ = writeln!(text, "Report with pictures, written beside this page by the command: `{page}`.\n");
        let source = [
            ("Records".to_owned(), r.file.to_owned()),
            ("Rows fitted".to_owned(), format!("{} to {}", r.fit[0], r.fit[1])),
        ];
        study.page(&format!("mismatch/{page}"), diagnosis_page(&made, source.to_vec())?.html());
    }
    text.push_str(&mirror(data)?);
    study.page("mismatch/recordings.md", text);
    Ok(study)
}
