//! Times of one candidate, one write, one identification and one tuning, as one JSON document on stdout.
//!
//! `cargo bench --bench speed` prints times. `cargo bench --bench speed -- response JOB.json` prints sampled responses P(e^{jwT}) instead:
//! the job holds `sample_time_s`, `w_rad_s` and `plants` (paths of plant.toml). Both are read by `benches/peers/compare.py`.
//! Inputs: the paper's healthy machine, the nominal controller, `benches/peers/spec.toml`; random plants of `twin::plants`.
#![allow(clippy::print_stdout)]

use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::document::read_toml;
use servotune::feedback::{LoopOnGrid, ModelLoop, SampledPlant, margins};
use servotune::identify::{IdentifySettings, OrderChoice, identify};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::pes::simulate;
use servotune::tune::{Machine, Outcome, Spec, TuneSettings, TuningProblem, tune};
use servotune::twin::plants::{log_grid, measure, random_plant};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Outcomes<T> = Result<T, Box<dyn Error>>;

/// Time of one call: median and fastest of `repeats` batches of `batch` calls, and the processor time of all threads, as a mean,
/// which other programs on the machine do not lengthen.
#[derive(Serialize)]
struct Timing {
    what: String,
    median_s: f64,
    fastest_s: f64,
    cpu_s: Option<f64>,
    repeats: usize,
    batch: usize,
}

/// Processor time of all threads so far (s), where the system tells it; good to one tick of the scheduler.
fn cpu_s() -> Option<f64> {
    let mut nanoseconds = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += text.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    Some(nanoseconds * 1e-9)
}

/// Times `f`, which gets the running number of its call; one batch goes before as a warm-up.
fn timing(what: &str, repeats: usize, batch: usize, mut f: impl FnMut(usize)) -> Timing {
    let mut call = 0;
    let mut run = || {
        let clock = Instant::now();
        for _ in 0..batch {
            f(call);
            call += 1;
        }
        clock.elapsed().as_secs_f64() / batch as f64
    };
    run();
    let before = cpu_s();
    let mut seconds: Vec<f64> = (0..repeats).map(|_| run()).collect();
    let cpu_s = before.zip(cpu_s()).map(|(before, after)| (after - before) / (repeats * batch) as f64);
    seconds.sort_by(f64::total_cmp);
    Timing { what: what.into(), median_s: seconds[repeats / 2], fastest_s: seconds[0], cpu_s, repeats, batch }
}

#[derive(Serialize)]
struct Times {
    times: Vec<Timing>,
    tuning: Outcome,
}

#[derive(Deserialize)]
struct Job {
    sample_time_s: f64,
    w_rad_s: Vec<f64>,
    plants: Vec<PathBuf>,
}

/// Real and imaginary parts of every plant at every frequency.
fn responses(job: &Path) -> Outcomes<Vec<Vec<[f64; 2]>>> {
    let job: Job = serde_json::from_slice(&std::fs::read(job)?)?;
    let of = |path: &PathBuf| -> Outcomes<Vec<[f64; 2]>> {
        let plant = Plant::try_from(read_toml::<PlantFile>(path)?)?;
        let sampled = DiscretePlant::of(&plant, job.sample_time_s)?;
        let at = |w: &f64| {
            let p = sampled.at(*w);
            [p.re, p.im]
        };
        Ok(job.w_rad_s.iter().map(at).collect())
    };
    job.plants.iter().map(of).collect()
}

/// Decision vectors within 5 % of the controller's, so that no two calls in a row judge the same candidate.
fn candidates(problem: &TuningProblem, controller: &Controller) -> Vec<Vec<f64>> {
    let mut random = Random::new(1);
    let at = problem.parameters().vector(controller);
    let near = |_| {
        let moved = at.iter().zip(problem.parameters().bounds());
        moved.map(|(x, [from, to])| (x + random.between(-0.05, 0.05)).clamp(*from, *to)).collect()
    };
    (0..64).map(near).collect()
}

