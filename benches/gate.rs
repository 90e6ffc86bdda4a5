//! Time of the published network's training, as one JSON document on stdout.
//!
//! `cargo bench --bench gate` trains 10-200-500-200-4 on 291 made-up rows, 200 epochs, batch 10.
#![allow(clippy::print_stdout)]
use servotune::gate::{FitSettings, Rows, fit};
use servotune::numeric::random::Random;
use std::time::Instant;

fn main() {
    let mut random = Random::new(1);
    let class: Vec<usize> = (0..388).map(|i| i % 4).collect();
    let inputs: Vec<f32> = class
        .iter()
        .flat_map(|&c| (0..10).map(|j| if j % 4 == c { 1.5 } else { 0.0 } + random.normal() as f32).collect::<Vec<_>>())
        .collect();
    let rows = |a: usize, b: usize| Rows { inputs: &inputs[a * 10..b * 10], class: &class[a..b] };
    let settings = FitSettings { epochs: 200, batch: 10, learning_rate: 0.01, patience: None };
    for seed in 0..3 {
        let clock = Instant::now();
        let f = fit(&[10, 200, 500, 200, 4], rows(0, 291), rows(291, 388), &settings, seed);
        println!(
            "{:.3} s best {} {:?} last {:?}",
            clock.elapsed().as_secs_f64(),
            f.best,
            f.history[f.best],
            f.history[199]
        );
    }
}
