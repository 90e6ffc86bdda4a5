//! Whether the position was filtered on its way into the log: the documented controller, which heard it before, says by what.
//!
//! The log holds F y, with F = N / (c0 + c1/z + c2/z^2): low-passes without zeros (N = 1), those of the bilinear transform, as Butterworth's
//! (N = (1 + 1/z)^m), and means of n samples (c0 alone). From u = C (r - y) follows N (C r - u) = C (c0 + c1/z + c2/z^2) F y, which is linear in c
//! (equation-error form; Ljung, System Identification, 2nd edition, section 4.2).

use super::run::Run;
use super::stacked_records::NuisanceBasis;
use super::time_shift::shifted;
use crate::controller::ControlLaw;
use crate::diagnose::rules::{FILTER_GAIN, FILTER_RAISES, FILTER_WEAKENS};
use crate::lti::step_chain;
use crate::numeric::least_squares::{Qr, dot};
use crate::numeric::statistics::{line, mean};
use nalgebra::Complex;
use rayon::prelude::*;
use std::f64::consts::PI;

/// A low-pass between the controller's reading and the log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogFilter {
    /// Its numerator.
    pub numerator: Numerator,
    /// Its denominator, in powers of 1/z: c.
    pub inverse: Vec<f64>,
    /// What the replay over the log with the filter undone misses of the recorded command, rms over rms.
    pub error: f64,
}

/// Numerators of low-passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numerator {
    /// So many zeros at half of the sample rate.
    Zeros(usize),
    /// The mean of so many samples.
    Mean(usize),
}

impl Numerator {
    /// Samples before the present one that it takes in; half of them is its delay.
    fn reach(self) -> usize {
        match self {
            Numerator::Zeros(m) => m,
            Numerator::Mean(n) => n - 1,
        }
    }
}