fn candidate_times(plant: &Plant, controller: &Controller, spec: &Spec) -> Outcomes<Vec<Timing>> {
    let profile = spec.write("a write")?;
    let problem = TuningProblem::around(&[Machine::Model(plant)], spec, controller)?;
    let some = candidates(&problem, controller);
    let mut work = problem.work();
    let whole = timing("candidate: margins and DFT, search", 400, 64, |i| {
        black_box(problem.score(black_box(&some[i % some.len()]), &mut work));
    });
    let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
    let grid = SampledPlant::of_model(&sampled);
    let chains =
        some.iter().map(|x| Ok(problem.parameters().controller(x).sections()?.chain)).collect::<Outcomes<Vec<_>>>()?;
    let mut on = LoopOnGrid::default();
    let quick = timing("candidate: margins alone, search", 400, 64, |i| {
        grid.judge(black_box(&chains[i % chains.len()]), &mut on);
    });
    let sections = controller.sections()?;
    let model = ModelLoop::new(&sampled, &sections)?;
    let exact = timing("margins, exact", 200, 4, |_| {
        black_box(margins(black_box(&model)));
    });
    let write = timing("simulate: whole write with sampling of the plant", 200, 4, |_| {
        black_box(simulate(black_box(plant), controller, profile)).ok();
    });
    Ok(vec![whole, quick, exact, write])
}

fn identify_times() -> Outcomes<Vec<Timing>> {
    let w = log_grid(40.0, 5000.0, 500);
    let sweeps = (1..=5)
        .map(|seed| {
            let mut random = Random::new(seed);
            let plant = random_plant(&mut random, 10);
            Ok(measure(&plant, &w, 0.01, &mut random)?)
        })
        .collect::<Outcomes<Vec<_>>>()?;
    let time = |what: &str, order: OrderChoice| {
        let settings = IdentifySettings { order, ..Default::default() };
        timing(what, 15, sweeps.len(), |i| {
            black_box(identify(black_box(&sweeps[i % sweeps.len()]), &settings)).ok();
        })
    };
    let fixed = time("identify: 500 points, order 22 given", OrderChoice::Fixed(10));
    let auto = time("identify: 500 points, order chosen", IdentifySettings::default().order);
    Ok(vec![fixed, auto])
}

fn tune_times(plant: &Plant, controller: &Controller, spec: &Spec) -> Outcomes<(Vec<Timing>, Outcome)> {
    let machine = Machine::Model(plant);
    let settings = TuneSettings::default();
    let outcome = tune(&machine, spec, Some(controller), &settings)?;
    let mut times = Vec::new();
    for (threads, what) in [(1, "tune: one slot, 1 thread"), (2, "tune: one slot, 2 threads")] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        times.push(timing(what, 15, 1, |_| {
            black_box(pool.install(|| tune(&machine, spec, Some(controller), &settings))).ok();
        }));
    }
    Ok((times, outcome))
}

fn times() -> Outcomes<Times> {
    let (plant, controller) = (paper_machine(MachineClass::Healthy)?, nominal_controller()?);
    let spec = Spec::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/spec.toml"))?;
    let mut times = candidate_times(&plant, &controller, &spec)?;
    times.extend(identify_times()?);
    let (of_tuning, tuning) = tune_times(&plant, &controller, &spec)?;
    times.extend(of_tuning);
    Ok(Times { times, tuning })
}

fn main() -> Outcomes<()> {
    // Cargo adds `--bench` to the arguments of a bench.
    let words: Vec<String> = std::env::args().skip(1).filter(|w| !w.starts_with("--")).collect();
    let text = match words.as_slice() {
        [word, job] if word == "response" => serde_json::to_string(&responses(Path::new(job))?)?,
        _ => serde_json::to_string_pretty(&times()?)?,
    };
    println!("{text}");
    Ok(())
}
