//! Whether the readings fold: a sensor, a converter or a logger that does not see the sign.
//!
//! In: the runs as logged, no model. Out: the reading at the fold. A machine that turns round slows down first, and its reading runs through a
//! parabola; a reading that folds turns round at full speed, in a corner, always at the same reading, and at the other end it does not.

use super::run::Run;
use crate::diagnose::rules::{FOLD_ALIKE, FOLD_CORNERS, FOLD_SHARP, FOLD_SMOOTH};
use crate::numeric::statistics::median;

/// Heights above the lowest reading at which a turn is measured, over the range of its record. A corner is four times as wide at the second as at
/// the first, a parabola twice.
const HEIGHTS: [f64; 2] = [0.03, 0.12];

/// The lowest reading, where the readings fold there.
pub(in crate::diagnose) fn reading_fold(runs: &[Run]) -> Option<f64> {
    let ends = |y: &[f64]| {
        let of = |ends: [f64; 2], v: &f64| [ends[0].min(*v), ends[1].max(*v)];
        y.iter().fold([f64::INFINITY, f64::NEG_INFINITY], of)
    };
    let low = runs.iter().map(|r| ends(&r.position)[0]).fold(f64::INFINITY, f64::min);
    let (mut below, mut over) = (Vec::new(), Vec::new());
    for run in runs {
        let [own, high] = ends(&run.position);
        below.extend(turns(run.position.iter().map(|y| y - low).collect(), high - low));
        over.extend(turns(run.position.iter().map(|y| high - y).collect(), high - own));
    }
    let usual = |turns: &[[f64; 2]], i: usize| median(&turns.iter().map(|t| t[i]).collect::<Vec<_>>());
    let alike = usual(&below, 1)?;
    let corners = below.len() >= FOLD_CORNERS && usual(&below, 0)? > FOLD_SHARP && (alike - 1.0).abs() < FOLD_ALIKE;
    (corners && usual(&over, 0).is_none_or(|w| w < FOLD_SMOOTH)).then_some(low)
}

/// Every turn of a series that comes down to 0: its width at the second height over that at the first, and what the right-hand side of it at the first
/// is over the left-hand one.
fn turns(y: Vec<f64>, range: f64) -> Vec<[f64; 2]> {
    let [h, high] = HEIGHTS.map(|h| h * range);
    // Samples from `k` to where the series passes a height, going one way.
    let way = |k: usize, back: bool, height: f64| -> Option<f64> {
        let at = |j: usize| if back { k.checked_sub(j).map(|i| y[i]) } else { y.get(k + j).copied() };
        let mut j = 1;
        while at(j)? < height {
            j += 1;
        }
        let (a, b) = (at(j - 1)?, at(j)?);
        Some((j - 1) as f64 + (height - a) / (b - a))
    };
    let mut all = Vec::new();
    let mut k = 0;
    while k < y.len() {
        if y[k] >= h {
            k += 1;
            continue;
        }
        // One stay below the first height, and its lowest sample.
        let end = (k..y.len()).find(|&i| y[i] >= h).unwrap_or(y.len());
        let lowest = (k..end).min_by(|&a, &b| y[a].total_cmp(&y[b])).unwrap_or(k);
        let sides = || {
            let [left, right] = [true, false].map(|back| Some([way(lowest, back, h)?, way(lowest, back, high)?]));
            let (left, right) = (left?, right?);
            Some([(left[1] + right[1]) / (left[0] + right[0]), right[0] / left[0]])
        };
        if y[lowest] < 0.5 * h {
            all.extend(sides());
        }
        k = end;
    }
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::run::tests::run_at;
    use super::*;
    use crate::numeric::random::Random;

    fn swing(noise: f64) -> Vec<f64> {
        let mut random = Random::new(3);
        let at = |k: usize| 5.0 * (k as f64 * 0.013).sin() + 2.0 * (k as f64 * 0.0037).cos();
        (0..6000).map(|k| at(k) + noise * random.normal()).collect()
    }

    #[test]
    fn a_swing_without_its_sign_folds() {
        for noise in [0.0, 0.01] {
            let folded = swing(noise).into_iter().map(|v: f64| 0.5 + (v - 0.3).abs()).collect();
            let found = reading_fold(&[run_at(folded)]).unwrap();
            assert!((found - 0.5).abs() < 0.05, "{found}");
        }
    }

    #[test]
    fn swings_triangles_and_bounces_do_not_fold() {
        let triangle = |k: usize| (k % 400).abs_diff(200) as f64;
        // Falls, each bounce with half of the speed.
        let bounce = |k: usize| {
            let (mut t, mut v) = ((k % 600) as f64, 100.0);
            while t > 2.0 * v {
                (t, v) = (t - 2.0 * v, 0.5 * v + 1e-3);
                if v < 1.0 {
                    return 0.0;
                }
            }
            v * t - 0.5 * t * t
        };
        let sound = [swing(0.0), swing(0.01), (0..6000).map(triangle).collect(), (0..6000).map(bounce).collect()];
        for position in sound {
            assert_eq!(reading_fold(&[run_at(position)]), None);
        }
    }
}
