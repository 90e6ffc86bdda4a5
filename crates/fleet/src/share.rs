//! Shared tables of a run: how many, which, who gets which, and how other ways would have done.
//!
//! In: the rows of a run and its library. Out: [`Shared`]: coverage over K with bounds, the choice, and the comparison with one table for all,
//! a table for each slot, and groups tuned together. A slot counts as served only by a table that is accepted in it.

use super::cover::{Choice, Collect};
use super::library::{Candidate, Library};
use super::look::{looks, nearest};
use super::row::{SlotRow, Verdict};
use super::store_run::Part;
use super::{Context, FleetError, Store};
use serde::{Deserialize, Serialize};
use servotune::lti::Plant;

/// Shared tables of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shared {
    /// Slots to be served: those that the gate sends neither to repair nor to a person, and that could be read.
    pub slots: usize,
    /// Of them, slots with a accepted table of their own or accepted gains.
    pub own: usize,
    /// Of them, slots that some candidate serves.
    pub coverable: usize,
    /// Slots served by today's gains as they stand in each slot.
    pub today: usize,
    /// Slots served by the fleet's one table in FLEET.toml.
    pub base: usize,
    /// Coverage over the number of tables.
    pub curve: Vec<Choice>,
    /// The number of tables chosen: the fewest that serve the share asked for, or the most allowed.
    pub chosen: usize,
    /// The candidates chosen, with their origin and how many slots get each.
    pub tables: Vec<SharedTable>,
    /// Groups tuned together, each slot with its group's table: number of groups, and slots served.
    pub groups: Vec<(usize, usize)>,
}

/// One shared table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedTable {
    /// Which candidate of the library.
    pub candidate: usize,
    /// Where it came from.
    pub origin: String,
    /// Slots that get it.
    pub slots: usize,
}

/// The table that a slot gets: of the chosen that are accepted in it, the one with the smallest DFT, then the first.
pub fn assigned(row: &SlotRow, chosen: &[usize]) -> Option<usize> {
    let served = chosen.iter().filter_map(|&c| row.served_by(c));
    served.min_by(|a, b| a.dft.total_cmp(&b.dft).then(a.candidate.cmp(&b.candidate))).map(|s| s.candidate)
}

/// Chooses the shared tables of a run from what is in the store.
pub fn share(context: &Context, store: &Store, run: &str, library: &Library) -> Result<Shared, FleetError> {
    let n = library.tables.len();
    let groups = library.groups();
    let mut collect = Collect::new(n);
    let mut s = Shared { groups: library.levels.iter().map(|l| (l.centres.len(), 0)).collect(), ..Shared::default() };
    store.each_row(run, None, |row| {
        if !row.verdict.served() {
            return Ok(());
        }
        s.slots += 1;
        s.own += usize::from(matches!(row.verdict, Verdict::Keeps | Verdict::Tuned));
        s.today += usize::from(row.current.as_ref().is_some_and(|p| p.passes));
        s.base += usize::from(row.served_by(0).is_some());
        // Tables of groups are known in their own slots only: they are for comparison.
        collect.add(|i| !groups.contains(&i) && row.served_by(i).is_some());
        let plant = row.model.as_ref().and_then(|m| Plant::try_from(m.plant.clone()).ok());
        let Some(look) = plant.as_ref().map(looks) else { return Ok(()) };
        for (level, (_, served)) in library.levels.iter().zip(&mut s.groups) {
            let group = nearest(&look, &level.centres).and_then(|g| level.candidates[g]);
            *served += usize::from(group.is_some_and(|c| row.served_by(c).is_some()));
        }
        Ok(())
    })?;
    let coverage = collect.end();
    let t = &context.file.tables;
    s.coverable = coverage.coverable();
    s.curve = coverage.choices(t.most.min(n));
    // What no table serves, no choice of tables can.
    let enough = |c: &Choice| c.served as f64 >= t.coverage * s.own.max(s.coverable) as f64;
    let at = s.curve.iter().position(enough).unwrap_or(s.curve.len().saturating_sub(1));
    if let Some(choice) = s.curve.get(at) {
        s.chosen = choice.tables.len();
        let origin = |candidate: usize| library.tables[candidate].origin.clone();
        s.tables = choice.tables.iter().map(|&c| SharedTable { candidate: c, origin: origin(c), slots: 0 }).collect();
        let chosen = choice.tables.clone();
        store.each_row(run, None, |row| {
            if row.verdict.served()
                && let Some(c) = assigned(&row, &chosen)
                && let Some(table) = s.tables.iter_mut().find(|t| t.candidate == c)
            {
                table.slots += 1;
            }
            Ok(())
        })?;
    }
    Ok(s)
}

impl Store {
    /// The shared tables of a run, once they are chosen.
    pub fn shared(&self, run: &str) -> Result<Option<Shared>, FleetError> {
        self.part(run, Part::Shared)
    }

    /// The library of a run, once it is made, with the tables of the rest where there are any.
    pub fn library(&self, run: &str) -> Result<Option<Library>, FleetError> {
        let mut library: Option<Library> = self.part(run, Part::Library)?;
        if let (Some(library), Some(rest)) = (&mut library, self.part::<Vec<Candidate>>(run, Part::Rest)?) {
            library.rest = library.tables.len();
            library.tables.extend(rest);
        }
        Ok(library)
    }
}
