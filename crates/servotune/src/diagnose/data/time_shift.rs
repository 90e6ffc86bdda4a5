//! A series moved by a real number of samples.

/// A series as it reads a real number of samples later.
pub(in crate::diagnose) fn shifted(y: &[f64], samples: f64) -> Vec<f64> {
    let last = y.len() - 1;
    let at = |k: usize| {
        let at = (k as f64 + samples).clamp(0.0, last as f64);
        let (i, f) = (at.floor() as usize, at.fract());
        if f == 0.0 { y[i] } else { y[i] + f * (y[(i + 1).min(last)] - y[i]) }
    };
    (0..y.len()).map(at).collect()
}