/// Zeros and poles that are tried, and the longest mean (samples).
const SHAPES: [(usize, usize); 5] = [(0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
const LONGEST: usize = 32;
/// Frequencies up to half of the sample rate at which a low-pass is looked at.
const POINTS: usize = 2000;
/// Share of half of the sample rate near which a low-pass must weaken; at half itself one with zeros there passes nothing.
const NEAR_HALF: f64 = 0.98;

impl LogFilter {
    /// The low-pass under which the recorded commands of some runs, each with its reference, follow best from the documented law.
    pub fn of(law: &ControlLaw, with: &[(&Run, &[f64])]) -> Option<LogFilter> {
        let means = (2..=LONGEST).map(|n| (Numerator::Mean(n), 0));
        let all = SHAPES.map(|(zeros, poles)| (Numerator::Zeros(zeros), poles)).into_iter().chain(means);
        let all: Vec<(Numerator, usize)> = all.collect();
        let fitted: Vec<LogFilter> = all.par_iter().filter_map(|(n, poles)| fitted(law, with, *n, *poles)).collect();
        fitted.into_iter().filter(LogFilter::is_low_pass).min_by(|a, b| a.error.total_cmp(&b.error))
    }

    /// Frequency response at an angle per sample (rad).
    fn response(&self, angle: f64) -> Complex<f64> {
        let back = Complex::from_polar(1.0, -angle);
        let below: Complex<f64> = self.inverse.iter().enumerate().map(|(j, c)| back.powi(j as i32) * c).sum();
        match self.numerator {
            Numerator::Zeros(m) => (back + 1.0).powi(m as i32) / below,
            Numerator::Mean(n) => (0..n).map(|j| back.powi(j as i32)).sum::<Complex<f64>>() / n as f64 / below,
        }
    }

    /// Whether it is stable, keeps what stands, raises nothing by much and weakens what is fast.
    fn is_low_pass(&self) -> bool {
        // Jury's conditions for c0 z^2 + c1 z + c2.
        let c = |j: usize| self.inverse.get(j).copied().unwrap_or(0.0) / self.inverse[0];
        let stable = c(2).abs() < 1.0 && c(1).abs() < 1.0 + c(2);
        let at_rest = (self.response(0.0) - 1.0).norm() < FILTER_GAIN;
        let most = (0..=POINTS).map(|i| self.response(PI * i as f64 / POINTS as f64).norm()).fold(0.0, f64::max);
        stable && at_rest && most < FILTER_RAISES && self.response(NEAR_HALF * PI).norm() < FILTER_WEAKENS
    }

    /// Frequency at which it passes half of the power (Hz).
    pub fn bandwidth_hz(&self, sample_time_s: f64) -> f64 {
        let falls = |i: &usize| self.response(PI * *i as f64 / POINTS as f64).norm_sqr() < 0.5;
        let at = (1..=POINTS).find(falls).unwrap_or(POINTS);
        0.5 * at as f64 / POINTS as f64 / sample_time_s
    }

    /// By how much it delays slow motions (s).
    pub fn delay_s(&self, sample_time_s: f64) -> f64 {
        let sum: f64 = self.inverse.iter().sum();
        let first: f64 = self.inverse.iter().enumerate().map(|(j, c)| j as f64 * c).sum();
        (0.5 * self.numerator.reach() as f64 - first / sum) * sample_time_s
    }

    /// What the controller heard, from what is in the log. Of a mean only the delay can be undone: what it took out is lost.
    pub fn undone(&self, log: &[f64]) -> Vec<f64> {
        let zeros = match self.numerator {
            Numerator::Zeros(m) => m,
            Numerator::Mean(_) => return shifted(log, self.delay_s(1.0)),
        };
        let at = |k: usize, j: usize| log[k.saturating_sub(j)];
        let mut y: Vec<f64> =
            (0..log.len()).map(|k| self.inverse.iter().enumerate().map(|(j, c)| c * at(k, j)).sum()).collect();
        for _ in 0..zeros {
            let mut before = 0.5 * y.first().copied().unwrap_or(0.0);
            for v in &mut y {
                *v -= before;
                before = *v;
            }
        }
        without_alternation(&mut y, zeros);
        y
    }
}

/// A zero at half of the sample rate is undone but for a motion that changes its sign at every sample, which nothing tells: it is taken to be
/// none. It grows like a line where the zero is double. Its share is read off the second differences, in which slow motions are small.
fn without_alternation(y: &mut [f64], zeros: usize) {
    let n = y.len();
    if zeros == 0 || n < 8 {
        return;
    }
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let at: Vec<f64> = (1..n - 1).map(|k| k as f64).collect();
    let share: Vec<f64> = (1..n - 1).map(|k| sign(k) * 0.25 * (2.0 * y[k] - y[k - 1] - y[k + 1])).collect();
    let (first, slope) = if zeros > 1 { line(&at, &share, 0.0) } else { (mean(&share), 0.0) };
    y.iter_mut().enumerate().for_each(|(k, v)| *v -= sign(k) * (first + slope * k as f64));
}

/// The filter of one shape under which the commands follow best, the law's memory free in each record.
fn fitted(law: &ControlLaw, with: &[(&Run, &[f64])], numerator: Numerator, poles: usize) -> Option<LogFilter> {
    let reach = numerator.reach();
    let (mut columns, mut right, mut all) = (vec![Vec::new(); poles + 1], Vec::new(), 0.0);
    for (run, reference) in with {
        let n = run.len();
        let free = |k: usize| (k.saturating_sub(reach)..=k).all(|k| run.command[k].abs() < 0.999 * law.limit);
        // What the filter held before the record is not in the log.
        let mask: Vec<f64> = (0..n).map(|k| if k >= poles.max(reach) && free(k) { 1.0 } else { 0.0 }).collect();
        let seen = |mut x: Vec<f64>| {
            match numerator {
                Numerator::Zeros(m) => (0..m).for_each(|_| (1..n).rev().for_each(|k| x[k] += x[k - 1])),
                Numerator::Mean(count) => x = mean_of(&x, count),
            }
            x.iter_mut().zip(&mask).for_each(|(v, m)| *v *= m);
            x
        };
        let through = |memory: &mut [[f64; 2]], input: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..n).map(|k| step_chain(&law.chain, memory, input(k))).collect()
        };
        let mut basis = NuisanceBasis::default();
        for i in 0..2 * law.chain.len() {
            let mut memory = law.rest();
            memory[i / 2][i % 2] = 1.0;
            basis.add_local(0, seen(through(&mut memory, &|_| 0.0)));
        }
        let mut left = through(&mut law.rest(), &|k| reference[k]);
        left.iter_mut().enumerate().for_each(|(k, v)| *v += law.ahead(reference, k) - run.command[k]);
        let mut left = seen(left);
        let command = seen(run.command.clone());
        all += dot(&command, &command);
        basis.project(&mut left);
        right.extend(left);
        for (j, column) in columns.iter_mut().enumerate() {
            let mut own = through(&mut law.rest(), &|k| run.position[k.saturating_sub(j)]);
            own.iter_mut().zip(&mask).for_each(|(v, m)| *v *= m);
            basis.project(&mut own);
            column.extend(own);
        }
    }
    let rows = right.len();
    if rows <= columns.len() || all <= 0.0 {
        return None;
    }
    let mut factors = Qr::default();
    factors.factor(rows, columns.len(), |a| {
        a.chunks_exact_mut(rows).zip(&columns).for_each(|(a, c)| a.copy_from_slice(c));
    });
    let inverse = factors.solve(&mut right.clone());
    columns.iter().zip(&inverse).for_each(|(c, by)| right.iter_mut().zip(c).for_each(|(r, v)| *r -= by * v));
    let sound = inverse.iter().all(|c| c.is_finite()) && inverse[0] != 0.0;
    sound.then(|| LogFilter { numerator, inverse, error: (dot(&right, &right) / all).sqrt() })
}

