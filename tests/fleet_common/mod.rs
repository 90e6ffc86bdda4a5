//! A small floor worked on once, and stores made from its rows.
#![allow(clippy::unwrap_used, dead_code, reason = "each test file uses a part of it")]

use servotune_fleet::TwinSource;
use servotune_fleet::{
    Action, Carried, Context, Effort, Fleet, FleetError, Inputs, Job, Order, SlotRow, Stage, Stamp, Store, TwinInput,
    Verdict, Watch, Which, Worker, run,
};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A folder of its own, emptied.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fleet").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A floor without a gate: two pilots, three cases; `input` is the line of its slots.
pub fn fleet(folder: &Path, input: &str) -> PathBuf {
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("specs");
    let text = format!(
        "spec = {:?}\ncontroller = {:?}\n[input]\n{input}\n[robust]\ndraws = 1\n\
         [temperature]\ncases_c = [18.0, 30.0]\ngain_per_c = -1.2e-3\nfrequency_per_c = -2.5e-4\n\
         [tables]\npilots = 2\ncandidates = 6\nmost = 4\n[untunable]\nexplained = 0\n",
        specs.join("limits/floor.toml"),
        specs.join("controllers/nominal.toml"),
    );
    let file = folder.join("FLEET.toml");
    std::fs::write(&file, text).unwrap();
    file
}

pub struct Quiet;

impl Watch for Quiet {
    fn step(&self, _: Stage, _: usize, _: usize) {}
}

pub fn stamp() -> Stamp {
    Stamp { who: "tester".into(), at: "2026-01-01T00:00:00Z".into() }
}

pub fn context(name: &str) -> Context {
    Context::of(&Fleet::read(&fleet(&folder(name), "twin = { slots = 4, seed = 1 }")).unwrap()).unwrap()
}

/// Rows of a run of four slots, at least two of them tuned; the run is made once.
pub fn rows() -> &'static [SlotRow] {
    static ROWS: OnceLock<Vec<SlotRow>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let place = folder(&format!("rows-{}", std::process::id()));
        let store = place.join("fleet.db");
        let context = context(&format!("rows-of-{}", std::process::id()));
        let source = TwinSource::of(&TwinInput { slots: 4, seed: 1, run: 0 });
        let worker = Worker::at(&store, "test").unwrap();
        let effort = Effort { threads: 1, chunk: 4, limit_pages: None };
        let (source, context) = (&source, &context);
        let job = Job { source, context, store: &store, run: Some("one"), stamp: stamp(), worker: &worker, effort };
        run(&job, &Quiet).unwrap();
        let mut rows = Vec::new();
        let gather = |r| {
            rows.push(r);
            Ok(())
        };
        Store::reading(&store).unwrap().each_row("one", None, gather).unwrap();
        assert!(rows.iter().filter(|r| r.verdict == Verdict::Tuned).count() >= 2, "the floor has slots to be tuned");
        rows
    })
}

/// The tuned slots.
pub fn tuned() -> Vec<String> {
    rows().iter().filter(|r| r.verdict == Verdict::Tuned).map(SlotRow::id).collect()
}

/// Puts a run of these rows into a store, and what it proposes.
pub fn add_run(store: &mut Store, context: &Context, name: &str, rows: &[SlotRow]) {
    let inputs = Inputs { config: "settings".into(), slots: rows.len(), list: "list".into() };
    let run = store.begin(Some(name), &inputs, &stamp()).unwrap();
    store.add_rows(name, rows).unwrap();
    store.propose(context, &run).unwrap();
    store.finish(name, &stamp()).unwrap();
}

/// A store with one run.
pub fn store_of(place: &Path, context: &Context) -> Store {
    let mut store = Store::open(&place.join("fleet.db")).unwrap();
    add_run(&mut store, context, "run-0001", rows());
    store
}

pub fn order<'a>(which: Which<'a>, action: Action, out: Option<&'a Path>, stamp: &'a Stamp) -> Order<'a> {
    Order { which, action, run: None, out, stamp, why: "a test" }
}

pub fn one(store: &mut Store, slot: &str, action: Action, out: Option<&Path>) -> Result<Carried, FleetError> {
    store.carry_out(&order(Which::Slots(&[slot.to_owned()]), action, out, &stamp()))
}

pub fn all(store: &mut Store, action: Action, out: Option<&Path>) -> Result<Carried, FleetError> {
    store.carry_out(&order(Which::All, action, out, &stamp()))
}

/// The actions of a slot, oldest first.
pub fn words(store: &Store, slot: &str) -> Vec<String> {
    store.history(slot).unwrap().into_iter().map(|r| r.action).collect()
}

/// Where the gains of a slot are installed.
pub fn installed(out: &Path, slot: &str) -> PathBuf {
    out.join(slot).join("controller.toml")
}
