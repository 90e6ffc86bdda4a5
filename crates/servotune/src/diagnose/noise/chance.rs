//! Bounds of the chance that noise alone gives as much.

/// Chernoff's bound of log P(chi2_m > g), 0 below the mean.
pub fn log_tail(g: f64, m: usize) -> f64 {
    let m = m as f64;
    if g <= m { 0.0 } else { 0.5 * (m - g) + 0.5 * m * (g / m).ln() }
}
