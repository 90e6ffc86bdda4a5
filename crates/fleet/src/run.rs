//! A run over the whole floor, resumable at any instant and safe beside another one on the same store.
//!
//! In: a source, a [`Context`], a store. Out: every row in the store. Slots are worked on in chunks: read, worked out by all threads, handed
//! to the one writer, committed in one transaction each; while one chunk is written the next is worked on. Nothing is kept in memory but
//! the chunks on their way.

use super::claims::Worker;
use super::explain::{Explained, explain};
use super::library::Library;
use super::pilot::{self, Pilot};
use super::rest::rest;
use super::row::{SlotRow, Verdict};
use super::share::share;
use super::slot::{Prepared, work};
use super::source::SlotSource;
use super::store_run::{Inputs, Part, Places, Stamp};
use super::{Context, FleetError, Store};
use rayon::prelude::*;
use servotune::document::sha256_hex;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

/// A stage of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A few slots in full.
    Pilots,
    /// Every slot.
    Slots,
    /// Slots that no table serves.
    Explain,
    /// Shared tables.
    Share,
}

/// Who is told how far a run is.
pub trait Watch: Sync {
    /// `done` of `of` in a stage.
    fn step(&self, stage: Stage, done: usize, of: usize);
}

/// How a run is worked on; none of it changes any result.
#[derive(Clone, Debug)]
pub struct Effort {
    /// Threads; 0 for as many as the machine has.
    pub threads: usize,
    /// Slots in one transaction.
    pub chunk: usize,
    /// Limits the store's file to this many pages, as a full disk would; for tests.
    pub limit_pages: Option<u32>,
}

impl Default for Effort {
    fn default() -> Self {
        Effort { threads: 0, chunk: 64, limit_pages: None }
    }
}

/// What a run works with.
pub struct Job<'a> {
    /// The slots.
    pub source: &'a dyn SlotSource,
    /// Settings, spec, gains, gate.
    pub context: &'a Context,
    /// The store's file.
    pub store: &'a Path,
    /// Name of the run; see [`Store::begin`].
    pub run: Option<&'a str>,
    /// Who runs it, and when it began.
    pub stamp: Stamp,
    /// This process at the store.
    pub worker: &'a Worker,
    /// Threads and chunks.
    pub effort: Effort,
}

/// Pause while another process works on the same run.
const PAUSE: Duration = Duration::from_millis(50);
/// Chunks on their way to the writer.
const UNDERWAY: usize = 2;

/// Works on a run until every slot is done; gives the run's name. Whoever has written its files says so with [`Store::finish`].
pub fn run(job: &Job<'_>, watch: &dyn Watch) -> Result<String, FleetError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(job.effort.threads).build();
    let pool = pool.map_err(|source| FleetError::Threads { source })?;
    let mut store = open(job)?;
    let inputs = inputs(job);
    let run = store.begin(job.run, &inputs, &job.stamp)?.run;
    let library = library(job, &mut store, &run, &pool, watch)?;
    slots(job, &mut store, &run, &library, &pool, watch)?;
    // One process concludes, the others wait for it.
    while store.shared(&run)?.is_none() {
        if store.claim(&run, "conclude", job.worker)? {
            conclude(job, &mut store, &run, &library, &pool, watch)?;
        } else {
            std::thread::sleep(PAUSE);
        }
    }
    Ok(run)
}

/// What the run works on: the names of all slots, in order, are part of it.
fn inputs(job: &Job<'_>) -> Inputs {
    let slots = job.source.count();
    let names: String = (0..slots).map(|i| job.source.name(i).id() + "\n").collect();
    Inputs { config: job.context.digest.clone(), slots, list: sha256_hex(names.as_bytes()) }
}

/// What comes after the last slot: explanations, shared tables, proposals.
fn conclude(
    job: &Job<'_>,
    store: &mut Store,
    run: &str,
    library: &Library,
    pool: &rayon::ThreadPool,
    watch: &dyn Watch,
) -> Result<(), FleetError> {
    explanations(job, store, run, library, pool, watch)?;
    watch.step(Stage::Share, 0, 1);
    pool.install(|| rest(job.context, job.source, store, run, library))?;
    let Some(library) = store.library(run)? else { return Ok(()) };
    let shared = share(job.context, store, run, &library)?;
    let begun = store.run(run)?;
    store.propose(job.context, &begun)?;
    // Last: that they are there says that all is done.
    store.keep_part(run, Part::Shared, &shared)?;
    watch.step(Stage::Share, 1, 1);
    Ok(())
}

