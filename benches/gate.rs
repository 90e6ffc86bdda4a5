//! Time of the published network's training, or predictions of the discriminant, as one JSON document on stdout.
//!
//! `cargo bench --bench gate` trains 10-200-500-200-4 on 291 made-up rows, 200 epochs, batch 10, one thread. `cargo bench --bench gate --
//! lda JOB.json` learns the discriminant from `x` and `class` of the job and prints the classes of `test`. Read by `benches/peers/gate_*.py`.
#![allow(clippy::print_stdout)]

use serde::Deserialize;
use servotune::gate::{FitSettings, Rows, discriminant, fit};
use servotune::numeric::random::Random;
use std::error::Error;
use std::time::Instant;

#[derive(Deserialize)]
struct Job {
    x: Vec<Vec<f64>>,
    class: Vec<usize>,
    test: Vec<Vec<f64>>,
}

fn lda(file: &str) -> Result<String, Box<dyn Error>> {
    let job: Job = serde_json::from_slice(&std::fs::read(file)?)?;
    let classes = job.class.iter().max().map_or(0, |c| c + 1);
    let features = job.x.first().map_or(0, Vec::len);
    let d = discriminant(&job.x.concat(), features, &job.class, classes)?;
    Ok(serde_json::to_string(&d.predict(&job.test.concat()))?)
}

/// Seconds of three trainings; classes are Gaussians three deviations apart.
fn times() -> Vec<f64> {
    let mut random = Random::new(1);
    let class: Vec<usize> = (0..388).map(|i| i % 4).collect();
    let mut inputs = Vec::new();
    for &c in &class {
        inputs.extend((0..10).map(|j| if j % 4 == c { 3.0 } else { 0.0 } + random.normal() as f32));
    }
    let rows = |a: usize, b: usize| Rows { inputs: &inputs[a * 10..b * 10], class: &class[a..b] };
    let settings = FitSettings { epochs: 200, batch: 10, learning_rate: 0.01, patience: None };
    let one = |seed| {
        let clock = Instant::now();
        std::hint::black_box(fit(&[10, 200, 500, 200, 4], rows(0, 291), rows(291, 388), &settings, seed));
        clock.elapsed().as_secs_f64()
    };
    (0..3).map(one).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo adds `--bench` to the arguments of a bench.
    let words: Vec<String> = std::env::args().skip(1).filter(|w| !w.starts_with("--")).collect();
    let text = match words.as_slice() {
        [word, job] if word == "lda" => lda(job)?,
        _ => serde_json::to_string(&times())?,
    };
    println!("{text}");
    Ok(())
}
