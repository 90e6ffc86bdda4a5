//! Gains that meet limits, and their proof by other algorithms: `cargo run -p servotune --example tune_and_verify`.

use servotune::document::read_toml;
use servotune::verify::prove_loop;
use servotune::{Machine, Outcome, Plant, PlantFile, Spec, TuneSettings, Uncertainty, VerifySettings, tune};
use std::error::Error;
use std::path::Path;

/// Tunes the paper's machine to the shipped limits and proves stability and Ms over 1 % of gain.
pub fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(|p| p.join("specs/machines").is_dir());
    let specs = root.ok_or("run it from a checkout")?.join("specs");
    let file = specs.join("machines/healthy.toml");
    let plant = Plant::try_from(read_toml::<PlantFile>(&file)?)?;
    let spec = Spec::read(&specs.join("limits/paper.toml"))?;
    let settings = TuneSettings { sample_time_s: Some(39.6e-6), starts: 4, ..TuneSettings::default() };
    let outcome = tune(&Machine::Model(&plant), &spec, None, &settings)?;
    let Outcome::Tuned(tuned) = outcome else { return Err("the limits are not met".into()) };

    let sections = tuned.controller.sections()?;
    let bounds = prove_loop(
        &plant,
        &sections.chain,
        39.6e-6,
        &Uncertainty { gain: 0.01, ..Default::default() },
        &VerifySettings::default(),
    )?;
    let proved = bounds.max_sensitivity.high.ok_or("no bound of Ms")?;
    let found = tuned.after[0].margins.max_sensitivity;
    let text = format!(
        "kp {:.4} V/track, Ms {found:.3}, proved at most {proved:.3} over 1 % of gain, unstable poles {:?}\n",
        tuned.controller.pid.kp, bounds.unstable_poles
    );
    std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?;
    if bounds.unstable_poles == Some(0) && proved >= found { Ok(()) } else { Err("not proved".into()) }
}
