//! The position error of one spiral write: `cargo run -p servotune --example simulate_write`.

use servotune::document::read_toml;
use servotune::pes::figures;
use servotune::{Controller, Plant, PlantFile, Profile, simulate};
use std::error::Error;
use std::path::Path;

/// Simulates the paper's machine with the nominal gains and prints the figures of the write.
pub fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(|p| p.join("specs/machines").is_dir());
    let specs = root.ok_or("run it from a checkout")?.join("specs");
    let [machine, gains, write] =
        ["machines/healthy.toml", "controllers/nominal.toml", "profiles/spiral.toml"].map(|f| specs.join(f));
    let plant = Plant::try_from(read_toml::<PlantFile>(&machine)?)?;
    let controller: Controller = read_toml(&gains)?;
    let profile: Profile = read_toml(&write)?;

    let run = simulate(&plant, &controller, &profile)?;
    let found = figures(&run.pes, &profile);
    let text = format!("PES: std {:.4} track, range {:.4} track over the window\n", found.pes_std, found.pes_range);
    std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?;
    // A write that follows its reference stays within a track.
    if found.pes_std > 0.0 && found.pes_range < 1.0 { Ok(()) } else { Err("the write does not follow".into()) }
}
