//! Real recordings of the page away from home, each with the linear model that a user would have.

use super::StudyError;
use super::recordings::{Recording, case, motor, rigid, silverbox};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::recording::{Case, Record, RecordEntry, Role, read_columns};
use std::path::{Path, PathBuf};

/// The two-mass bench, rows as on the page of recordings.
pub(super) fn motor_bench(data: &Path) -> Result<(Case, Plant), StudyError> {
    split(&motor(data)?, data)
}

/// The electronic Duffing oscillator likewise.
pub(super) fn oscillator(data: &Path) -> Result<(Case, Plant), StudyError> {
    split(&silverbox(), data)
}

fn split(r: &Recording, data: &Path) -> Result<(Case, Plant), StudyError> {
    Ok((case(r, data)?, r.plant.clone()))
}

fn record(name: &str, role: Role, sample_time_s: f64, command: Vec<f64>, position: Vec<f64>) -> (RecordEntry, Record) {
    let file = PathBuf::from(name);
    let record = Record {
        file: file.clone(),
        sample_time_s,
        gaps: vec![],
        reference: None,
        excitation: vec![0.0; command.len()],
        command,
        position,
        pes: None,
        spindle_rad: None,
        temperature_c: None,
        further: vec![],
    };
    (RecordEntry { file, role, repeat_group: None }, record)
}

fn of_records(id: &str, records: Vec<(RecordEntry, Record)>) -> Case {
    Case { id: id.into(), plant: PathBuf::new(), controller: None, spindle_hz: None, further_inputs: vec![], records }
}

/// The guide with two masses: first file fitted, second held out; the model from the response of the first file.
pub(super) fn guide(data: &Path) -> Result<(Case, Plant), StudyError> {
    let mut records = Vec::new();
    let mut plant = None;
    for (i, role) in [Role::Fit, Role::Holdout].into_iter().enumerate() {
        let file = data.join(format!("linear_guide/linear_guide_{}.csv.gz", i + 1));
        let c = read_columns(&file, &["t_s", "input_V", "enc1_mm"])?;
        // The recorded sign is negative.
        let position: Vec<f64> = c.get("enc1_mm").iter().map(|x| -x).collect();
        let t = c.sample_time_s("t_s", &file)?;
        if plant.is_none() {
            let how = PeriodicSettings { period: 4999, discard: 4, ..PeriodicSettings::default() };
            let settings = IdentifySettings {
                position_unit: "mm".into(),
                command_unit: "V".into(),
                body: BodyChoice::SecondOrder,
                order: OrderChoice::Fixed(1),
                ..IdentifySettings::default()
            };
            plant = Some(identify(&periodic(c.get("input_V"), &position, t, &how)?.frf, &settings)?.plant);
        }
        records.push(record(&format!("guide_{}.csv", i + 1), role, t, c.get("input_V").to_vec(), position));
    }
    let plant = plant.ok_or(StudyError::Absent { file: data.join("linear_guide") })?;
    Ok((of_records("linear_guide", records), plant))
}

/// The pulley drive: 300 samples of each record fitted, 200 held out; a second-order model as the stated frequency and gain of the drive
/// have it.
pub(super) fn pulley(data: &Path) -> Result<(Case, Plant), StudyError> {
    let file = data.join("ced_prbs/ced_prbs.csv");
    let names = ["u_1V", "z_1V", "u_1p5V", "z_1p5V", "u_0p5V", "z_0p5V"];
    let c = read_columns(&file, &names)?;
    let mut records = Vec::new();
    for pair in names.chunks_exact(2) {
        let [u, z] = [c.get(pair[0]), c.get(pair[1])];
        for (role, rows, part) in [(Role::Fit, 0..300, "fit"), (Role::Holdout, 300..500, "held")] {
            let name = format!("{}_{part}.csv", pair[1]);
            records.push(record(&name, role, 0.02, u[rows.clone()].to_vec(), z[rows].to_vec()));
        }
    }
    let body = Body::SecondOrder { dc_gain: 1.0, natural_frequency_rad_s: 8.0, damping_ratio: 0.2 };
    Ok((of_records("pulley", records), rigid("tick/s", "V", body)))
}
