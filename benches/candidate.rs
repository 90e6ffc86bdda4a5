//! What one candidate of a tuning costs, and a whole tuning. Run: `cargo bench --bench candidate`.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../tests/tune_common/mod.rs"]
mod tune_common;

use divan::{Bencher, black_box};
use servotune::controller::Controller;
use servotune::feedback::{LoopOnGrid, SampledPlant};
use servotune::lti::DiscretePlant;
use servotune::tune::{Machine, Spec, TuneSettings, TuningProblem, tune};
use tune_common::{paper_plant, paper_response, paper_spec, start_controller};

fn main() {
    divan::main();
}

fn without_peak() -> Spec {
    let mut spec = paper_spec();
    spec.limits.command_peak = None;
    spec
}

fn controller() -> Controller {
    start_controller()
}

#[divan::bench]
fn margins(b: Bencher) {
    let plant = SampledPlant::of_model(&DiscretePlant::of(&paper_plant(), 39.6e-6).unwrap());
    let chain = controller().sections().unwrap().chain;
    let mut on = LoopOnGrid::default();
    b.bench_local(|| plant.judge(black_box(&chain), &mut on));
}

fn candidate_of(b: Bencher, spec: &Spec, machine: Machine<'_>) {
    let start = controller();
    let problem = TuningProblem::around(&[machine], spec, &start).unwrap();
    let x = problem.parameters().vector(&start);
    let mut work = problem.work();
    b.bench_local(|| problem.score(black_box(&x), &mut work));
}

fn slopes_of(b: Bencher, spec: &Spec, machine: Machine<'_>) {
    let start = controller();
    let problem = TuningProblem::around(&[machine], spec, &start).unwrap();
    let x = problem.parameters().vector(&start);
    let mut work = problem.work();
    b.bench_local(|| problem.slopes(black_box(&x), &mut work).unwrap());
}

#[divan::bench]
fn slopes(b: Bencher) {
    slopes_of(b, &without_peak(), Machine::Model(&paper_plant()));
}

#[divan::bench]
fn slopes_on_a_response(b: Bencher) {
    let frf = paper_response();
    let machine = Machine::Response { frf: &frf, continuation: None };
    slopes_of(b, &without_peak(), machine);
}

#[divan::bench]
fn candidate(b: Bencher) {
    candidate_of(b, &without_peak(), Machine::Model(&paper_plant()));
}

#[divan::bench]
fn candidate_with_command_peak(b: Bencher) {
    candidate_of(b, &paper_spec(), Machine::Model(&paper_plant()));
}

#[divan::bench]
fn candidate_on_a_response(b: Bencher) {
    let frf = paper_response();
    candidate_of(b, &without_peak(), Machine::Response { frf: &frf, continuation: None });
}

#[divan::bench(args = [1, 2], sample_count = 10, sample_size = 1)]
fn whole_tuning(b: Bencher, threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (plant, spec, start) = (paper_plant(), without_peak(), controller());
    b.bench_local(|| {
        pool.install(|| tune(&Machine::Model(&plant), &spec, Some(&start), &TuneSettings::default()).unwrap())
    });
}
