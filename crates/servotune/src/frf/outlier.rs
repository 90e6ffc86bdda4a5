//! Single points far off their neighbours: a spike of the instrument, not a resonance.
//!
//! In: values on an ascending grid. Out: which points stand alone, and by how much. Each point is predicted from its neighbours by the cubic through four of them
//! (ln P over ln w); so are the two neighbours, without it. A mode seen in one point lifts the neighbours too, by the ratio of its width to the step: only a point
//! that is many times farther off than they are stands alone. Spec: `specs/frf.md`, "Dead channels and single points".

use nalgebra::Complex;

/// Fewest points of a sweep in which one can stand alone.
const FEWEST: usize = 16;
/// How many times farther off than its neighbours a point must be, and than the middle point of the sweep.
const ALONE: f64 = 12.0;
/// Least distance (ln of the ratio) that counts: 5 %.
const LEAST: f64 = 0.05;

/// Points that stand alone: index, and distance from the prediction (ln of the ratio).
pub(crate) fn alone(w: &[f64], value: &[Complex<f64>]) -> Vec<(usize, f64)> {
    let n = w.len();
    if n < FEWEST {
        return Vec::new();
    }
    let x: Vec<f64> = w.iter().map(|w| w.ln()).collect();
    let off: Vec<f64> = (0..n).map(|i| distance(&x, value, i, None)).collect();
    let mut sorted = off.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[n / 2];
    // The ends are predicted from one side only, where a resonance beside them looks the same.
    (1..n - 1)
        .filter(|&i| off[i] > LEAST.max(ALONE * usual))
        .filter(|&i| [i - 1, i + 1].into_iter().all(|k| ALONE * distance(&x, value, k, Some(i)) < off[i]))
        .map(|i| (i, off[i]))
        .collect()
}

/// |ln P - cubic| at point `i`, through the four points nearest to it; `without` is not among them.
fn distance(x: &[f64], value: &[Complex<f64>], i: usize, without: Option<usize>) -> f64 {
    let near = nearest(x.len(), i, without);
    let weights: [f64; 4] = std::array::from_fn(|a| {
        (0..4).filter(|b| *b != a).map(|b| (x[i] - x[near[b]]) / (x[near[a]] - x[near[b]])).product()
    });
    // ln of each relative to the one before, so that no point but these four sets the branch.
    let (mut ln, mut predicted) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
    for (a, weight) in weights.iter().enumerate() {
        if a > 0 {
            ln += (value[near[a]] / value[near[a - 1]]).ln();
        }
        predicted += ln * *weight;
    }
    // Within half a turn of the prediction: what is farther is a turn, not a distance.
    (value[i] / value[near[0]] / predicted.exp()).ln().norm()
}

/// Four points around `i`, ascending, two on each side where the sweep has them.
fn nearest(n: usize, i: usize, without: Option<usize>) -> [usize; 4] {
    let usable = |k: &usize| *k != i && Some(*k) != without;
    let mut below = (0..i).rev().filter(usable);
    let mut above = (i + 1..n).filter(usable);
    let mut left: Vec<usize> = below.by_ref().take(2).collect();
    let mut right: Vec<usize> = above.by_ref().take(4 - left.len()).collect();
    left.extend(below.take(4 - left.len() - right.len()));
    left.reverse();
    left.append(&mut right);
    std::array::from_fn(|k| left[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// One mode on a falling line, with noise; `damping` of the mode, `points` a decade.
    fn sweep(damping: f64, at: f64, points: usize, noise: f64, seed: u64) -> (Vec<f64>, Vec<Complex<f64>>) {
        let mut random = Random::new(seed);
        let w: Vec<f64> = (0..2 * points).map(|k| 10f64.powf(1.0 + k as f64 / points as f64)).collect();
        let value = w
            .iter()
            .map(|w| {
                let s = Complex::new(0.0, *w);
                let mode = 1.0 + 0.3 * s * s / (s * s + 2.0 * damping * at * s + at * at);
                mode / (s * s) * (1.0 + Complex::new(noise * random.normal(), noise * random.normal()))
            })
            .collect();
        (w, value)
    }

    /// The truth is the model itself: without a spike nothing stands alone, whatever falls between the points.
    #[test]
    fn a_resonance_of_usual_damping_is_no_spike() {
        for (k, damping) in [0.003, 0.005, 0.01, 0.03].into_iter().enumerate() {
            for seed in 0..60 {
                let at = 200.0 * (1.0 + 0.0017 * seed as f64);
                let (w, value) = sweep(damping, at, 200, if seed % 2 == 0 { 0.0 } else { 0.01 }, seed + 100 * k as u64);
                assert_eq!(alone(&w, &value), vec![], "damping {damping}, mode at {at}");
            }
        }
    }

    #[test]
    fn a_spike_is_found_wherever_it_stands() {
        for spike in
            [Complex::new(10.0, 0.0), Complex::new(-1.0, 0.0), Complex::new(0.05, 0.02), Complex::new(1e20, 0.0)]
        {
            for place in [1, 2, 40, 398, 397] {
                let (w, mut value) = sweep(0.02, 200.0, 200, 0.005, 7);
                value[place] *= spike;
                let found = alone(&w, &value);
                assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), vec![place], "{spike} at {place}");
            }
        }
    }
}
