//! The loop of a plant model: the patch of every cell, and what is known near rest.

use super::chain::Chain;
use super::plant::{END, Product, RigidBody};
use super::uncertain::{Others, Spread};
use super::{Interval, Patch, Uncertainty, VerifyError};
use crate::lti::{Plant, Section};
use nalgebra::Complex;

/// A loop of which every cell of frequencies has a patch that holds L over the whole cell.
pub(super) trait Enclosed {
    /// The sets whose union holds L over the cell from `a` to `b` (angle w T), for everything uncertain. The first one's
    /// certain part (centre, half, radius) holds the nominal L.
    fn patches(&self, a: f64, b: f64, into: &mut Vec<Patch>);
    /// The set that holds C, the sections as the firmware has them, over the same cell.
    fn law(&self, a: f64, b: f64) -> Patch;
    /// Where the curve begins and what is known below.
    fn start(&self) -> Result<Start, VerifyError>;
    /// Where it ends (angle).
    fn end(&self) -> f64;
    /// Places (angle) where something happens: first splits.
    fn places(&self) -> Vec<f64>;
    /// Open-loop poles outside the unit circle.
    fn outside(&self) -> usize;
    /// Sample time (s).
    fn sample_time_s(&self) -> f64;
    /// Whether the curve ends at half the sample rate, where L is real.
    fn ends_at_half_rate(&self) -> bool;
}

/// What is known below the first cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// First angle of the cells.
    pub angle: f64,
    /// Poles of L on z = 1.
    pub integrators: usize,
    /// Whether L times those is positive there.
    pub positive: bool,
    /// arg(1 + L) at the first angle (rad) where a sweep begins above rest and it is known otherwise.
    pub expected: Option<f64>,
}

/// A sampled model under the firmware's sections.
#[derive(Clone, Debug)]
pub(super) struct Sampled {
    chain: Chain,
    product: Product,
    spread: Option<Spread>,
}

/// How far the smooth part of ln L may move below the first cell.
const STILL: f64 = 1e-3;
/// |L| there, where integrators make it large.
const LARGE: f64 = 30.0;
/// Lowest angle tried: below, 1 - e^{-ja} keeps too few digits.
const LOWEST: f64 = 1e-9;

impl Sampled {
    pub fn new(plant: &Plant, sections: &[Section], t: f64, u: &Uncertainty) -> Result<Sampled, VerifyError> {
        let product = Product::of(plant, t);
        let spread = u.any().then(|| Spread::of(&product, u));
        Ok(Sampled { chain: Chain::of(sections)?, product, spread })
    }

    /// The nominal patch.
    pub fn nominal(&self, a: f64, b: f64) -> Patch {
        self.expand(a, b).0
    }

    /// The nominal patch, and the sizes of all aliases but the first.
    fn expand(&self, a: f64, b: f64) -> (Patch, Others) {
        let (angle, half) = (0.5 * (a + b), 0.5 * (b - a));
        let common = self.chain.expand(angle, half).times(Product::hold(angle));
        let main = common.times(self.product.alias(angle, half, 0)).term(half);
        let (mut centre, mut slope, mut radius) = (main.value, main.first, main.remainder);
        let mut others = Others::default();
        for k in 1..=self.product.whole as i64 {
            for k in [k, -k] {
                let e = common.times(self.product.alias(angle, half, k)).times(Product::share(angle, half, k));
                let e = e.term(half);
                centre += e.value;
                slope += e.first;
                radius += e.remainder;
                others.most += e.most;
                others.times += e.most * k.unsigned_abs() as f64;
            }
        }
        let (far, error) = self.product.far(angle, half);
        let far = common.times(far).term(half);
        let error = error * common.term(half).most;
        centre += far.value;
        slope += far.first;
        radius += far.remainder + error;
        let (gain, turn) = (Interval::ZERO, Interval::ZERO);
        let radius = if radius.is_nan() { f64::INFINITY } else { radius };
        let patch = Patch { centre, half: slope * half, radius, floor: error, gain, turn, stuck: 0.0 };
        others.far = far.most + error;
        others.most += others.far;
        (patch, others)
    }
}

impl Enclosed for Sampled {
    fn patches(&self, a: f64, b: f64, into: &mut Vec<Patch>) {
        into.clear();
        let (patch, others) = self.expand(a, b);
        match &self.spread {
            None => into.push(patch),
            Some(s) => s.patches(&patch, &others, [a, b], into),
        }
    }

    fn law(&self, a: f64, b: f64) -> Patch {
        self.chain.patch(a, b)
    }

    fn start(&self) -> Result<Start, VerifyError> {
        let m = self.chain.integrators + self.product.integrators();
        let restless = 1.0 + self.chain.restlessness() + self.product.restlessness();
        let mut angle = (STILL / restless).min(0.01);
        loop {
            let l = self.nominal(angle, angle);
            // L (j a)^m is real at rest and has hardly moved up to here.
            let lifted = l.centre * Complex::new(0.0, angle).powi(m as i32);
            let off = (lifted.im / lifted.re).abs();
            if m == 0 || l.size().low > LARGE {
                if off.is_nan() || off >= 10.0 * STILL {
                    return Err(VerifyError::Rest { angle, off });
                }
                return Ok(Start { angle, integrators: m, positive: lifted.re > 0.0, expected: None });
            }
            angle *= 0.25;
            if angle < LOWEST {
                return Err(VerifyError::Rest { angle, off });
            }
        }
    }

    fn end(&self) -> f64 {
        END
    }

    fn places(&self) -> Vec<f64> {
        let t = self.product.t;
        let mut all: Vec<f64> = self.chain.angles().collect();
        let body: Vec<f64> = match &self.product.body {
            RigidBody::Spring(q) => vec![q.w0],
            RigidBody::Free(_) => vec![],
            RigidBody::Rational(r) => r.places().collect(),
        };
        for w in self.product.modes.iter().flatten().map(|q| q.w0).chain(body) {
            // A mode above half the rate shows at its alias.
            let x = (w * t).rem_euclid(2.0 * END);
            all.push(x.min(2.0 * END - x));
        }
        all
    }

    fn outside(&self) -> usize {
        let plant = match &self.product.body {
            RigidBody::Rational(r) => r.unstable,
            _ => 0,
        };
        self.chain.outside + plant
    }

    fn sample_time_s(&self) -> f64 {
        self.product.t
    }

    fn ends_at_half_rate(&self) -> bool {
        true
    }
}
