//! What a spec demands of S at single frequencies, as cuts: convex in the taps, taken where the last point breaks them.
//!
//! |S| <= Ms is a disk. |L| >= 1 is Re S <= 1/2 and |L| <= 1 is Re S >= 1/2, exactly: with all gain crossings inside the spec's range the
//! first holds below it and the second above it. A loop of the class forgets: beyond the horizon its S has little left, the `tail`,
//! by which every demand on the horizon's own S is let out. Only frequencies of a grid are looked at, which lets out more.

use super::energy::{Affine, convolved};
use super::horizon::Horizon;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// What every loop of the class obeys.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cut {
    /// Not negative.
    Half(Affine),
    /// The length of the two is at most the bound.
    Disk(f64, [Affine; 2]),
}

/// What is demanded of S at single frequencies, where loops forget within the write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pointwise {
    pub sample_time_s: f64,
    /// Sum of |s_k| beyond the horizon at most.
    pub tail: f64,
    pub max_sensitivity: Option<f64>,
    /// All gain crossings lie between these (Hz).
    pub crossover_hz: Option<[f64; 2]>,
}

/// The first taps of S.
pub(super) fn sensitivity(h: &Horizon, q: &[f64]) -> Vec<f64> {
    let mut s: Vec<f64> = convolved(&h.shaped_plant[..h.taps], q).iter().map(|x| -x).collect();
    s[0] += 1.0;
    s
}

/// Frequencies looked at for every tap.
const POINTS_PER_TAP: usize = 2;
/// Frequencies of the first round.
const SEEDS: usize = 48;
/// How far a demand may be missed at a frequency without a new cut.
const NEARLY: f64 = 1e-4;

impl Pointwise {
    /// The worst miss over frequency, and a cut at each of its local peaks.
    pub fn cuts(&self, h: &Horizon, s: &[f64]) -> (f64, Vec<Cut>) {
        let n = s.len();
        let points = POINTS_PER_TAP * n;
        let miss: Vec<(f64, f64, Kind)> = (1..=points).map(|i| self.miss(s, PI * i as f64 / points as f64)).collect();
        let mut found = Vec::new();
        let mut worst = f64::NEG_INFINITY;
        for i in 0..points {
            let (angle, value, kind) = miss[i];
            worst = worst.max(value);
            let near = |j: usize| if miss[j].2 == kind { miss[j].1 } else { f64::NEG_INFINITY };
            let peak = (i == 0 || near(i - 1) <= value) && (i + 1 == points || near(i + 1) <= value);
            if value > NEARLY && peak {
                found.push(self.cut(h, angle, kind));
            }
        }
        (worst, found)
    }

    /// Cuts at frequencies spread by ratio, for the first round.
    pub fn first(&self, h: &Horizon) -> Vec<Cut> {
        let n = h.taps;
        let still: Vec<f64> = (0..n).map(|k| if k == 0 { 1.0 } else { 0.0 }).collect();
        let lowest = PI / n as f64;
        let angles = (0..=SEEDS).map(|i| lowest * (n as f64).powf(i as f64 / SEEDS as f64));
        let mut all = Vec::new();
        for angle in angles {
            let (_, _, side) = self.side(&still, angle);
            all.extend(side.map(|kind| self.cut(h, angle, kind)));
            all.extend(self.max_sensitivity.map(|_| self.cut(h, angle, Kind::Sharp)));
        }
        all
    }

    /// The demand most missed at one frequency (rad a sample).
    fn miss(&self, s: &[f64], angle: f64) -> (f64, f64, Kind) {
        let (at, missed, side) = self.side(s, angle);
        let sharp = self.max_sensitivity.map_or(f64::NEG_INFINITY, |ms| at.norm() - ms - self.tail);
        match side {
            Some(side) if missed > sharp => (angle, missed, side),
            _ => (angle, sharp, Kind::Sharp),
        }
    }

    /// S at one frequency, and the demand on its real part.
    fn side(&self, s: &[f64], angle: f64) -> (Complex<f64>, f64, Option<Kind>) {
        let step = Complex::from_polar(1.0, -angle);
        let at = s.iter().rev().fold(Complex::new(0.0, 0.0), |sum, s| sum * step + *s);
        let hz = angle / (TAU * self.sample_time_s);
        match self.crossover_hz {
            Some([low, _]) if hz <= low => (at, at.re - 0.5 - self.tail, Some(Kind::Inside)),
            Some([_, high]) if hz >= high => (at, 0.5 - self.tail - at.re, Some(Kind::Outside)),
            _ => (at, f64::NEG_INFINITY, None),
        }
    }

    fn cut(&self, h: &Horizon, angle: f64, kind: Kind) -> Cut {
        let [re, im] = response(h, angle);
        match kind {
            Kind::Sharp => Cut::Disk(self.max_sensitivity.unwrap_or(f64::INFINITY) + self.tail, [re, im]),
            Kind::Inside => {
                let row = re.row.iter().map(|x| -x).collect();
                Cut::Half(Affine { row, constant: 0.5 + self.tail - re.constant })
            }
            Kind::Outside => Cut::Half(Affine { constant: re.constant - 0.5 + self.tail, ..re }),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Sharp,
    Inside,
    Outside,
}

/// Real and imaginary part of the horizon's S at one frequency (rad a sample).
fn response(h: &Horizon, angle: f64) -> [Affine; 2] {
    let n = h.taps;
    let turn: Vec<Complex<f64>> = (0..n).map(|k| Complex::from_polar(1.0, -angle * k as f64)).collect();
    // A tap at m passes the plant's pulse response as far as the horizon goes.
    let mut sum = Complex::new(0.0, 0.0);
    let mut passed = vec![Complex::new(0.0, 0.0); n];
    for k in 0..n {
        sum += turn[k] * h.shaped_plant[k];
        passed[n - 1 - k] = -turn[n - 1 - k] * sum;
    }
    let (re, im) = passed.iter().map(|x| (x.re, x.im)).unzip();
    [Affine { row: re, constant: 1.0 }, Affine { row: im, constant: 0.0 }]
}
