//! Margins of many loops from plant files, a line of JSON for each: `cargo run --release -p servotune --example margins_of_many -- CONTROLLER
//! PLANT...`; without a word, those of `specs/`.
//!
//! What other ways to the same figures are held against to the last bit: numbers are written so that reading them gives them back.

use servotune::document::read_toml;
use servotune::{Controller, DiscretePlant, ModelLoop, Plant, PlantFile, margins};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Prints a line for each plant.
pub fn main() -> Result<(), Box<dyn Error>> {
    let mut given =
        std::env::args_os().skip(1).map(PathBuf::from).filter(|p| p.extension().is_some_and(|e| e == "toml"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(|p| p.join("specs/machines").is_dir());
    let specs = root.ok_or("run it from a checkout")?.join("specs");
    let file = given.next().unwrap_or_else(|| specs.join("controllers/nominal.toml"));
    let controller: Controller = read_toml(&file)?;
    let sections = controller.sections()?;
    let mut plants: Vec<PathBuf> = given.collect();
    if plants.is_empty() {
        plants.push(specs.join("machines/healthy.toml"));
    }
    let mut out = std::io::stdout().lock();
    for file in plants {
        let plant: Plant = read_toml::<PlantFile>(&file)?.try_into()?;
        let sampled = DiscretePlant::of(&plant, controller.sample_time_s)?;
        let found = margins(&ModelLoop::new(&sampled, &sections)?);
        writeln!(out, "{}", serde_json::to_string(&found)?)?;
    }
    Ok(())
}
