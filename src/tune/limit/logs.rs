//! A convex function below the noise's share of the weighted sum, and its least value over a box with one demand.
//!
//! Along u = ln L - ln L0, ln|T| has the slope S and bends by S T, ln|S| the slope -T and bends likewise: next to the crossing u is small, above it S T is. Both
//! are therefore nearly straight in the numbers, exp of them is convex, and so is the root of a sum of such powers.

use super::structure::MOST;

/// Power of one line: its share in both bands times the exponential of twice an affine function.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinePower {
    pub power: [f64; 2],
    pub at: f64,
    pub slope: [f64; MOST],
}

/// Numbers between -1 and 1 with slope'y >= least.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub slope: [f64; MOST],
    pub least: f64,
}

/// Steps of the conditional gradient; the bound holds after any number of them.
const STEPS: usize = 12;
/// Ends where the bound is this near to the value, as a share.
const NEAR: f64 = 0.002;

/// The power of lines whose magnitude is known from below only, and that of the others; weights of the two bands.
pub(super) fn least(
    lines: &[LinePower],
    constant: [f64; 2],
    weight: [f64; 2],
    within: Option<&HalfSpace>,
    n: usize,
) -> f64 {
    let mut y = [0.0; MOST];
    let mut best: f64 = 0.0;
    for step in 0..STEPS {
        let (value, gradient) = at(lines, constant, weight, &y, n);
        let Some(end) = corner(&gradient, within, n) else { return f64::INFINITY };
        let change: f64 = (0..n).map(|j| gradient[j] * (end[j] - y[j])).sum();
        // Convex: nowhere below its tangent.
        best = best.max(value + change);
        if change > -NEAR * value {
            break;
        }
        let share = 2.0 / (step as f64 + 2.0);
        for j in 0..n {
            y[j] += share * (end[j] - y[j]);
        }
    }
    best
}

/// Value and gradient.
fn at(lines: &[LinePower], constant: [f64; 2], weight: [f64; 2], y: &[f64; MOST], n: usize) -> (f64, [f64; MOST]) {
    let mut power = constant;
    let mut turn = [[0.0; MOST]; 2];
    for l in lines {
        let along: f64 = (0..n).map(|j| l.slope[j] * y[j]).sum();
        let size = (2.0 * (l.at + along)).exp();
        for b in 0..2 {
            let p = l.power[b] * size;
            power[b] += p;
            turn[b].iter_mut().zip(&l.slope[..n]).for_each(|(t, g)| *t += p * g);
        }
    }
    let mut value = 0.0;
    let mut gradient = [0.0; MOST];
    for b in 0..2 {
        let norm = power[b].sqrt();
        value += weight[b] * norm;
        for j in 0..n {
            gradient[j] += if norm > 0.0 { weight[b] * turn[b][j] / norm } else { 0.0 };
        }
    }
    (value, gradient)
}

/// Where a straight function is least; none where the half-space misses the box.
fn corner(gradient: &[f64; MOST], within: Option<&HalfSpace>, n: usize) -> Option<[f64; MOST]> {
    let mut y = [0.0; MOST];
    for j in 0..n {
        y[j] = if gradient[j] > 0.0 { -1.0 } else { 1.0 };
    }
    let Some(h) = within else { return Some(y) };
    let mut missing = h.least - (0..n).map(|j| h.slope[j] * y[j]).sum::<f64>();
    if missing <= 0.0 {
        return Some(y);
    }
    // The cheapest way back into the half-space: the number that costs least by what it brings goes first.
    let mut order: Vec<usize> = (0..n).filter(|j| h.slope[*j] * y[*j] < 0.0).collect();
    order.sort_by(|a, b| {
        let cost = |j: usize| gradient[j].abs() / h.slope[j].abs();
        cost(*a).total_cmp(&cost(*b))
    });
    for j in order {
        let most = 2.0 * h.slope[j].abs();
        let share = (missing / most).min(1.0);
        y[j] -= 2.0 * share * y[j];
        missing -= share * most;
        if missing <= 0.0 {
            return Some(y);
        }
    }
    // By rounding alone no demand is missed.
    (missing <= 1e-9).then_some(y)
}
