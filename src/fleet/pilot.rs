//! The pilots: a few slots spread over the floor, identified and tuned in full. What they find is where all others start.
//!
//! In: a source and a [`Context`]. Out: the [`Library`]: today's table, each pilot's table, each pilot's plant. Which slots are pilots follows
//! from their number alone, so the library is the same for any number of threads and after any interruption.

use super::library::{Candidate, Library};
use super::row::{ModelRow, OwnTable};
use super::slot::{evidence, gate_action, search};
use super::source::SlotSource;
use super::Context;
use crate::gate::Action;
use crate::lti::PlantFile;
use serde::{Deserialize, Serialize};

/// What one pilot found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pilot {
    /// Its slot.
    pub id: String,
    /// Its plant, where one was identified.
    pub model: Option<ModelRow>,
    /// Its table, where one is proven.
    pub table: Option<OwnTable>,
}

/// Places of the pilots: evenly spread.
pub fn places(slots: usize, pilots: usize) -> Vec<usize> {
    let n = pilots.min(slots);
    // The middle of each n-th part.
    (0..n).map(|k| (2 * k + 1) * slots / (2 * n)).collect()
}

/// Works on one pilot. What is wrong with it will stand in its row; here it just gives nothing.
pub fn pilot(context: &Context, source: &dyn SlotSource, index: usize) -> Pilot {
    let name = source.name(index);
    let mut found = Pilot { id: name.id(), model: None, table: None };
    let loaded = source.load(index);
    let action = gate_action(context, &loaded.machine);
    let (Some(frf), true) = (&loaded.machine.response, loaded.problems.is_empty()) else { return found };
    let temperature_c = loaded.temperature_c.unwrap_or(context.file.temperature.measured_c);
    let Ok((cases, model)) = evidence(context, &[], frf, index, temperature_c) else { return found };
    found.model = Some(model);
    if !matches!(action, Some(Action::None | Action::Tune)) {
        return found;
    }
    found.table = search(context, &cases).ok().filter(|t| t.proved.passes);
    found
}

/// The library of all pilots, in their order.
pub fn library(context: &Context, pilots: &[Pilot]) -> Library {
    let today = Candidate { gains: context.base.clone(), origin: "today".into() };
    let of = |p: &Pilot| p.table.as_ref().map(|t| Candidate { gains: t.gains.clone(), origin: format!("pilot {}", p.id) });
    let most = context.file.tables.candidates;
    let tables = std::iter::once(today).chain(pilots.iter().filter_map(of)).take(most).collect();
    let plants: Vec<PlantFile> = pilots.iter().filter_map(|p| p.model.as_ref()).map(|m| m.plant.clone()).collect();
    Library { tables, plants }
}

