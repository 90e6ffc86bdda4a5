//! Intervals and the oracle's power.

/// Chi-square threshold of a search over 30 hypotheses of two figures each at 5 % for all of them together.
pub const THRESHOLD: f64 = 12.79;

/// P(noncentral chi-square with two degrees of freedom > threshold).
pub fn power(lambda: f64) -> f64 {
    let x = THRESHOLD / 2.0;
    // Poisson mixture of central laws with even degrees: tail = exp(-x) sum_{i<=j} x^i/i!.
    let half = lambda / 2.0;
    let (mut weight, mut term, mut tail, mut sum) = ((-half).exp(), (-x).exp(), (-x).exp(), 0.0);
    if half > 300.0 {
        return 1.0;
    }
    for j in 0..2000 {
        sum += weight * tail;
        weight *= half / f64::from(j + 1);
        term *= x / f64::from(j + 1);
        tail += term;
    }
    sum.min(1.0)
}

fn binomial_tail(k: usize, n: usize, p: f64) -> f64 {
    // P(X >= k)
    let mut term = (1.0 - p).powi(n as i32);
    let mut below = 0.0;
    for i in 0..k {
        below += term;
        term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
    }
    1.0 - below
}

/// Clopper-Pearson interval at 95 %.
pub fn interval(k: usize, n: usize) -> (f64, f64) {
    let find = |k: usize, level: f64| {
        let (mut low, mut high) = (0.0, 1.0 - 1e-12);
        for _ in 0..80 {
            let p = (low + high) / 2.0;
            if binomial_tail(k, n, p) < level { low = p } else { high = p }
        }
        (low + high) / 2.0
    };
    let low = if k == 0 { 0.0 } else { find(k, 0.025) };
    let high = if k == n { 1.0 } else { find(k + 1, 0.975) };
    (low, high)
}

pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { None } else { Some((values[(n - 1) / 2] + values[n / 2]) / 2.0) }
}

/// Overlap of two lists of intervals: shared length over joint length.
pub fn overlap(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    let mut edges: Vec<f64> = a.iter().chain(b).flat_map(|x| [x.0, x.1]).collect();
    edges.sort_by(f64::total_cmp);
    let (mut both, mut any) = (0.0, 0.0);
    for w in edges.windows(2) {
        let m = (w[0] + w[1]) / 2.0;
        let inside = |l: &[(f64, f64)]| l.iter().any(|x| x.0 <= m && m <= x.1);
        let (p, q) = (inside(a), inside(b));
        both += if p && q { w[1] - w[0] } else { 0.0 };
        any += if p || q { w[1] - w[0] } else { 0.0 };
    }
    if any > 0.0 { both / any } else { 0.0 }
}
