//! The discrete Fourier transform, the only home of the outside FFT.
//!
//! In: samples. Out: bins. Convention: X_k = sum over n of x\[n\] exp(-2 pi i k n / N), unscaled (`specs/conventions.md`).

use nalgebra::Complex;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// All N bins of the transform of N real samples; empty in, empty out.
///
/// Units: those of the samples. Any length is allowed; cost is of order N log N.
///
/// ```
/// let bins = servotune::numeric::spectrum::forward(&[1.0, 0.0, -1.0, 0.0]);
/// assert!((bins[1].re - 2.0).abs() < 1e-15 && bins[0].norm() < 1e-15);
/// ```
pub fn forward(samples: &[f64]) -> Vec<Complex<f64>> {
    let mut bins: Vec<Complex<f64>> = samples.iter().map(|&x| Complex::new(x, 0.0)).collect();
    if !bins.is_empty() {
        FftPlanner::new().plan_fft_forward(bins.len()).process(&mut bins);
    }
    bins
}

/// The inverse without its 1/N: x_n = sum over k of X_k exp(+2 pi i k n / N), in place.
///
/// ```
/// let mut x = servotune::numeric::spectrum::forward(&[1.0, 2.0, 4.0]);
/// servotune::numeric::spectrum::backward(&mut x);
/// assert!((x[2].re - 3.0 * 4.0).abs() < 1e-14 && x[2].im.abs() < 1e-14);
/// ```
pub fn backward(bins: &mut [Complex<f64>]) {
    if !bins.is_empty() {
        FftPlanner::new().plan_fft_inverse(bins.len()).process(bins);
    }
}

/// The inverse of one length, planned once for many uses without allocation.
#[derive(Clone)]
pub struct Backward(Arc<dyn Fft<f64>>);

impl Backward {
    /// For rows of `length` bins.
    pub fn of(length: usize) -> Backward {
        Backward(FftPlanner::new().plan_fft_inverse(length))
    }

    /// Bins of a row.
    pub fn length(&self) -> usize {
        self.0.len()
    }

    /// x_n = sum over k of X_k exp(+2 pi i k n / N), in place; `row` has the planned length, `scratch` is of one thread.
    pub fn process(&self, row: &mut [Complex<f64>], scratch: &mut Vec<Complex<f64>>) {
        scratch.resize(self.0.get_inplace_scratch_len(), Complex::new(0.0, 0.0));
        self.0.process_with_scratch(row, scratch);
    }
}

impl std::fmt::Debug for Backward {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Backward({})", self.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_sum_written_out() {
        let n = 15; // not a power of two, and composite
        let x: Vec<f64> = (0..n).map(|i| ((i * i) as f64 * 0.37).sin() + 0.2).collect();
        let bins = forward(&x);
        for (k, bin) in bins.iter().enumerate() {
            let sum: Complex<f64> = x
                .iter()
                .enumerate()
                .map(|(i, &v)| Complex::from_polar(v, -std::f64::consts::TAU * (k * i) as f64 / n as f64))
                .sum();
            // Both sums have 15 terms of order one: rounding stays below 1e-14 each.
            assert!((bin - sum).norm() < 1e-13, "bin {k}");
        }
        assert!(forward(&[]).is_empty());
    }
}
