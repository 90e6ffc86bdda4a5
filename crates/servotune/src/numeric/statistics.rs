//! Plain statistics of samples, the only ones of the program. Of nothing, or of too little, they are NaN, a median none, unless said otherwise.

/// Mean.
pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// Root mean square.
pub fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}

/// Root mean square of values that come one by one, in several series or not; 0 of none.
pub fn rms_of(x: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = x.into_iter().fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}

/// Central moment of order `order`, divided by n.
pub fn moment(x: &[f64], order: i32) -> f64 {
    let m = mean(x);
    x.iter().map(|v| (v - m).powi(order)).sum::<f64>() / x.len() as f64
}

/// Standard deviation, divided by n, eq. (44).
pub fn deviation(x: &[f64]) -> f64 {
    moment(x, 2).sqrt()
}

/// Largest less smallest.
pub fn range(x: &[f64]) -> f64 {
    largest(x) - x.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The largest.
pub fn largest(x: &[f64]) -> f64 {
    x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The samples in rising order.
pub fn sorted(x: &[f64]) -> Vec<f64> {
    let mut s = x.to_vec();
    s.sort_by(f64::total_cmp);
    s
}

/// Quantile `q` of sorted samples, straight between them at place q (n - 1) (type 7 of Hyndman and Fan, The American Statistician 50, 1996).
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    at_place(sorted, q * sorted.len().saturating_sub(1) as f64)
}

/// Quantile `q` of sorted draws at place q (n + 1), as unbiased ranges of future draws need it (type 6 of Hyndman and Fan).
pub fn quantile_of_draws(sorted: &[f64], q: f64) -> f64 {
    at_place(sorted, q * (sorted.len() + 1) as f64 - 1.0)
}

/// The value below which the share `q` lies (nearest rank).
pub fn nearest_rank(x: &[f64], q: f64) -> f64 {
    let rank = (q * x.len() as f64).ceil() as usize;
    sorted(x).get(rank.max(1) - 1).copied().unwrap_or(f64::NAN)
}

/// Sorted samples between two of them.
fn at_place(sorted: &[f64], place: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = place.clamp(0.0, last as f64);
    let i = (place.floor() as usize).min(last);
    let j = (i + 1).min(last);
    sorted[i] + (place - i as f64) * (sorted[j] - sorted[i])
}

/// The middle value, the mean of the two middle ones where their number is even.
pub fn median(x: &[f64]) -> Option<f64> {
    let s = sorted(x);
    let n = s.len();
    (n > 0).then(|| 0.5 * s[(n - 1) / 2] + 0.5 * s[n / 2])
}

/// Value at `x0` and slope of the least-squares line through (x, y); NaN for fewer than two places.
pub fn line(x: &[f64], y: &[f64], x0: f64) -> (f64, f64) {
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
pub fn detrended(x: &[f64]) -> Vec<f64> {
    let at: Vec<f64> = (0..x.len()).map(|i| i as f64).collect();
    let (value, slope) = line(&at, x, 0.0);
    x.iter().zip(&at).map(|(v, t)| v - value - slope * t).collect()
}

/// Steps from sample to sample.
pub fn steps(x: &[f64]) -> Vec<f64> {
    x.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Sign changes of the samples less their line.
pub fn sign_changes(x: &[f64]) -> f64 {
    if x.len() < 2 {
        return f64::NAN;
    }
    detrended(x).windows(2).filter(|w| (w[0] < 0.0) != (w[1] < 0.0)).count() as f64
}

/// Correlation of the samples with themselves `lag` later, both less the mean.
pub fn autocorrelation(x: &[f64], lag: usize) -> f64 {
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
        assert_eq!((mean(&x), range(&x), median(&x), median(&x[..3])), (2.5, 3.0, Some(2.5), Some(2.0)));
        // A quarter of the way between the first and the fourth place; the first of four draws has a fifth of all below it.
        assert_eq!((quantile(&x, 0.25), quantile_of_draws(&x, 0.2)), (1.75, 1.0));
        // Variance of 1..n divided by n is (n² - 1)/12.
        assert!((deviation(&x) - (15.0f64 / 12.0).sqrt()).abs() < 1e-15);
        assert_eq!(line(&[0.0, 1.0, 2.0], &[1.0, 3.0, 5.0], 4.0), (9.0, 2.0));
        assert!(detrended(&x).iter().all(|v| v.abs() < 1e-15));
        assert_eq!(sign_changes(&[1.0, -1.0, 1.0, -1.0]), 3.0);
    }

    #[test]
    fn of_nothing_there_is_no_number() {
        assert_eq!(median(&[]), None);
        assert_eq!((rms_of([]), rms_of([3.0, -4.0, 5.0, 0.0])), (0.0, 12.5f64.sqrt()));
        for f in [mean, rms, deviation, sign_changes] {
            assert!(f(&[]).is_nan());
        }
        assert!(!range(&[]).is_finite() && autocorrelation(&[1.0], 1).is_nan() && line(&[1.0], &[1.0], 0.0).1.is_nan());
    }
}