/// Explains slots that no table serves: the first ones, as many as the settings allow.
fn explanations(
    job: &Job<'_>,
    store: &mut Store,
    run: &str,
    library: &Library,
    pool: &rayon::ThreadPool,
    watch: &dyn Watch,
) -> Result<(), FleetError> {
    let most = job.context.file.untunable.explained;
    let there: BTreeSet<usize> = store.places_done(run, Places::Explained)?;
    let mut left: Vec<SlotRow> = Vec::new();
    let mut count = there.len();
    store.each_row(run, Some(Verdict::Untunable), |row| {
        if count < most && !there.contains(&row.index) {
            left.push(row);
            count += 1;
        }
        Ok(())
    })?;
    let plants = library.plants();
    let one = |row: &SlotRow| {
        let slot = Prepared::of(job.context, &plants, job.source, row.index)?;
        Some((row.index, explain(job.context, &slot, row)))
    };
    let mut done = there.len();
    for group in left.chunks(4 * pool.current_num_threads().max(1)) {
        watch.step(Stage::Explain, done, count);
        let found: Vec<(usize, Explained)> = pool.install(|| group.par_iter().filter_map(one).collect());
        // A slot that the full search has served after all is tuned, in the same transaction.
        let served: Vec<SlotRow> = group
            .iter()
            .filter_map(|row| {
                let found = &found.iter().find(|(i, _)| *i == row.index)?.1;
                let (table, certified) = (Some(found.table.clone()?), found.certified.clone());
                Some(SlotRow { verdict: Verdict::Tuned, table, certified, nearest: None, ..row.clone() })
            })
            .collect();
        store.add_explained(run, &found, &served)?;
        done += group.len();
    }
    watch.step(Stage::Explain, done, count);
    Ok(())
}

fn open(job: &Job<'_>) -> Result<Store, FleetError> {
    let store = Store::open(job.store)?;
    if let Some(pages) = job.effort.limit_pages {
        store.limit_pages(pages)?;
    }
    Ok(store)
}

/// The library: read, or made by this process, or awaited from another one.
fn library(
    job: &Job<'_>,
    store: &mut Store,
    run: &str,
    pool: &rayon::ThreadPool,
    watch: &dyn Watch,
) -> Result<Library, FleetError> {
    loop {
        if let Some(library) = store.part(run, Part::Library)? {
            return Ok(library);
        }
        if !store.claim(run, "pilots", job.worker)? {
            std::thread::sleep(PAUSE);
            continue;
        }
        let places = pilot::places(job.source.count(), job.context.file.tables.pilots);
        let mut found: Vec<(usize, Pilot)> = store.places(run, Places::Pilots)?;
        watch.step(Stage::Pilots, found.len(), places.len());
        let missing: Vec<usize> = places.iter().copied().filter(|p| found.iter().all(|(q, _)| p != q)).collect();
        for group in missing.chunks(pool.current_num_threads().max(1)) {
            let one = |&p: &usize| (p, pilot::pilot(job.context, job.source, p));
            let more: Vec<(usize, Pilot)> = pool.install(|| group.par_iter().map(one).collect());
            store.add_places(run, Places::Pilots, &more)?;
            found.extend(more);
            watch.step(Stage::Pilots, found.len(), places.len());
        }
        found.sort_by_key(|(p, _)| *p);
        let library = pool.install(|| pilot::library(job.context, job.source, &found));
        store.keep_part(run, Part::Library, &library)?;
    }
}

/// Every slot that is not done yet and that no living process has claimed; then those that one had claimed and left.
fn slots(
    job: &Job<'_>,
    store: &mut Store,
    run: &str,
    library: &Library,
    pool: &rayon::ThreadPool,
    watch: &dyn Watch,
) -> Result<(), FleetError> {
    let count = job.source.count();
    let plants = library.plants();
    let one = |i: usize| work(job.context, library, &plants, i, job.source.name(i), job.source.load(i));
    let chunk = job.effort.chunk.max(1);
    let mut writer_store = store.again()?;
    if let Some(pages) = job.effort.limit_pages {
        writer_store.limit_pages(pages)?;
    }
    std::thread::scope(|scope| {
        let (send, receive) = sync_channel::<Vec<SlotRow>>(UNDERWAY);
        let writer = scope.spawn(move || write(&mut writer_store, run, &receive));
        let mut all = || -> Result<(), FleetError> {
            let mut done = store.count_done(run)?;
            watch.step(Stage::Slots, done, count);
            let mut left: Vec<usize> = (0..count.div_ceil(chunk)).collect();
            while !left.is_empty() {
                let mut others = Vec::new();
                for &k in &left {
                    let (from, to) = (k * chunk, ((k + 1) * chunk).min(count));
                    let there = store.done(run, from, to)?;
                    if there.len() == to - from {
                        continue;
                    }
                    if !store.claim(run, &format!("slots {from}-{to}"), job.worker)? {
                        others.push(k);
                        continue;
                    }
                    let missing: Vec<usize> = (from..to).filter(|i| !there.contains(i)).collect();
                    let rows: Vec<SlotRow> = pool.install(|| missing.par_iter().map(|&i| one(i)).collect());
                    done += rows.len();
                    // The writer has stopped on an error, which it reports itself.
                    if send.send(rows).is_err() {
                        return Ok(());
                    }
                    watch.step(Stage::Slots, done.min(count), count);
                }
                if !others.is_empty() {
                    std::thread::sleep(PAUSE);
                    done = store.count_done(run)?;
                    watch.step(Stage::Slots, done, count);
                }
                left = others;
            }
            Ok(())
        };
        let worked = all();
        drop(send);
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        written.and(worked)
    })
}

fn write(store: &mut Store, run: &str, receive: &Receiver<Vec<SlotRow>>) -> Result<(), FleetError> {
    receive.iter().try_for_each(|rows| store.add_rows(run, &rows))
}
