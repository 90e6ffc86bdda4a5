//! Why simulation and records differ: `cargo run --release -p servotune --example diagnose_records`.
//!
//! The machine is the paper's with a bearing that sticks; the model does not know of it. Records of your own come from a folder with
//! `Case::read`.

use servotune::diagnose::Verdict;
use servotune::document::read_toml;
use servotune::numeric::random::Random;
use servotune::physics::LawSetting;
use servotune::physics::pivot_friction::{Loading, PivotFriction};
use servotune::recording::{RecordColumns, RecordEntry, Role};
use servotune::twin::recording::{multisine, record, scene, stroke};
use servotune::{Case, Controller, DiagnoseSettings, Plant, PlantFile, Record, diagnose};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Samples of a record.
const SAMPLES: usize = 2000;

/// Makes records of the machine, diagnoses them with the plant alone as the model, and prints what is missing.
pub fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(|p| p.join("specs/machines").is_dir());
    let specs = root.ok_or("run it from a checkout")?.join("specs");
    let [machine, gains] = ["machines/healthy.toml", "controllers/nominal.toml"].map(|f| specs.join(f));
    let plant = Plant::try_from(read_toml::<PlantFile>(&machine)?)?;
    let controller: Controller = read_toml(&gains)?;

    let scene = scene(&plant, controller.sample_time_s, 15.0, SAMPLES, 3e-3);
    let bearing = PivotFriction::of(0.5, Loading::Dahl);
    let friction = LawSetting::new(bearing, vec![0.02]);
    let mut records = Vec::new();
    // Excitation (V rms), length of the move (track), role.
    let moves = [(0.02, 0.0, Role::Fit), (0.08, 0.0, Role::Fit), (0.0, 12.0, Role::Fit), (0.04, 6.0, Role::Holdout)];
    for (draw, (rms, distance, role)) in (0u64..).zip(moves) {
        let excitation = if rms > 0.0 { multisine(SAMPLES, 110, rms) } else { vec![0.0; SAMPLES] };
        let reference = stroke(SAMPLES, SAMPLES / 10, SAMPLES / 3, distance);
        let rows = record(&scene, &[&friction], &controller, &reference, &excitation, &mut Random::stream(1, draw))?;
        let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
        let columns = RecordColumns {
            time: (0..SAMPLES).map(|k| k as f64 * controller.sample_time_s).collect(),
            reference: column(0),
            excitation: column(1),
            command: column(2),
            position: column(3),
            ..RecordColumns::default()
        };
        let file = PathBuf::from(format!("record_{draw}.csv"));
        let read = Record::of(&file, columns, None, 1)?;
        records.push((RecordEntry { file, role, repeat_group: None }, read));
    }
    let case = Case {
        id: "example".into(),
        plant: machine,
        controller: Some(gains),
        spindle_hz: None,
        further_inputs: vec![],
        records,
    };

    let found = diagnose(&case, &plant, Some(&controller), &DiagnoseSettings::default(), |_| ())?.diagnosis;
    let held_out = found.fit.holdout.ok_or("no record to judge by")?;
    let mut text = format!(
        "held-out error: {:.4} track given, {:.4} corrected, noise {:.4}\n",
        held_out.rms_before, held_out.rms_after, held_out.noise_floor
    );
    for finding in &found.findings {
        text += &format!("{}: {}\n", finding.effect, finding.says);
    }
    std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?;
    let right = found.verdict == Verdict::Named && found.findings.iter().any(|f| f.effect == friction.facts().name);
    if right && held_out.rms_after < 1.5 * held_out.noise_floor {
        Ok(())
    } else {
        Err("the bearing is not named".into())
    }
}
