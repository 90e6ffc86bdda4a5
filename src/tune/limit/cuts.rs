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
/// Up to so many times the upper crossover |S| enters the first round, where S has its hill.
const DENSE: f64 = 3.0;
/// Upper crossover where the spec names none (Hz).
const HILL_HZ: f64 = 1500.0;
/// How far a demand may be missed at a frequency without a new cut.
const NEARLY: f64 = 1e-4;

impl Pointwise {
    /// The worst miss over frequency, and for each demand cuts at its local peaks and beside them: between two cuts S rises again.
    pub fn cuts(&self, h: &Horizon, s: &[f64]) -> (f64, Vec<Cut>) {
        let points = POINTS_PER_TAP * s.len();
        let angle = |i: usize| PI * (i + 1) as f64 / points as f64;
        let at: Vec<Complex<f64>> = (0..points).map(|i| response_of(s, angle(i))).collect();
        let mut worst = f64::NEG_INFINITY;
        let mut found = Vec::new();
        for kind in [Kind::Sharp, Kind::Inside, Kind::Outside] {
            let miss = |i: usize| self.miss(at[i], angle(i), kind);
            for i in 0..points {
                let value = miss(i);
                worst = worst.max(value);
                let peak = |i: usize| (i == 0 || miss(i - 1) <= miss(i)) && (i + 1 == points || miss(i + 1) <= miss(i));
                if value > NEARLY && (peak(i) || (i > 0 && peak(i - 1)) || (i + 1 < points && peak(i + 1))) {
                    found.push(self.cut(h, angle(i), kind));
                }
            }
        }
        (worst, found)
    }

    /// Cuts of the first round, one frequency a tap: the demands on Re S everywhere, that on |S| where S has its hill.
    ///
    /// The mean of Re S over all frequencies is 1, so that Re S >= 1/2 above the crossovers already holds S together there, by one row each.
    pub fn first(&self, h: &Horizon) -> Vec<Cut> {
        let top = TAU * self.sample_time_s * DENSE * self.crossover_hz.map_or(HILL_HZ, |[_, high]| high);
        let mut all = Vec::new();
        for angle in (0..h.taps).map(|i| PI * (i + 1) as f64 / h.taps as f64) {
            for kind in [Kind::Sharp, Kind::Inside, Kind::Outside] {
                let asked = self.miss(Complex::new(1.0, 0.0), angle, kind) > f64::NEG_INFINITY;
                if asked && (kind != Kind::Sharp || angle <= top || self.crossover_hz.is_none()) {
                    all.push(self.cut(h, angle, kind));
                }
            }
        }
        all
    }

    /// By how much S misses a demand at one frequency (rad a sample); minus infinity where there is none.
    fn miss(&self, at: Complex<f64>, angle: f64, kind: Kind) -> f64 {
        let hz = angle / (TAU * self.sample_time_s);
        match (kind, self.max_sensitivity, self.crossover_hz) {
            (Kind::Sharp, Some(ms), _) => at.norm() - ms - self.tail,
            (Kind::Inside, _, Some([low, _])) if hz <= low => at.re - 0.5 - self.tail,
            (Kind::Outside, _, Some([_, high])) if hz >= high => 0.5 - self.tail - at.re,
            _ => f64::NEG_INFINITY,
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

/// S at one frequency (rad a sample).
fn response_of(s: &[f64], angle: f64) -> Complex<f64> {
    let step = Complex::from_polar(1.0, -angle);
    s.iter().rev().fold(Complex::new(0.0, 0.0), |sum, s| sum * step + *s)
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
