//! Plain statistics of a stretch of samples. Of nothing, or of too little, they are NaN.

/// Mean.
pub(super) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Root mean square.
pub(super) fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}

/// Central moment of order `order`, divided by n.
pub(super) fn moment(x: &[f64], order: i32) -> f64 {
    let m = mean(x);
    x.iter().map(|v| (v - m).powi(order)).sum::<f64>() / x.len() as f64
}

/// Standard deviation, divided by n, eq. (44).
pub(super) fn deviation(x: &[f64]) -> f64 {
    moment(x, 2).sqrt()
}

/// Largest less smallest.
pub(super) fn range(x: &[f64]) -> f64 {
    largest(x) - x.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The largest.
pub(super) fn largest(x: &[f64]) -> f64 {
    x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The samples in rising order.
pub(super) fn sorted(x: &[f64]) -> Vec<f64> {
    let mut s = x.to_vec();
    s.sort_by(f64::total_cmp);
    s
}

/// Quantile `q` of sorted samples, straight between them.
pub(super) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q * last as f64;
    let i = (at.floor() as usize).min(last);
    let j = (i + 1).min(last);
    sorted[i] + (at - i as f64) * (sorted[j] - sorted[i])
}

/// Median.
pub(super) fn median(x: &[f64]) -> f64 {
    quantile(&sorted(x), 0.5)
}

/// Value at `x0` and slope of the least-squares line through (x, y); NaN for fewer than two places.
pub(super) fn line(x: &[f64], y: &[f64], x0: f64) -> (f64, f64) {
    let n = x.len() as f64;
    let (mx, my) = (mean(x), mean(y));
    let sxx: f64 = x.iter().map(|v| (v - mx) * (v - mx)).sum();
    let sxy: f64 = x.iter().zip(y).map(|(a, b)| (a - mx) * (b - my)).sum();
    if n < 2.0 || sxx <= 0.0 {
        return (f64::NAN, f64::NAN);
    }
    let slope = sxy / sxx;
    (my + slope * (x0 - mx), slope)
}

/// The samples less their least-squares line.
pub(super) fn detrended(x: &[f64]) -> Vec<f64> {
    let at: Vec<f64> = (0..x.len()).map(|i| i as f64).collect();
    let (value, slope) = line(&at, x, 0.0);
    x.iter().zip(&at).map(|(v, t)| v - value - slope * t).collect()
}

/// Steps from sample to sample.
pub(super) fn steps(x: &[f64]) -> Vec<f64> {
    x.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Sign changes of the samples less their line.
pub(super) fn sign_changes(x: &[f64]) -> f64 {
    if x.len() < 2 {
        return f64::NAN;
    }
    detrended(x).windows(2).filter(|w| (w[0] < 0.0) != (w[1] < 0.0)).count() as f64
}

/// Correlation of the samples with themselves `lag` later, both less the mean.
pub(super) fn autocorrelation(x: &[f64], lag: usize) -> f64 {
    if lag >= x.len() {
        return f64::NAN;
    }
    let m = mean(x);
    let sum: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| (a - m) * (b - m)).sum();
    sum / (moment(x, 2) * x.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_forms() {
        let x = [1.0, 2.0, 3.0, 4.0];
        assert_eq!((mean(&x), range(&x), median(&x)), (2.5, 3.0, 2.5));
        // Variance of 1..n divided by n is (n² - 1)/12.
        assert!((deviation(&x) - (15.0f64 / 12.0).sqrt()).abs() < 1e-15);
        assert_eq!(line(&[0.0, 1.0, 2.0], &[1.0, 3.0, 5.0], 4.0), (9.0, 2.0));
        assert!(detrended(&x).iter().all(|v| v.abs() < 1e-15));
        assert_eq!(sign_changes(&[1.0, -1.0, 1.0, -1.0]), 3.0);
    }

    #[test]
    fn of_nothing_there_is_no_number() {
        for f in [mean, rms, deviation, median, sign_changes] {
            assert!(f(&[]).is_nan());
        }
        assert!(!range(&[]).is_finite() && autocorrelation(&[1.0], 1).is_nan() && line(&[1.0], &[1.0], 0.0).1.is_nan());
    }
}
