//! Overshoot and settling, read off the position under a unit step of the reference, or at the end of a move.

use crate::pes::{Reference, Spiral};

/// Band within which a step has settled, as a share of it.
pub(super) const SETTLED: f64 = 0.02;

/// The sample of the largest position, and how far it is above the step (%), at least 0.
pub(super) fn overshoot(position: &[f64]) -> (usize, f64) {
    let at = highest(position.iter().copied());
    (at, (100.0 * (position.get(at).copied().unwrap_or(0.0) - 1.0)).max(0.0))
}

/// The sample at the settling limit; it and all later ones lie within the band where the limit is met.
pub(super) fn envelope_from(settling_s: f64, sample_time_s: f64) -> usize {
    (settling_s / sample_time_s + 1e-9).floor().min(1e9) as usize
}

/// From sample `from` on, the one farthest from the step: its number, |position - 1| in shares of the band, and the slope of that.
pub(super) fn worst_outside(position: &[f64], from: usize) -> (usize, f64, f64) {
    let from = from.min(position.len().saturating_sub(1));
    let at = from + highest(position[from..].iter().map(|y| (y - 1.0).abs()));
    let away = position.get(at).copied().unwrap_or(f64::NAN) - 1.0;
    (at, away.abs() / SETTLED, away.signum() / SETTLED)
}

/// The first sample from which on a step stays within the band, as a time (s); infinite where the record ends outside.
pub(super) fn settling_s(position: &[f64], sample_time_s: f64) -> f64 {
    let outside = |y: &f64| (y - 1.0).abs() > SETTLED || y.is_nan();
    match position.iter().rposition(outside) {
        None => 0.0,
        Some(last) if last + 1 >= position.len() => f64::INFINITY,
        Some(last) => (last + 1) as f64 * sample_time_s,
    }
}

/// The end of a spiral's move, as the samples of its record see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct MoveEnd {
    reference: Reference,
    direction: f64,
    distance: f64,
    /// Half the width of the band in which the error has settled (position_unit).
    band: f64,
    sample_time_s: f64,
}

impl MoveEnd {
    pub fn of(spiral: &Spiral, band: f64, sample_time_s: f64) -> MoveEnd {
        let (direction, distance) = (spiral.velocity.signum(), spiral.distance);
        MoveEnd { reference: Reference::of(spiral), direction, distance, band, sample_time_s }
    }

    /// The sample farthest beyond the end, how far that is, at least 0, and the slope of that.
    pub fn overshoot(&self, position: &[f64]) -> (usize, f64, f64) {
        let at = highest(position.iter().map(|y| self.direction * y));
        let beyond = self.direction * position.get(at).copied().unwrap_or(0.0) - self.distance;
        (at, beyond.max(0.0), if beyond > 0.0 { self.direction } else { 0.0 })
    }

    /// From `settling_s` after the move on, the sample with the largest error: its number, the error in shares of the band, and the slope of that.
    pub fn worst_outside(&self, position: &[f64], settling_s: f64) -> (usize, f64, f64) {
        let from = envelope_from(self.reference.end_s() + settling_s, self.sample_time_s);
        let from = from.min(position.len().saturating_sub(1));
        let error = |(i, y): (usize, &f64)| y - self.reference.at((from + i) as f64 * self.sample_time_s);
        let at = highest(position[from..].iter().enumerate().map(|p| error(p).abs()));
        let away = position.get(from + at).map_or(f64::NAN, |y| error((at, y)));
        (from + at, away.abs() / self.band, away.signum() / self.band)
    }

    /// Time from the end of the move to the first sample (s) from which on the error stays within the band, at least 0; infinite where the record ends outside.
    pub fn settling_s(&self, position: &[f64]) -> f64 {
        let t = self.sample_time_s;
        let error = |k: usize| (position[k] - self.reference.at(k as f64 * t)).abs();
        match (0..position.len()).rev().find(|k| error(*k) > self.band || position[*k].is_nan()) {
            None => 0.0,
            Some(last) if last + 1 >= position.len() => f64::INFINITY,
            Some(last) => ((last + 1) as f64 * t - self.reference.end_s()).max(0.0),
        }
    }
}

fn highest(values: impl Iterator<Item = f64>) -> usize {
    let larger = |best: (usize, f64), (i, x): (usize, f64)| if x > best.1 || x.is_nan() { (i, x) } else { best };
    values.enumerate().fold((0, f64::NEG_INFINITY), larger).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_move_that_ends_late_overshoots_and_settles_as_it_was_made() {
        // 2 beyond the end for 1 ms after it, then 0.1 off, in either direction.
        for direction in [1.0, -1.0] {
            let spiral = Spiral {
                velocity: 100.0 * direction,
                distance: 0.5,
                acceleration_time_s: 1e-3,
                start_s: 2e-3,
                duration_s: 0.02,
            };
            let t = 1e-4;
            let (end, reference) = (MoveEnd::of(&spiral, 0.2, t), Reference::of(&spiral));
            let off = |k: usize| match k as f64 * t - reference.end_s() {
                late if late < 0.0 => 0.0,
                late if late < 1e-3 => 2.0 * direction,
                _ => 0.1,
            };
            let y: Vec<f64> = (0..200).map(|k| reference.at(k as f64 * t) + off(k)).collect();
            assert!((end.overshoot(&y).1 - 2.0).abs() < 1e-9);
            assert_eq!(end.overshoot(&y).2, direction);
            let settled = end.settling_s(&y);
            assert!(settled > 1e-3 - 1e-12 && settled <= 1e-3 + t, "{settled}");
            // The envelope is met from there on and not before.
            assert!(end.worst_outside(&y, settled).1 <= 1.0 && end.worst_outside(&y, settled - t).1 > 1.0);
        }
    }

    #[test]
    fn a_first_order_answer_settles_after_ln_fifty_time_constants() {
        let (t, tau) = (1e-4, 5e-3);
        let y: Vec<f64> = (0..1000).map(|k| 1.0 - (-f64::from(k) * t / tau).exp()).collect();
        // The next sample after tau ln 50.
        let truth = tau * 50f64.ln();
        assert!(settling_s(&y, t) >= truth && settling_s(&y, t) < truth + t);
        assert_eq!(overshoot(&y).1, 0.0);
        assert!(worst_outside(&y, envelope_from(truth + t, t)).1 <= 1.0);
        assert_eq!(settling_s(&y[..100], t), f64::INFINITY);
    }
}
