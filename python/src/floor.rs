//! The floor over an engine: the store's side, and the workers' side that shares nothing with it.

use crate::refusal::{ServotuneError, raise};
use pyo3::prelude::*;
use servotune_answer::{AnswerError, FloorFiles, floor_files};
use servotune_fleet::TwinSource;
use servotune_fleet::{
    Context, Effort, FileSource, Fleet, FleetError, Hand, Job, SlotSource, Spread, Stage, Stamp, Store, Verdict, Watch,
    Worker,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

type Slots = Box<dyn SlotSource + Send>;

/// Settings and slots of a FLEET.toml.
fn read(file: &Path) -> Result<(Fleet, Context, Slots), FleetError> {
    let fleet = Fleet::read(file)?;
    let context = Context::of(&fleet)?;
    let source: Slots = match &fleet.file.input.twin {
        Some(twin) => Box::new(TwinSource::of(twin)),
        None => Box::new(FileSource::of(file, &fleet.file.input)?),
    };
    Ok((fleet, context, source))
}

/// A run that tells nobody how far it is.
struct Silent;

impl Watch for Silent {
    fn step(&self, _: Stage, _: usize, _: usize) {}
}

/// The store's side of a floor: what is left to be done, and where results go.
#[pyclass(frozen, module = "servotune._core")]
pub struct Floor {
    context: Context,
    source: Slots,
    store: PathBuf,
    out: PathBuf,
    name: Option<String>,
    stamp: Stamp,
    spread: Mutex<Spread>,
}

impl Floor {
    fn job<'a>(&'a self, worker: &'a Worker, run: Option<&'a str>, threads: usize) -> Job<'a> {
        Job {
            source: self.source.as_ref(),
            context: &self.context,
            store: &self.store,
            run,
            stamp: self.stamp.clone(),
            worker,
            effort: Effort { threads, ..Effort::default() },
        }
    }

    fn worker(store: &Path) -> Result<Worker, FleetError> {
        Worker::at(store, &format!("process-{}", std::process::id()))
    }

    /// What one thread does with the run at a time.
    fn with<T>(&self, py: Python<'_>, f: impl FnOnce(&mut Spread) -> Result<T, FleetError> + Send) -> PyResult<T>
    where
        T: Send,
    {
        py.detach(|| {
            let mut spread = self.spread.lock().map_err(|_| None)?;
            f(&mut spread).map_err(Some)
        })
        .map_err(|e| match e {
            Some(e) => raise(e),
            None => ServotuneError::new_err("a thread failed while it held the run; begin again, nothing is lost"),
        })
    }
}

#[pymethods]
impl Floor {
    /// Begins the run of a FLEET.toml, or goes on with it; `started` is a time in words.
    #[new]
    fn new(
        py: Python<'_>,
        fleet: PathBuf,
        out: PathBuf,
        run: Option<String>,
        who: String,
        started: String,
    ) -> PyResult<Floor> {
        let make = || -> Result<Floor, FleetError> {
            let (file, context, source) = read(&fleet)?;
            let store = file.file.store.clone().unwrap_or_else(|| out.join("fleet.db"));
            // Makes the store's folder, as the command line does before it announces itself.
            drop(Store::open(&store)?);
            let stamp = Stamp { who, at: started };
            let worker = Floor::worker(&store)?;
            let job = Job {
                source: source.as_ref(),
                context: &context,
                store: &store,
                run: run.as_deref(),
                stamp: stamp.clone(),
                worker: &worker,
                effort: Effort::default(),
            };
            let spread = Mutex::new(Spread::begin(&job)?);
            let name = run.clone();
            Ok(Floor { context, source, store: store.clone(), out: out.clone(), name, stamp, spread })
        };
        py.detach(make).map_err(raise)
    }

    /// Number of slots.
    fn slots(&self) -> usize {
        self.source.count()
    }

    /// Name of the run.
    fn run(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |s| Ok(s.run().to_owned()))
    }

    /// Places whose pilots are left.
    fn pilots_left(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.with(py, |s| s.pilots_left())
    }

    /// Adds pilots, (place, JSON).
    fn add_pilots(&self, py: Python<'_>, found: Vec<(usize, String)>) -> PyResult<()> {
        self.with(py, |s| s.add_pilots(&found))
    }

    /// The library, made on this process's threads where it is not there yet.
    fn library(&self, py: Python<'_>, threads: usize) -> PyResult<String> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|source| raise(FleetError::Threads { source }))?;
        self.with(py, |s| {
            if let Some(found) = s.library()? {
                return Ok(found);
            }
            pool.install(|| s.make_library(&self.context, self.source.as_ref()))?;
            Ok(s.library()?.unwrap_or_default())
        })
    }

    /// Places of slots that are left.
    fn slots_left(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.with(py, |s| s.slots_left())
    }

    /// Adds rows (JSON) in one transaction; a row that is there stays.
    fn add_rows(&self, py: Python<'_>, rows: Vec<String>) -> PyResult<()> {
        self.with(py, |s| s.add_rows(&rows))
    }

    /// Shared tables, explanations, tables, pages: what `fleet run` does after the last slot. Counts of verdicts, and the files.
    fn conclude(
        &self,
        py: Python<'_>,
        threads: usize,
        pages: usize,
    ) -> PyResult<(BTreeMap<&'static str, usize>, Vec<PathBuf>)> {
        let run = self.run(py)?;
        py.detach(|| {
            let worker = Floor::worker(&self.store)?;
            let run = self.name.clone().unwrap_or(run);
            servotune_fleet::run(&self.job(&worker, Some(&run), threads), &Silent)?;
            let mut store = Store::open(&self.store)?;
            let mut verdicts: BTreeMap<&'static str, usize> = Verdict::ALL.iter().map(|v| (v.word(), 0)).collect();
            store.each_row(&run, None, |row| {
                *verdicts.entry(row.verdict.word()).or_default() += 1;
                Ok(())
            })?;
            let wanted = FloorFiles { out: &self.out, pages };
            let (context, source) = (&self.context, self.source.as_ref());
            let files = floor_files(&mut store, &run, context, source, &wanted, &self.stamp, &mut |_| ())?;
            Ok::<_, AnswerError>((verdicts, files))
        })
        .map_err(raise)
    }
}

/// A worker's side of a floor: it works on places and keeps nothing.
#[pyclass(frozen, module = "servotune._core")]
pub struct FloorHand {
    hand: Hand,
}

#[pymethods]
impl FloorHand {
    /// A worker on the slots of a FLEET.toml, with the library (JSON) where there is one.
    #[new]
    fn new(py: Python<'_>, fleet: PathBuf, library: Option<String>) -> PyResult<FloorHand> {
        let make = || -> Result<Hand, FleetError> {
            let (_, context, source) = read(&fleet)?;
            Hand::of(context, source, library.as_deref())
        };
        Ok(FloorHand { hand: py.detach(make).map_err(raise)? })
    }

    /// The pilot of a place (JSON), on so many threads.
    fn pilot(&self, py: Python<'_>, place: usize, threads: usize) -> PyResult<String> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|source| raise(FleetError::Threads { source }))?;
        py.detach(|| pool.install(|| self.hand.pilot(place))).map_err(raise)
    }

    /// The row of a place (JSON), on so many threads.
    fn row(&self, py: Python<'_>, place: usize, threads: usize) -> PyResult<String> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|source| raise(FleetError::Threads { source }))?;
        py.detach(|| pool.install(|| self.hand.row(place))).map_err(raise)
    }
}
