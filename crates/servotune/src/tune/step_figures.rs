//! Overshoot and settling, read off the position under a unit step of the reference.

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

fn highest(values: impl Iterator<Item = f64>) -> usize {
    let larger = |best: (usize, f64), (i, x): (usize, f64)| if x > best.1 || x.is_nan() { (i, x) } else { best };
    values.enumerate().fold((0, f64::NEG_INFINITY), larger).0
}

#[cfg(test)]
mod tests {
    use super::*;

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
