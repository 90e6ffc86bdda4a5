//! The fleet in `demo`: one tester of sixteen made-up slots from their folders to tables and page.
//!
//! In: the demo's folder. Out: `floor/` (slot folders, spec, gains, gate, FLEET.toml) and `floor_results/` (store, tables, `fleet.html`, reports of three slots).

use super::arguments::TwinFleetArguments;
use super::fleet::{self, Document};
use super::fleet_arguments::FleetRunArguments;
use super::{Failure, Screen, fleet_twin};
use servotune::document::{read_text, write_text};
use std::path::{Path, PathBuf};

/// Fixes the floor.
const SEED: u64 = 3;
/// What a floor of sixteen slots needs less of than one of thousands.
const SMALLER: [(&str, &str); 3] =
    [("pilots = 32", "pilots = 4"), ("scouts = 192", "scouts = 16"), ("explained = 40", "explained = 1")];

/// What the fleet's part of the demo gave.
pub(super) struct Made {
    pub document: Document,
    pub text: String,
    pub page: PathBuf,
}

/// Makes a tester and works on its slots.
pub(super) fn run(out: &Path, screen: &mut Screen) -> Result<Made, Failure> {
    let floor = out.join("floor");
    fleet_twin::make(&TwinFleetArguments { out: floor.clone(), testers: 1, slots: None, seed: SEED, run: 0 }, screen)?;
    let file = floor.join("FLEET.toml");
    let words = SMALLER.iter().fold(read_text(&file)?, |text, (from, to)| text.replace(from, to));
    write_text(&file, &words)?;
    let results = out.join("floor_results");
    let asked = FleetRunArguments {
        fleet: file,
        out: results.clone(),
        // The same program goes on with its own demo; another version begins one of its own.
        run: Some(format!("demo {}", env!("CARGO_PKG_VERSION"))),
        threads: 0,
        pages: 3,
        chunk: 16,
        who: Some("demo".into()),
    };
    let (document, text) = fleet::make(&asked, screen)?;
    Ok(Made { document, text, page: results.join("fleet.html") })
}
