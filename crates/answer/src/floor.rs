//! The files of a run over the floor: tables, gains, pages; written from the store, the same whoever worked on the slots.

use super::{AnswerError, Say, fleet_page, fleet_slot};
use servotune::document::write_text;
use servotune_fleet::{Asked, Context, SlotRow, SlotSource, Stamp, Store, clear_pages, page_file, write_tables};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What is written.
#[derive(Clone, Copy, Debug)]
pub struct FloorFiles<'a> {
    /// Folder to write to.
    pub out: &'a Path,
    /// Slots with a full report, those whose limits are missed most.
    pub pages: usize,
}

/// Slots above which no folder of gains is written for each: the tables have them all.
const MOST_GAIN_FILES: usize = 20_000;

/// Writes all files of a run, says in the store that it is finished, and gives their names.
pub fn floor_files(
    store: &mut Store,
    run: &str,
    context: &Context,
    source: &dyn SlotSource,
    wanted: &FloorFiles<'_>,
    stamp: &Stamp,
    say: Say<'_>,
) -> Result<Vec<PathBuf>, AnswerError> {
    let all = store.runs()?;
    let own = all.iter().position(|r| r.run == run).unwrap_or(0);
    let before = all[..own].iter().filter(|r| r.finished.is_some()).map(|r| r.run.clone()).collect();
    let asked = Asked { gains: source.count() <= MOST_GAIN_FILES, before };
    let mut files = write_tables(store, run, context, wanted.out, &asked)?;
    let (slots, reports) = slot_pages(store, run, context, source, wanted, say)?;
    let page = wanted.out.join("fleet.html");
    write_text(&page, &fleet_page::html(store, run, context, &asked.before, &reports)?)?;
    files.push(page);
    files.extend(slots);
    store.finish(run, stamp)?;
    Ok(files)
}

/// Full reports of the slots whose limits are missed most, or nearest to it.
fn slot_pages(
    store: &Store,
    run: &str,
    context: &Context,
    source: &dyn SlotSource,
    wanted: &FloorFiles<'_>,
    say: Say<'_>,
) -> Result<(Vec<PathBuf>, BTreeSet<String>), AnswerError> {
    let mut worst: Vec<(f64, SlotRow)> = Vec::new();
    store.each_row(run, None, |row| {
        let best = row.table.as_ref().or(row.nearest.as_ref()).map(|t| &t.judged).or(row.current.as_ref());
        let Some(now) = best.map(|p| p.worst) else { return Ok(()) };
        // Rows come in order: of equals the earlier stays.
        if worst.len() < wanted.pages || worst.last().is_some_and(|w| now > w.0) {
            let at = worst.partition_point(|w| w.0 >= now);
            worst.insert(at, (now, row));
            worst.truncate(wanted.pages);
        }
        Ok(())
    })?;
    let (mut files, mut slots) = (Vec::new(), BTreeSet::new());
    for (_, row) in &worst {
        let file = page_file(wanted.out, row)?;
        match fleet_slot::html(context, source, row) {
            Ok(Some(page)) => {
                write_text(&file, &page)?;
                files.push(file);
                slots.insert(row.id());
            }
            Ok(None) => {}
            Err(e) => say(&format!("note: no page of {}: {e}", row.id())),
        }
    }
    clear_pages(wanted.out, &files)?;
    Ok((files, slots))
}
