//! A run whose pilots and slots are worked on elsewhere: by processes of an engine that share nothing with the store.
//!
//! In: a [`Job`]; pilots and rows in any order, some of them twice. Out: what is left to be done, and a store in which [`super::run`] finds all of it there and
//! concludes. What a worker needs is a [`Hand`]: the settings, the slots and the library. Pilots and rows travel as JSON, as they lie in the store.

use super::library::Library;
use super::pilot::{self, Pilot};
use super::row::SlotRow;
use super::run::{Job, inputs};
use super::slot::work;
use super::source::SlotSource;
use super::store_run::{Part, Places, json, of_json};
use super::{Context, FleetError, Store};
use servotune::lti::Plant;
use std::collections::BTreeSet;

/// The store's side of such a run.
pub struct Spread {
    store: Store,
    run: String,
    slots: usize,
    pilots: Vec<usize>,
}

impl Spread {
    /// Begins the run of a job, or goes on with it.
    pub fn begin(job: &Job<'_>) -> Result<Spread, FleetError> {
        let mut store = Store::open(job.store)?;
        store.heal()?;
        let run = store.begin(job.run, &inputs(job), &job.stamp)?.run;
        let slots = job.source.count();
        let pilots = pilot::places(slots, job.context.file.tables.pilots);
        Ok(Spread { store, run, slots, pilots })
    }

    /// Name of the run.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// Places whose pilots are not there yet; none once there is a library.
    pub fn pilots_left(&self) -> Result<Vec<usize>, FleetError> {
        if self.library()?.is_some() {
            return Ok(Vec::new());
        }
        let there = self.store.places_done(&self.run, Places::Pilots)?;
        Ok(self.pilots.iter().copied().filter(|p| !there.contains(p)).collect())
    }

    /// Adds pilots as a [`Hand`] gives them; one that is there stays.
    pub fn add_pilots(&mut self, found: &[(usize, String)]) -> Result<(), FleetError> {
        let found: Vec<(usize, Pilot)> =
            found.iter().map(|(p, text)| Ok((*p, of_json(text)?))).collect::<Result<_, FleetError>>()?;
        self.store.add_places(&self.run, Places::Pilots, &found)
    }

    /// The library as it is kept, once it is made.
    pub fn library(&self) -> Result<Option<String>, FleetError> {
        let found: Option<Library> = self.store.part(&self.run, Part::Library)?;
        found.map(|l| json(&l)).transpose()
    }

    /// Makes the library of all pilots on the threads of this process, and keeps it.
    pub fn make_library(&mut self, context: &Context, source: &dyn SlotSource) -> Result<(), FleetError> {
        let found: Vec<(usize, Pilot)> = self.store.places(&self.run, Places::Pilots)?;
        self.store.keep_part(&self.run, Part::Library, &pilot::library(context, source, &found))
    }

    /// Places of slots that have no row yet.
    pub fn slots_left(&self) -> Result<Vec<usize>, FleetError> {
        let there: BTreeSet<usize> = self.store.done(&self.run, 0, self.slots)?;
        Ok((0..self.slots).filter(|i| !there.contains(i)).collect())
    }

    /// Adds rows as a [`Hand`] gives them, in one transaction; one that is there stays. A row of another place than the run has is refused.
    pub fn add_rows(&mut self, rows: &[String]) -> Result<(), FleetError> {
        let rows: Vec<SlotRow> = rows.iter().map(|text| of_json(text)).collect::<Result<_, _>>()?;
        if let Some(row) = rows.iter().find(|r| r.index >= self.slots) {
            return Err(FleetError::Place { found: row.index, slots: self.slots });
        }
        self.store.add_rows(&self.run, &rows)
    }
}

/// A worker's side: it works on places and keeps nothing.
pub struct Hand {
    context: Context,
    source: Box<dyn SlotSource + Send>,
    library: Library,
    plants: Vec<Plant>,
}

impl Hand {
    /// A worker on some slots; without a library it can work on pilots only.
    pub fn of(context: Context, source: Box<dyn SlotSource + Send>, library: Option<&str>) -> Result<Hand, FleetError> {
        let library: Library = library.map(of_json).transpose()?.unwrap_or_default();
        let plants = library.plants();
        Ok(Hand { context, source, library, plants })
    }

    /// The pilot at a place.
    pub fn pilot(&self, place: usize) -> Result<String, FleetError> {
        self.place(place)?;
        json(&pilot::pilot(&self.context, self.source.as_ref(), place))
    }

    /// The row of a place.
    pub fn row(&self, place: usize) -> Result<String, FleetError> {
        self.place(place)?;
        let (name, loaded) = (self.source.name(place), self.source.load(place));
        json(&work(&self.context, &self.library, &self.plants, place, name, loaded))
    }

    fn place(&self, found: usize) -> Result<(), FleetError> {
        let slots = self.source.count();
        if found < slots { Ok(()) } else { Err(FleetError::Place { found, slots }) }
    }
}
