//! Single recordings of real machines, each with the linear model that a user would have and the rows that it is split into.

use super::StudyError;
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::recording::{Case, ColumnNames, Record, RecordEntry, RecordSettings, Role, read_columns};
use std::path::{Path, PathBuf};

/// One recording and how it is split.
pub(super) struct Recording {
    pub name: &'static str,
    pub file: &'static str,
    names: ColumnNames,
    sample_time_s: Option<f64>,
    pub fit: [usize; 2],
    pub holdout: [usize; 2],
    /// First samples of the hold-out rows that the benchmark does not count.
    pub skip: usize,
    /// Factor and unit of the benchmark's metric.
    pub metric: (f64, &'static str),
    pub plant: Plant,
    pub words: &'static str,
    /// The best published error of held-out rows, in the metric's unit.
    pub published: &'static str,
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
pub(super) fn emps() -> Recording {
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
        published: "2.55 (linear 6.57)",
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
        published: "0.301 (linear 6.96)",
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
        published: "none",
    })
}

/// Pole (Hz) that makes a body of second order of a mass and its drag, far above the band: what is logged is a speed.
const FAR_ABOVE_HZ: f64 = 2e4;

/// The same bench by its drive's speed channel, which the data's description says to be filtered; the model is that of the angle, differentiated.
pub(super) fn motor_speed(angle: &Recording) -> Recording {
    let far = std::f64::consts::TAU * FAR_ABOVE_HZ;
    let body = match angle.plant.body {
        Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
            let natural_frequency_rad_s = (viscous_rate_per_s * far).sqrt();
            let damping_ratio = 0.5 * (viscous_rate_per_s + far) / natural_frequency_rad_s;
            Body::SecondOrder {
                dc_gain: acceleration_gain / viscous_rate_per_s,
                natural_frequency_rad_s,
                damping_ratio,
            }
        }
        // The bench turns freely; a sprung one has no such form.
        ref other => other.clone(),
    };
    let delay_s = angle.plant.delay_s - 1.0 / far;
    Recording {
        name: "Motor bench, speed channel",
        names: columns("t_s", "iq_ref_A", "iq_meas_A", "omega_motor_rad_s"),
        metric: (1.0, "rad/s"),
        plant: Plant { position_unit: "rad/s".into(), body, delay_s, ..angle.plant.clone() },
        words: "The speed that the drive reports, with the model of the angle, differentiated. The data's description gives it as the angle's derivative behind a first-order low-pass of \
                about 20 Hz. A linear refit can take that up in its stiffness and drag; what it is stands in the remarks.",
        ..*angle
    }
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
