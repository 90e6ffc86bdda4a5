//! The moves that reach every frequency, to the second order: gain, dead time, and the body where it is not cut into pieces.
//!
//! They move the loop at low frequencies, where the write is largest, so that a rest of the second order in absolute values would be far from what
//! happens; theirs is of the third.

use super::Interval;
use super::cut::Cut;
use super::family::{DELAY, Family, GAIN, PAIRS, share};
use super::moves::Pair;
use super::moves::{Shares, size};
use nalgebra::Complex;

/// Which factors are in the core, and their half widths.
pub(super) struct Core {
    gain: f64,
    /// Half width of the dead time (s).
    late: f64,
    /// Index of the body's pair.
    pub body: Option<usize>,
    pair: Option<(Pair, Shares)>,
}

/// The core at one point.
pub(super) struct Bend {
    /// Coordinate and linear part.
    pub linear: Vec<(usize, Complex<f64>)>,
    /// For each of them the size of what its factor does beyond, one factor's counted once.
    pub own: Vec<f64>,
    /// Σ of linear sizes; of second-order sizes; bound of the rest; bound of the whole move.
    pub straight: f64,
    pub bend: f64,
    pub third: f64,
    pub most: f64,
    products: Vec<Complex<f64>>,
}

/// Sums over factors: of sizes, their product, their rests.
#[derive(Clone, Copy)]
pub(super) struct Sum {
    sum: f64,
    product: f64,
    pub rest: f64,
}

impl Default for Sum {
    fn default() -> Self {
        Sum { sum: 0.0, product: 1.0, rest: 0.0 }
    }
}

impl Sum {
    pub fn add(&mut self, most: f64, rest: f64) {
        self.sum += most;
        self.product *= 1.0 + most;
        self.rest += rest;
    }

    /// Bound of the product's move.
    pub fn most(&self) -> f64 {
        self.product - 1.0
    }

    /// Bound of what is not the sum of the linear parts.
    pub fn beyond(&self) -> f64 {
        (self.product - 1.0 - self.sum).max(0.0) + self.rest
    }
}

impl Core {
    pub fn of(family: &Family, ranges: &[Interval], cuts: &[Cut]) -> Core {
        let last = family.pairs.len().wrapping_sub(1);
        let body = family.pairs.last().filter(|p| p.zero.is_none() && cuts.iter().all(|c| c.pair != last));
        Core {
            gain: share(&ranges[GAIN]),
            late: share(&ranges[DELAY]) * family.delay_s(),
            body: body.map(|_| last),
            pair: body.map(|p| (*p, Family::shares(ranges, last))),
        }
    }

    fn coordinates(&self) -> Vec<usize> {
        let body = self.body.map(|b| [PAIRS + 3 * b, PAIRS + 3 * b + 2]);
        [GAIN, DELAY].into_iter().chain(body.into_iter().flatten()).collect()
    }

    /// Pairs of coordinates, each once, a square among them.
    pub fn pairs(&self) -> Vec<[usize; 2]> {
        let c = self.coordinates();
        (0..c.len()).flat_map(|i| (i..c.len()).map(move |j| (i, j))).map(|(i, j)| [c[i], c[j]]).collect()
    }

    /// The core at s.
    pub fn at(&self, s: Complex<f64>) -> Bend {
        let zero = Complex::new(0.0, 0.0);
        let late = s * -self.late;
        let body = self.pair.map(|(p, shares)| p.bent(s, shares, p.reach(s, shares)));
        let mut linear = vec![(GAIN, Complex::new(self.gain, 0.0)), (DELAY, late)];
        // Gain times body is no move of one factor: only the body's own two are.
        let mut squares = vec![zero, late * late * 0.5];
        let mut same = zero;
        let x = size(late);
        // Of each factor: linear size, second order, rest.
        let mut factors = vec![[self.gain, 0.0, 0.0], [x, 0.5 * x * x, x.exp_m1() - x - 0.5 * x * x]];
        let mut own = vec![0.0, factors[1][1] + factors[1][2]];
        if let (Some(b), Some(i)) = (body, self.body) {
            linear.push((PAIRS + 3 * i, b.linear[0]));
            linear.push((PAIRS + 3 * i + 2, b.linear[1]));
            squares.extend([b.second[0], b.second[2]]);
            same = b.second[1];
            let second = b.second.iter().map(|x| size(*x)).sum::<f64>();
            factors.push([size(b.linear[0]) + size(b.linear[1]), second, b.rest]);
            own.extend([second + b.rest, 0.0]);
        }
        let mut products = Vec::new();
        for (i, (_, a)) in linear.iter().enumerate() {
            for (j, (_, b)) in linear.iter().enumerate().skip(i) {
                products.push(match (i, j) {
                    _ if i == j => squares[i],
                    (2, 3) => same,
                    _ => a * b,
                });
            }
        }
        let whole: Vec<f64> = factors.iter().map(|f| f.iter().sum()).collect();
        let straight = factors.iter().map(|f| f[0]).sum::<f64>();
        let pairs = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..factors.len()).map(|i| (0..i).map(|j| of(i) * of(j)).sum::<f64>()).sum()
        };
        let (crossed, kept) = (pairs(&|i| whole[i]), pairs(&|i| factors[i][0]));
        let most = whole.iter().map(|x| 1.0 + x).product::<f64>() - 1.0;
        let beyond = (most - whole.iter().sum::<f64>() - crossed).max(0.0) + (crossed - kept).max(0.0);
        let third = beyond + factors.iter().map(|f| f[2]).sum::<f64>();
        let bend = kept + factors.iter().map(|f| f[1]).sum::<f64>();
        Bend { linear, own, straight, bend, third, most, products }
    }
}

impl Bend {
    /// For each pair what the second order adds to the linear part, in a loop with complementary sensitivity `turn`.
    pub fn second(&self, turn: Complex<f64>) -> Vec<Complex<f64>> {
        let mut all = Vec::with_capacity(self.products.len());
        let mut next = self.products.iter();
        for (i, (_, a)) in self.linear.iter().enumerate() {
            for (j, (_, b)) in self.linear.iter().enumerate().skip(i) {
                let own = next.next().copied().unwrap_or_default();
                all.push(own - turn * a * b * if i == j { 1.0 } else { 2.0 });
            }
        }
        all
    }
}
