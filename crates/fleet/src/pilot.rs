//! The pilots: a few slots spread over the floor, identified and tuned in full. What they find is where all others start.
//!
//! In: a source and a [`Context`]. Out: the [`Library`]: tables and plants. Which slots are pilots follows
//! from their number alone, so the library is the same for any number of threads and after any interruption.

use super::Context;
use super::cluster::{LEVELS, group_table, groups, useful};
use super::grow::{Scout, grown};
use super::library::{Candidate, Library};
use super::look::{Level, looks};
use super::row::{ModelRow, OwnTable};
use super::slot::{Prepared, evidence, gate_action, search};
use super::source::SlotSource;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::gate::Action;
use servotune::lti::PlantFile;

/// What one pilot found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pilot {
    /// Its slot.
    pub id: String,
    /// Its plant, where one was identified.
    pub model: Option<ModelRow>,
    /// Its table, where one is accepted.
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
    let Ok((_, cases, model)) = evidence(context, &[], frf, index, temperature_c) else { return found };
    found.model = Some(model);
    if !matches!(action, Some(Action::None | Action::Tune)) {
        return found;
    }
    found.table = search(context, &cases).ok().filter(|t| t.judged.passes);
    found
}

/// The library: today's table, tables grown on scouts to be shared, the pilots' own as far as they add something, the tables of groups.
pub fn library(context: &Context, source: &dyn SlotSource, found: &[(usize, Pilot)]) -> Library {
    let plants: Vec<PlantFile> = found.iter().filter_map(|(_, p)| p.model.as_ref()).map(|m| m.plant.clone()).collect();
    let mut library = Library { plants, ..Library::default() };
    let neighbours = library.plants();
    // The cases are drawn again from the library's own plants, so that it does not matter whether the pilots were found by this process.
    let served: Vec<&(usize, Pilot)> = found.iter().filter(|(_, p)| p.table.is_some()).collect();
    let pilots: Vec<Prepared> =
        served.par_iter().filter_map(|(i, _)| Prepared::of(context, &neighbours, source, *i)).collect();
    let own: Vec<Candidate> = served
        .iter()
        .filter_map(|(_, p)| {
            Some(Candidate { gains: p.table.as_ref()?.gains.clone(), origin: format!("pilot {}", p.id) })
        })
        .collect();
    let looks: Vec<Vec<f64>> = pilots.iter().map(|p| looks(&p.plant)).collect();
    let from: Vec<Controller> = own.iter().map(|c| c.gains.clone()).collect();
    let mut grouped = Vec::new();
    for k in LEVELS.into_iter().filter(|k| *k <= pilots.len()) {
        let (centres, members) = groups(&looks, k);
        let made: Vec<Option<Controller>> =
            members.par_iter().map(|m| group_table(context, &pilots, &looks, m, &from)).collect();
        let mut level = Level { centres, candidates: Vec::new() };
        for (g, gains) in made.into_iter().enumerate() {
            level.candidates.push(gains.map(|gains| {
                grouped.push(Candidate { gains, origin: format!("group {} of {k}", g + 1) });
                grouped.len() - 1
            }));
        }
        library.levels.push(level);
    }
    let t = &context.file.tables;
    let slots: Vec<Prepared> = places(source.count(), t.scouts)
        .par_iter()
        .filter_map(|&i| Prepared::tunable(context, &neighbours, source, i))
        .collect();
    let mut scouts: Vec<Scout<'_>> = slots.iter().filter_map(|s| Scout::of(context, s)).collect();
    let starts: Vec<Controller> = grouped.iter().chain(&own).map(|c| c.gains.clone()).collect();
    let mut tables = vec![Candidate { gains: context.base.clone(), origin: "today".into() }];
    let named = |(i, gains)| Candidate { gains, origin: format!("grown {}", i + 1) };
    let shared = grown(context, &mut scouts, &starts, t.most.min(t.candidates.saturating_sub(1)));
    tables.extend(shared.into_iter().enumerate().map(named));
    let fixed = tables.len();
    library.grown = fixed - 1;
    tables.extend(own);
    let gains: Vec<Controller> = tables.iter().map(|c| c.gains.clone()).collect();
    let chosen = useful(context, &pilots, &gains, fixed, t.candidates);
    library.tables = chosen.into_iter().map(|i| tables[i].clone()).collect();
    library.grouped = library.tables.len();
    for candidate in library.levels.iter_mut().flat_map(|l| &mut l.candidates).flatten() {
        *candidate += library.grouped;
    }
    library.tables.extend(grouped);
    library
}
