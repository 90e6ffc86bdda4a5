//! The PES over frequency: bands of the whole record and of the window, centre, spread, flatness, spindle lines.

use super::row::Row;
use crate::numeric::spectrum::forward;
use crate::numeric::statistics::detrended;
use std::f64::consts::TAU;

/// Edges of the bands (Hz).
const EDGES: [u32; 15] = [0, 100, 200, 400, 600, 800, 1000, 1250, 1500, 2000, 3000, 4000, 6000, 8000, 12000];
/// The same for the window, whose 200 samples have no bin below 137 Hz at the paper's servo rate.
const WINDOW_EDGES: [u32; 14] = [0, 200, 400, 600, 800, 1000, 1250, 1500, 2000, 3000, 4000, 6000, 8000, 12000];
/// Multiples of half the paper's spindle speed of 120 Hz, and the mains (Hz).
const LINES: [u32; 6] = [50, 60, 100, 120, 240, 360];

/// Adds the features over frequency of the moving record and of its window.
pub(super) fn spectrum(moving: &[f64], window: &[f64], rate: f64, row: &mut Row) {
    describe("pes", moving, rate, &EDGES, row);
    describe("pes_window", window, rate, &WINDOW_EDGES, row);
    let bare = detrended(moving);
    for hz in LINES {
        row.push(format!("pes_line_{hz}_hz"), line(&bare, f64::from(hz), rate));
    }
}

/// Amplitude of one line: the sum of eq. (40) at a frequency between bins.
fn line(x: &[f64], hz: f64, rate: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (i, v) in x.iter().enumerate() {
        let (s, c) = (TAU * hz * i as f64 / rate).sin_cos();
        re += v * c;
        im += v * s;
    }
    re.hypot(im) / x.len() as f64
}

/// Power of the samples less their line, by Hann's window, so that slow motion does not leak into every band.
fn describe(name: &str, x: &[f64], rate: f64, edges: &[u32], row: &mut Row) {
    let n = x.len();
    let tapered: Vec<f64> = detrended(x)
        .iter()
        .enumerate()
        .map(|(i, v)| v * (1.0 - (TAU * (i as f64 + 0.5) / n as f64).cos()) * (2.0f64 / 3.0).sqrt())
        .collect();
    // The mean square of the taper is 1: powers add up to the variance.
    let power: Vec<f64> =
        forward(&tapered).iter().take(n / 2 + 1).skip(1).map(|b| 2.0 * b.norm_sqr() / (n * n) as f64).collect();
    let hz = |i: usize| (i + 1) as f64 * rate / n as f64;
    let total: f64 = power.iter().sum();
    let here = n >= 16 && rate.is_finite() && total > 0.0;
    let mut put = |what: String, value: f64| row.push(format!("{name}_{what}"), if here { value } else { f64::NAN });
    for edge in edges.windows(2) {
        let (low, high) = (f64::from(edge[0]), f64::from(edge[1]));
        let bins = || power.iter().enumerate().filter(|(i, _)| hz(*i) > low && hz(*i) <= high);
        // A band beyond half the servo rate, or narrower than a bin, is not seen.
        let sum: f64 = bins().map(|(_, p)| p).sum();
        let value = if bins().next().is_some() { sum.sqrt() } else { f64::NAN };
        put(format!("band_{}_{}_hz", edge[0], edge[1]), value);
    }
    let centre = power.iter().enumerate().map(|(i, p)| p * hz(i)).sum::<f64>() / total;
    let spread = (power.iter().enumerate().map(|(i, p)| p * (hz(i) - centre).powi(2)).sum::<f64>() / total).sqrt();
    put("centre_hz".into(), centre);
    put("spread_hz".into(), spread);
    for percent in [50, 85, 95] {
        let wanted = total * f64::from(percent) / 100.0;
        let mut sum = 0.0;
        let at = power.iter().position(|p| {
            sum += p;
            sum >= wanted
        });
        put(format!("rolloff_{percent}_hz"), at.map_or(f64::NAN, hz));
    }
    let log_mean = power.iter().map(|p| p.max(1e-300).ln()).sum::<f64>() / power.len() as f64;
    put("flatness_db".into(), 10.0 * (log_mean.exp() / (total / power.len() as f64)).log10());
    let above = |low: f64| power.iter().enumerate().filter(|(i, _)| hz(*i) > low).map(|(_, p)| p).sum::<f64>();
    put("high_share_db".into(), 10.0 * (above(3000.0) / total).log10());
    let strongest =
        power.iter().enumerate().filter(|(i, _)| hz(*i) >= 300.0).max_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| hz(i));
    put("strongest_above_300_hz".into(), strongest.unwrap_or(f64::NAN));
}
