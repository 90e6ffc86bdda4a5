//! A sweep file to a model, and the margins of a loop on both: `cargo run -p servotune --example sweep_to_margins`.
//!
//! The sweep is that of a linear stage (`examples/stage`), position in um, command in A, taken at 10 kHz.

use servotune::document::read_toml;
use servotune::frf::{ReadSettings, read_file};
use servotune::{
    Controller, DiscretePlant, IdentifySettings, MeasuredLoop, ModelLoop, identify, margins, measured_margins,
};
use std::error::Error;
use std::path::Path;

/// Prints what both ways say.
pub fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(|p| p.join("specs/machines").is_dir());
    let folder = root.ok_or("run it from a checkout")?.join("examples/stage");
    let sweep = read_file(&folder.join("sweep.csv"), &ReadSettings::default())?;
    let file = folder.join("controller.toml");
    let controller: Controller = read_toml(&file)?;
    let sections = controller.sections()?;

    let model = identify(&sweep.frf, &IdentifySettings::default())?.plant;
    let sampled = DiscretePlant::of(&model, controller.sample_time_s)?;
    let of_model = margins(&ModelLoop::new(&sampled, &sections)?);
    let of_sweep = measured_margins(&MeasuredLoop::new(&sweep.frf, &sections)?)?;

    let line = |what: &str, pm: Option<f64>, ms: f64| {
        let pm = pm.map_or("none".to_owned(), |deg| format!("{deg:.2} deg"));
        format!("{what}: phase margin {pm}, Ms {ms:.3}\n")
    };
    let text = line("model", of_model.phase_margin_deg, of_model.max_sensitivity)
        + &line("sweep", of_sweep.margins.phase_margin_deg, of_sweep.margins.max_sensitivity);
    std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?;
    // Two ways to the same loop: they agree within what the sweep's noise leaves open.
    let apart = (of_model.max_sensitivity / of_sweep.margins.max_sensitivity - 1.0).abs();
    if apart < 0.1 { Ok(()) } else { Err(format!("Ms of model and sweep differ by {:.0} %", 100.0 * apart).into()) }
}
