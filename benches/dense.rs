//! faer beside what stood there before: eigenvalues and singular values by nalgebra, tall QR by the library's own reflections.
//! Run: `cargo bench --bench dense`.
#![allow(clippy::unwrap_used, missing_docs)]

use divan::{Bencher, black_box};
use faer::MatRef;
use nalgebra::{DMatrix, DVector};
use servotune::numeric::dense;
use servotune::numeric::least_squares::Qr;
use servotune::numeric::random::Random;

fn main() {
    divan::main();
}

/// A stable chain of lightly damped pairs, mixed by a random basis: what the poles of a loop look like.
fn square(n: usize) -> DMatrix<f64> {
    let mut r = Random::new(7);
    let x = DMatrix::from_fn(n, n, |i, j| r.normal() + if i == j { 5.0 } else { 0.0 });
    let d = DMatrix::from_fn(n, n, |i, j| match (i / 2 == j / 2, i == j, i < j) {
        (true, true, _) => 0.9 * (0.1 * (i / 2) as f64).cos(),
        (true, false, up) => 0.9 * (0.1 * (i / 2) as f64).sin() * if up { 1.0 } else { -1.0 },
        _ => 0.0,
    });
    &x * d * x.clone().try_inverse().unwrap()
}

fn tall((rows, cols): (usize, usize)) -> DMatrix<f64> {
    let mut r = Random::new(8);
    DMatrix::from_fn(rows, cols, |_, _| r.normal())
}

const ORDERS: [usize; 3] = [16, 40, 100];
const SHAPES: [(usize, usize); 3] = [(40, 6), (600, 45), (6000, 45)];

#[divan::bench(args = ORDERS)]
fn eigenvalues_faer(b: Bencher, n: usize) {
    let m = square(n);
    b.bench_local(|| dense::eigenvalues(black_box(&m)).unwrap());
}

#[divan::bench(args = ORDERS)]
fn eigenvalues_nalgebra(b: Bencher, n: usize) {
    let m = square(n);
    b.bench_local(|| black_box(&m).complex_eigenvalues());
}

#[divan::bench(args = ORDERS)]
fn singular_values_faer(b: Bencher, n: usize) {
    let m = square(n);
    b.bench_local(|| dense::singular_values(black_box(&m)).unwrap());
}

#[divan::bench(args = ORDERS)]
fn singular_values_nalgebra(b: Bencher, n: usize) {
    let m = square(n);
    b.bench_local(|| black_box(&m).singular_values());
}

#[divan::bench(args = SHAPES)]
fn qr_faer(b: Bencher, shape: (usize, usize)) {
    let m = tall(shape);
    b.bench_local(|| MatRef::from_column_major_slice(black_box(m.as_slice()), shape.0, shape.1).qr());
}

#[divan::bench(args = SHAPES)]
fn qr_own(b: Bencher, shape: (usize, usize)) {
    let m = tall(shape);
    let mut qr = Qr::default();
    b.bench_local(|| qr.factor(shape.0, shape.1, |a| a.copy_from_slice(black_box(m.as_slice()))));
}

/// Normal equations of unit diagonal, as the search of effects solves one for every law that it tries.
fn normal(n: usize) -> (DMatrix<f64>, DVector<f64>) {
    let a = tall((200, n));
    let size: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
    let gram = DMatrix::from_fn(n, n, |i, j| a.column(i).dot(&a.column(j)) / (size[i] * size[j]));
    (gram, DVector::from_fn(n, |i, _| i as f64 - 1.5))
}

const NORMAL: [usize; 4] = [2, 4, 8, 20];

#[divan::bench(args = NORMAL)]
fn least_squares_faer(b: Bencher, n: usize) {
    let (a, y) = normal(n);
    b.bench_local(|| dense::least_squares(black_box(&a), &y, 1e-8).unwrap());
}

#[divan::bench(args = NORMAL)]
fn least_squares_nalgebra(b: Bencher, n: usize) {
    let (a, y) = normal(n);
    b.bench_local(|| black_box(&a).clone().svd(true, true).solve(&y, 1e-8).unwrap());
}

#[divan::bench(args = NORMAL)]
fn positive_solve_faer(b: Bencher, n: usize) {
    let (a, y) = normal(n);
    b.bench_local(|| dense::positive_solve(black_box(&a), &y).unwrap());
}

#[divan::bench(args = NORMAL)]
fn positive_solve_nalgebra(b: Bencher, n: usize) {
    let (a, y) = normal(n);
    b.bench_local(|| black_box(&a).clone().cholesky().unwrap().solve(&y));
}