/// The mean of each sample and those before it, `count` in all; of the first ones of what there is.
fn mean_of(x: &[f64], count: usize) -> Vec<f64> {
    let from = |k: usize| (k + 1).saturating_sub(count);
    (0..x.len()).map(|k| x[from(k)..=k].iter().sum::<f64>() / (k + 1 - from(k)) as f64).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::run::tests::run_at;
    use super::*;
    use crate::numeric::random::Random;
    use crate::twin::nominal_controller;

    const SAMPLES: usize = 3000;

    /// Does something with a law and a run whose commands it made from its positions, under a reference that stands still.
    fn heard(of: impl Fn(&ControlLaw, &Run, &[f64])) {
        let controller = nominal_controller().unwrap();
        let law = ControlLaw::new(&controller).unwrap();
        let mut random = Random::new(4);
        let at = |k: usize| 3.0 * (k as f64 * 0.01).sin() + 0.2 * (k as f64 * 0.23).cos();
        let position: Vec<f64> = (0..SAMPLES).map(|k| at(k) + 0.003 * random.normal()).collect();
        let mut memory = law.rest();
        let command = position.iter().map(|y| step_chain(&law.chain, &mut memory, -y)).collect();
        of(&law, &Run { command, ..run_at(position) }, &[0.0; SAMPLES]);
    }

    /// A filter by its difference equation: a0 y = b x - a y before.
    fn filtered(x: &[f64], b: &[f64], a: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for k in 0..x.len() {
            let of = |c: &[f64], v: &[f64], from: usize| -> f64 {
                (from..c.len()).map(|j| c[j] * if k >= j { v[k - j] } else { 0.0 }).sum()
            };
            y[k] = (of(b, x, 0) - of(a, &y, 1)) / a[0];
        }
        y
    }

    #[test]
    fn a_low_pass_in_front_of_the_log_is_told_and_undone() {
        // One pole; Butterworth of second order at an eighth of the sample rate (tan(pi/8)), by the bilinear transform.
        let w = (PI / 8.0).tan();
        let (b0, a) = (w * w, [1.0 + 2f64.sqrt() * w + w * w, 2.0 * (w * w - 1.0), 1.0 - 2f64.sqrt() * w + w * w]);
        let one_pole = (vec![0.2], vec![1.0, -0.8], (1.0f64 - 0.02 / 0.8).acos() / PI);
        let filters = [one_pole, (vec![b0, 2.0 * b0, b0], a.to_vec(), 0.25)];
        heard(|law, heard, reference| {
            for (b, a, corner) in &filters {
                let log = Run { position: filtered(&heard.position, b, a), ..heard.clone() };
                let found = LogFilter::of(law, &[(&log, reference)]).unwrap();
                assert!(found.error < 1e-6, "{found:?}");
                assert!((found.bandwidth_hz(1.0) - 0.5 * corner).abs() < 0.001, "{} {corner}", found.bandwidth_hz(1.0));
                for (k, (u, y)) in found.undone(&log.position).iter().zip(&heard.position).enumerate().skip(20) {
                    // A third of the noise.
                    assert!((u - y).abs() < 1e-3, "{k}: {u} {y}");
                }
            }
        });
    }

    #[test]
    fn a_mean_is_told_and_a_sound_log_is_no_low_pass() {
        heard(|law, heard, reference| {
            let log = Run { position: mean_of(&heard.position, 5), ..heard.clone() };
            let found = LogFilter::of(law, &[(&log, reference)]).unwrap();
            assert_eq!(found.numerator, Numerator::Mean(5));
            assert!((found.delay_s(1.0) - 2.0).abs() < 1e-3, "{found:?}");
            let sound = LogFilter::of(law, &[(heard, reference)]);
            assert!(sound.is_none_or(|f| f.error > 0.01));
        });
    }
}
