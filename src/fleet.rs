//! `servotune fleet`: all slots of all testers, from raw files to tables and report; history, revisions, differences.

use super::fleet_arguments::{FleetArguments, FleetCommand, FleetRunArguments};
use super::fleet_clock::Clocked;
use super::fleet_progress::Progress;
use super::stamp::stamp;
use super::{Ending, Failure, Screen, fleet_progress, fleet_store};
use serde::Serialize;
use servotune_answer::{FloorFiles, floor_files};
use servotune_fleet::{
    self as fleet, Action, Context, Effort, FileSource, Fleet, Job, SlotSource, Store, TwinSource, Verdict, Worker,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a run came to.
#[derive(Serialize)]
pub(super) struct Document {
    run: String,
    slots: usize,
    verdicts: BTreeMap<&'static str, usize>,
    /// Tuned slots whose table the second prover certifies on the models of all cases.
    certified: usize,
    shared: Option<fleet::Shared>,
    store: PathBuf,
    files: Vec<PathBuf>,
    /// Time of the run up to the store's last transaction, and of the files after it (s).
    seconds: f64,
    files_seconds: f64,
    /// Slots worked on by this process in a second, pilots included in the time.
    slots_per_s: f64,
    /// From the first slot of the stage of every slot to its last (s), pilots and shared tables left out.
    slots_stage_s: f64,
    /// Processor time of that stage and of the run without its files (s), where the system tells.
    slots_stage_cpu_s: Option<f64>,
    cpu_s: Option<f64>,
    /// Time of all threads together that went into reading or drawing slots (s).
    loading_thread_s: f64,
    /// Most memory that this process ever held (MiB), where the system tells.
    peak_memory_mib: Option<f64>,
}

/// Most memory ever held, as Linux tells it.
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

pub(super) fn run(a: &FleetArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    match &a.what {
        FleetCommand::Run(a) => run_floor(a, screen),
        FleetCommand::Runs(a) => fleet_store::runs(a, screen),
        FleetCommand::History(a) => fleet_store::history(a, screen),
        FleetCommand::Diff(a) => fleet_store::diff(a, screen),
        FleetCommand::Check(a) => fleet_store::check(a, screen),
        FleetCommand::Approve(a) => fleet_store::revise(a, Action::Approve, screen),
        FleetCommand::Apply(a) => fleet_store::revise(a, Action::Apply, screen),
        FleetCommand::Rollback(a) => fleet_store::revise(a, Action::Rollback, screen),
    }
}

/// The slots that a FLEET.toml names.
fn source(file: &Path, fleet: &Fleet) -> Result<Box<dyn SlotSource>, Failure> {
    Ok(match &fleet.file.input.twin {
        Some(twin) => Box::new(TwinSource::of(twin)),
        None => Box::new(FileSource::of(file, &fleet.file.input)?),
    })
}

fn run_floor(a: &FleetRunArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let (document, text) = make(a, screen)?;
    screen.result(&document, &text)?;
    let served = document.verdicts[Verdict::Keeps.word()] + document.verdicts[Verdict::Tuned.word()];
    Ok(if served == document.slots { Ending::Accepted } else { Ending::Rejected })
}

/// Works on a floor and writes its files; what it came to, as a document and in words.
pub(super) fn make(a: &FleetRunArguments, screen: &mut Screen) -> Result<(Document, String), Failure> {
    let fleet = Fleet::read(&a.fleet)?;
    let context = Context::of(&fleet)?;
    let source = Clocked::of(source(&a.fleet, &fleet)?);
    let store_file = fleet.file.store.clone().unwrap_or_else(|| a.out.join("fleet.db"));
    let mut store = Store::open(&store_file)?;
    fleet_store::say_healed(&store.heal()?, screen);
    let worker = Worker::at(&store_file, &format!("process-{}", std::process::id()))?;
    let job = Job {
        source: &source,
        context: &context,
        store: &store_file,
        run: a.run.as_deref(),
        stamp: stamp(a.who.as_deref()),
        worker: &worker,
        effort: Effort { threads: a.threads, chunk: a.chunk, limit_pages: None },
    };
    let progress = Progress::new();
    let begun = Instant::now();
    let run = fleet::run(&job, &progress);
    progress.close();
    let run = run?;
    let (seconds, cpu_s) = (begun.elapsed().as_secs_f64(), fleet_progress::cpu_s());
    let mut verdicts: BTreeMap<&'static str, usize> = Verdict::ALL.iter().map(|v| (v.word(), 0)).collect();
    let mut certified = 0;
    store.each_row(&run, None, |row| {
        *verdicts.entry(row.verdict.word()).or_default() += 1;
        certified += usize::from(row.certified.as_ref().is_some_and(|c| c.passes));
        Ok(())
    })?;
    let wanted = FloorFiles { out: &a.out, pages: a.pages };
    let files = floor_files(&mut store, &run, &context, &source, &wanted, &stamp(a.who.as_deref()), &mut |words| {
        screen.say(words);
    })?;
    files.iter().for_each(|f| screen.say(&format!("wrote {}", f.display())));
    let files_seconds = begun.elapsed().as_secs_f64() - seconds;
    let slots = source.count();
    let counts: Vec<String> = Verdict::ALL.iter().map(|v| format!("{} {}", verdicts[v.word()], v.word())).collect();
    let mut text = format!("run {run}: {slots} slots: {}\n", counts.join(", "));
    let shared = store.shared(&run)?;
    text += &shared.as_ref().map(shared_words).unwrap_or_default();
    let slots_per_s = progress.earned() as f64 / seconds.max(1e-9);
    text += &format!("{seconds:.1} s, {slots_per_s:.1} slots/s\n");
    let document = Document {
        run,
        slots,
        verdicts,
        certified,
        shared,
        store: store_file,
        files,
        seconds,
        files_seconds,
        slots_per_s,
        slots_stage_s: progress.slots_stage_s(),
        slots_stage_cpu_s: progress.slots_stage_cpu_s(),
        cpu_s,
        loading_thread_s: source.seconds(),
        peak_memory_mib: peak_memory_mib(),
    };
    Ok((document, text))
}

/// The shared tables in words.
fn shared_words(s: &fleet::Shared) -> String {
    let share = |n: usize| format!("{n} ({:.1} %)", 100.0 * n as f64 / s.slots.max(1) as f64);
    let served = s.curve.get(s.chosen.saturating_sub(1)).map_or(0, |c| c.served);
    format!(
        "of {} slots to be served: today's gains prove {}, a table of their own {}, {} shared tables {}\n",
        s.slots,
        share(s.today),
        share(s.own),
        s.chosen,
        share(served)
    )
}
