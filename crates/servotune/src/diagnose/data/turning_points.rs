//! Where a motion turned round: what a friction remembers of the way before an excerpt.
//!
//! A drag that sticks goes by the way since its last turns, not by time (Masing 1926; Visintin, Differential Models of Hysteresis, 1994). So the
//! positions of the turns stand for all that was before, and an excerpt from the middle of a record begins with its bearing wound up as it was.

use crate::numeric::statistics::median;

/// Turns that are kept, the newest.
const KEPT: usize = 256;
/// Way back from a turn, in the sensor's noise, by which it is one.
const BACK: f64 = 8.0;
/// Median of a normal variable's magnitude over its deviation, and the root of what a third difference makes of a variance.
const MEDIAN_OF_MAGNITUDES: f64 = 0.6745;
const THIRD_DIFFERENCE: f64 = 4.4721;

/// White noise of a series of positions, rms: what third differences hold, which no smooth motion has.
fn noise(position: &[f64]) -> f64 {
    let third = |w: &[f64]| (w[3] - 3.0 * (w[2] - w[1]) - w[0]).abs();
    let all: Vec<f64> = position.windows(4).map(third).collect();
    median(&all).unwrap_or(0.0) / (MEDIAN_OF_MAGNITUDES * THIRD_DIFFERENCE)
}

/// The first position and those at which the motion turned, oldest first; turns within noise are none.
pub(super) fn turning_points(position: &[f64]) -> Vec<f64> {
    let Some(&first) = position.first() else { return Vec::new() };
    let back = BACK * noise(position);
    let (mut turns, mut low, mut high, mut rising) = (vec![first], first, first, None);
    for &x in position {
        (low, high) = (low.min(x), high.max(x));
        let (falls, rises) = (high - x > back, x - low > back);
        match rising {
            None if falls || rises => (rising, low, high) = (Some(rises), x, x),
            Some(true) if falls => {
                turns.push(high);
                (rising, low, high) = (Some(false), x, x);
            }
            Some(false) if rises => {
                turns.push(low);
                (rising, low, high) = (Some(true), x, x);
            }
            _ => {}
        }
    }
    newest(turns)
}

/// The turns that are kept of some.
pub(super) fn newest(mut turns: Vec<f64>) -> Vec<f64> {
    turns.drain(..turns.len().saturating_sub(KEPT));
    turns
}

#[cfg(test)]
mod tests {
    use super::turning_points;
    use crate::numeric::random::Random;

    /// A triangle between -2 and 3, sampled finely under noise: its corners, each within the noise, and no turn that is none.
    #[test]
    fn the_corners_of_a_triangle_under_noise() {
        let mut random = Random::new(5);
        let corners = [0.0, 3.0, -2.0, 1.0, 0.5, 3.0];
        let side = |w: &[f64]| (0..200).map(|k| w[0] + (w[1] - w[0]) * k as f64 / 200.0).collect::<Vec<_>>();
        let position: Vec<f64> = corners.windows(2).flat_map(side).map(|x| x + 0.01 * random.normal()).collect();
        let found = turning_points(&position);
        assert_eq!(found.len(), 5, "{found:?}");
        found.iter().zip(corners).for_each(|(a, b)| assert!((a - b).abs() < 0.05, "{a} for {b}"));
    }

    #[test]
    fn what_stands_still_never_turns() {
        assert_eq!(turning_points(&[1.5; 50]), [1.5]);
        assert!(turning_points(&[]).is_empty());
    }
}
