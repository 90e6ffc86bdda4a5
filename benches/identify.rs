//! Time of identification: one order-22 plant at 500 points, order fixed and order searched.
#![allow(clippy::unwrap_used, missing_docs)]

use divan::Bencher;
use servotune::frf::Frf;
use servotune::identify::{IdentifySettings, OrderChoice, identify};
use servotune::numeric::least_squares::Qr;
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure, random_plant};

fn main() {
    divan::main();
}

fn sweep() -> Frf {
    let mut random = Random::new(3);
    let truth = random_plant(&mut random, 10);
    measure(&truth, &log_grid(40.0, 5000.0, 500), 0.01, &mut random).unwrap()
}

#[divan::bench]
fn order_22_fixed(bencher: Bencher) {
    let (frf, settings) = (sweep(), IdentifySettings { order: OrderChoice::Fixed(10), ..Default::default() });
    bencher.bench(|| identify(&frf, &settings).unwrap());
}

#[divan::bench]
fn order_22_searched(bencher: Bencher) {
    let (frf, settings) = (sweep(), IdentifySettings::default());
    bencher.bench(|| identify(&frf, &settings).unwrap());
}

#[divan::bench]
fn factor_1000_by_44(bencher: Bencher) {
    let mut random = Random::new(1);
    let a: Vec<f64> = (0..44_000).map(|_| random.normal()).collect();
    let mut qr = Qr::default();
    bencher.bench_local(move || {
        qr.factor(1000, 44, |m| m.copy_from_slice(&a));
        qr.r(43, 43)
    });
}
