//! The last part of `demo`: records of a machine whose bearing sticks, and what `diagnose` says of them.

use super::diagnose_arguments::DiagnoseArguments;
use super::{Failure, Screen, diagnose};
use servotune::controller::Controller;
use servotune::diagnose::Diagnosis;
use servotune::document::write_text;
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::physics::LawSetting;
use servotune::physics::pivot_friction::{Loading, PivotFriction};
use servotune::twin::recording::{TwinRow, multisine, record, scene, stroke};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Samples of a record.
const SAMPLES: usize = 3000;
/// Lines of a multisine.
const LINES: usize = 110;
/// White noise of the encoder, rms (track).
const NOISE: f64 = 3e-3;
/// The friction that the model does not know: level (V) and sliding length (track).
const LEVEL: f64 = 0.012;
const LENGTH: f64 = 2.5;
/// Records: name, rms of the excitation (V), length of the move (track), repeats, whether it is for judging only.
const RECORDS: [(&str, f64, f64, usize, bool); 6] = [
    ("multisine_small", 0.02, 0.0, 3, false),
    ("multisine_large", 0.08, 0.0, 3, false),
    ("move_short", 0.0, 3.0, 3, false),
    ("move_long", 0.0, 12.0, 3, false),
    ("held_multisine", 0.05, 0.0, 1, true),
    ("held_move", 0.0, 15.0, 1, true),
];

fn csv(rows: &[TwinRow], sample_time_s: f64) -> String {
    let mut text = "time_s,reference,excitation,command,position\n".to_owned();
    for (k, [r, d, u, y]) in rows.iter().enumerate() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{:.7},{r:.9},{d:.9},{u:.9},{y:.9}", k as f64 * sample_time_s);
    }
    text
}

/// Writes the case of a machine with `plant` and a sticking bearing, `plant` alone being the model of it.
fn write_case(folder: &Path, plant: &Plant, controller: &Controller) -> Result<(), Failure> {
    let toml = |source| Failure::Toml { source };
    write_text(&folder.join("plant.toml"), &toml::to_string(&PlantFile::from(plant)).map_err(toml)?)?;
    write_text(&folder.join("controller.toml"), &toml::to_string(controller).map_err(toml)?)?;
    let mut case = "id = \"demo\"\nplant = \"plant.toml\"\ncontroller = \"controller.toml\"\n".to_owned();
    let t = controller.sample_time_s;
    let scene = scene(plant, t, RECORDS[5].2, SAMPLES, NOISE);
    let bearing = PivotFriction::of(LENGTH, Loading::Dahl);
    let friction = LawSetting::new(bearing, vec![LEVEL]);
    let mut draw = 0;
    for (name, rms, distance, repeats, held) in RECORDS {
        let excitation = if rms > 0.0 { multisine(SAMPLES, LINES, rms) } else { vec![0.0; SAMPLES] };
        let reference = stroke(SAMPLES, SAMPLES / 10, SAMPLES / 3, distance);
        for i in 1..=repeats {
            let rows =
                record(&scene, &[&friction], controller, &reference, &excitation, &mut Random::stream(58, draw))?;
            draw += 1;
            let file = format!("records/{name}_{i}.csv");
            write_text(&folder.join(&file), &csv(&rows, t))?;
            let role = if held { "holdout" } else { "fit" };
            let _ = write!(case, "\n[[records]]\nfile = \"{file}\"\nrole = \"{role}\"\nrepeat_group = \"{name}\"\n");
        }
    }
    Ok(write_text(&folder.join("case.toml"), &case)?)
}

/// What the demo's last part made.
pub(super) struct Made {
    pub diagnosis: Diagnosis,
    pub text: String,
    pub report: PathBuf,
}

/// Makes the records of a machine with `plant` whose bearing sticks, and diagnoses them with `plant` as the model.
pub(super) fn run(out: &Path, plant: &Plant, controller: &Controller, screen: &mut Screen) -> Result<Made, Failure> {
    let folder = out.join("case");
    write_case(&folder, plant, controller)?;
    let to = out.join("diagnosis");
    let (diagnosis, text) = diagnose::make(&DiagnoseArguments::of_case(folder, to.clone()), screen)?;
    Ok(Made { diagnosis, text, report: to.join(diagnose::REPORT) })
}
