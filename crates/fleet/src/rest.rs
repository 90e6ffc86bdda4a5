//! The few slots that no shared table serves though they have a table of their own: more tables are grown on them, and looked at in them.
//!
//! In: a run whose slots are all done, and its library. Out: more candidates, kept with the run, and the rows of those slots with what serves them.
//! The pilots' sample cannot have seen what is rare; the rest itself can. The new tables are looked at in the rest only: where a slot is served
//! already, they are not needed. So coverage counts none too many, and what no choice serves more than is said of what was looked at.

use super::grow::{Scout, grown};
use super::library::{Candidate, Library};
use super::row::{Serves, SlotRow, Verdict};
use super::slot::Prepared;
use super::source::SlotSource;
use super::store_run::Part;
use super::worst_case::worst_case;
use super::{Context, FleetError, Ready, Store};
use rayon::prelude::*;
use servotune::controller::Controller;

/// Slots that tables are grown on at most.
const MOST: usize = 256;
/// Slots in one transaction.
const CHUNK: usize = 64;

/// Whether a slot can be served, and no table that may be shared serves it.
fn left(library: &Library, row: &SlotRow) -> bool {
    matches!(row.verdict, Verdict::Keeps | Verdict::Tuned) && !row.serves.iter().any(|s| s.candidate < library.grouped)
}

/// Grows the tables of the rest and marks the slots that they serve; begun again after an interruption it ends at the same.
pub(super) fn rest(
    context: &Context,
    source: &dyn SlotSource,
    store: &mut Store,
    run: &str,
    library: &Library,
) -> Result<(), FleetError> {
    let mut places: Vec<usize> = Vec::new();
    let mut from: Vec<Controller> = Vec::new();
    store.each_row(run, None, |row| {
        if left(library, &row) {
            if places.len() < MOST {
                let own = row.table.map(|t| t.gains).or(row.own_gains);
                from.push(own.unwrap_or_else(|| context.base.clone()));
            }
            places.push(row.index);
        }
        Ok(())
    })?;
    let plants = library.plants();
    let tables: Vec<Candidate> = match store.part(run, Part::Rest)? {
        Some(tables) => tables,
        None => {
            let slots: Vec<Prepared> =
                places[..from.len()].par_iter().filter_map(|&i| Prepared::of(context, &plants, source, i)).collect();
            let mut scouts: Vec<Scout<'_>> = slots.iter().filter_map(|s| Scout::of(context, s)).collect();
            let made = grown(context, &mut scouts, &from, context.file.tables.most);
            let named = |(i, gains)| Candidate { gains, origin: format!("grown on the rest {}", i + 1) };
            let made: Vec<Candidate> = made.into_iter().enumerate().map(named).collect();
            store.keep_part(run, Part::Rest, &made)?;
            made
        }
    };
    if tables.is_empty() {
        return Ok(());
    }
    let first = library.tables.len();
    for chunk in places.chunks(CHUNK) {
        let one = |&i: &usize| -> Option<(usize, Vec<Serves>)> {
            let slot = Prepared::of(context, &plants, source, i)?;
            let mut ready = Ready::of(&slot.evidence, &context.spec, &context.guarded, &context.base).ok()?;
            let mut serves = Vec::new();
            for (candidate, t) in (first..).zip(&tables) {
                // Few slots: every table is judged exactly.
                if let Some(p) = worst_case(&mut ready, &t.gains).ok().filter(|p| p.passes) {
                    let dft = p.figures.dft();
                    serves.push(Serves { candidate, room: -p.worst, dft });
                }
            }
            Some((i, serves))
        };
        let found: Vec<(usize, Vec<Serves>)> = chunk.par_iter().filter_map(one).collect();
        let mut rows = Vec::with_capacity(found.len());
        for (i, serves) in found {
            let Some(mut row) = store.row(run, &source.name(i).id())? else { continue };
            row.serves.retain(|s| s.candidate < first);
            row.serves.extend(serves);
            rows.push(row);
        }
        store.add_explained(run, &[], &rows)?;
    }
    Ok(())
}
