//! The PES in time: moments, quantiles, stretches, settling, oscillation.

use super::row::Row;
use crate::numeric::statistics::{
    autocorrelation, detrended, deviation, largest, line, mean, median, moment, quantile, range, rms, sign_changes,
    sorted, steps,
};
use std::f64::consts::TAU;

/// Lags of the autocorrelation (microseconds).
const LAGS_US: [u32; 10] = [100, 200, 300, 500, 750, 1000, 1500, 2000, 3000, 4000];

/// Adds the features in time of the moving record and of its window.
pub(super) fn shape(moving: &[f64], window: &[f64], rate: f64, row: &mut Row) {
    distribution("pes_window", window, row);
    for lag in LAGS_US {
        let samples = (f64::from(lag) * 1e-6 * rate).round();
        // Without a rate there is no lag.
        let value = if samples.is_finite() { autocorrelation(window, samples as usize) } else { f64::NAN };
        row.push(format!("pes_window_autocorrelation_{lag}_us"), value);
    }
    let part = |from: usize, to: usize| moving.get(from..to.min(moving.len())).unwrap_or(&[]);
    let half = 400 + moving.len().saturating_sub(400) / 2;
    let stretches = [
        ("pes_start", part(0, 200)),
        ("pes_writing", window),
        ("pes_middle", part(400, half)),
        ("pes_end", part(half, moving.len())),
    ];
    for (name, x) in stretches {
        stretch(name, x, rate, row);
    }
    for (name, a, b) in [("start_to_writing", 0, 1), ("writing_to_middle", 1, 2), ("middle_to_end", 2, 3)] {
        let ratio = |f: fn(&[f64]) -> f64| 20.0 * (f(stretches[a].1) / f(stretches[b].1)).log10();
        row.push(format!("pes_{name}_rms_db"), ratio(rms));
        row.push(format!("pes_{name}_std_db"), ratio(deviation));
    }
    settling(moving, rate, row);
    oscillation("pes_window", window, rate, row);
    oscillation("pes_move", part(0, 400), rate, row);
}

fn distribution(name: &str, x: &[f64], row: &mut Row) {
    let s = sorted(x);
    let spread = deviation(x);
    let middle = quantile(&s, 0.5);
    let mut put = |what: &str, value: f64| row.push(format!("{name}_{what}"), value);
    put("mean", mean(x));
    put("rms", rms(x));
    put("median", middle);
    put("skewness", moment(x, 3) / spread.powi(3));
    put("kurtosis", moment(x, 4) / spread.powi(4));
    for percent in [0, 5, 25, 75, 95, 100] {
        put(&format!("percentile_{percent}"), quantile(&s, f64::from(percent) / 100.0));
    }
    put("quartile_range", quantile(&s, 0.75) - quantile(&s, 0.25));
    put("median_deviation", median(&x.iter().map(|v| (v - middle).abs()).collect::<Vec<f64>>()).unwrap_or(f64::NAN));
    put("crest", largest(&x.iter().map(|v| v.abs()).collect::<Vec<f64>>()) / rms(x));
}

fn stretch(name: &str, x: &[f64], rate: f64, row: &mut Row) {
    let at: Vec<f64> = (0..x.len()).map(|i| i as f64 / rate).collect();
    let bare = detrended(x);
    let step = steps(x);
    let mut put = |what: &str, value: f64| row.push(format!("{name}_{what}"), value);
    put("mean", mean(x));
    put("std", deviation(x));
    put("range", range(x));
    put("slope_per_s", line(&at, x, 0.0).1);
    put("bare_std", deviation(&bare));
    put("step_std", deviation(&step));
    put("bend_std", deviation(&steps(&step)));
    put("smoothness", deviation(&step) / deviation(x));
    put("crossings_hz", 0.5 * sign_changes(x) * rate / x.len() as f64);
    put(
        "turns_hz",
        0.5 * step.windows(2).filter(|w| (w[0] < 0.0) != (w[1] < 0.0)).count() as f64 * rate / x.len() as f64,
    );
}

/// When the error is largest, and how it comes to the level that it has at the end.
fn settling(x: &[f64], rate: f64, row: &mut Row) {
    let end = mean(x.get(x.len() - x.len() / 5..).unwrap_or(&[]));
    let away: Vec<f64> = x.iter().map(|v| (v - end).abs()).collect();
    let peak = x.iter().map(|v| v.abs()).enumerate().fold((0, f64::NAN), |b, (i, v)| if b.1 >= v { b } else { (i, v) });
    let time = |samples: usize| if x.is_empty() { f64::NAN } else { samples as f64 / rate };
    row.push("pes_largest", peak.1);
    row.push("pes_largest_at_s", time(peak.0));
    row.push("pes_end_level", end);
    row.push("pes_overshoot", peak.1 / end.abs());
    for percent in [50, 20, 10, 5] {
        let limit = f64::from(percent) / 100.0 * end.abs();
        let last = away.iter().rposition(|v| *v > limit).map_or(0, |i| i + 1);
        row.push(format!("pes_settles_to_{percent}_percent_s"), time(last));
    }
    // Slope of ln rms over blocks of 50 samples of the move's first 400: the rate of decay.
    let blocks: Vec<(f64, f64)> = away
        .get(..400)
        .unwrap_or(&[])
        .chunks_exact(50)
        .enumerate()
        .map(|(i, b)| ((i as f64 + 0.5) * 50.0 / rate, rms(b).max(1e-300).ln()))
        .collect();
    let (t, y): (Vec<f64>, Vec<f64>) = blocks.into_iter().unzip();
    row.push("pes_decay_per_s", -line(&t, &y, 0.0).1);
}

/// Frequency and damping of the oscillation: two poles of a linear prediction of block means at about 5 kHz.
fn oscillation(name: &str, x: &[f64], rate: f64, row: &mut Row) {
    // Without a rate the quotient is no number, which becomes 0.
    let block = ((rate / 5000.0).round().clamp(1.0, 1e3) as usize).max(1);
    let coarse: Vec<f64> = detrended(x).chunks_exact(block).map(mean).collect();
    let (mut a11, mut a12, mut a22, mut b1, mut b2) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for w in coarse.windows(3) {
        a11 += w[1] * w[1];
        a12 += w[1] * w[0];
        a22 += w[0] * w[0];
        b1 += w[2] * w[1];
        b2 += w[2] * w[0];
    }
    let det = a11 * a22 - a12 * a12;
    let (p, q) = ((b1 * a22 - b2 * a12) / det, (b2 * a11 - b1 * a12) / det);
    // z² - p z - q: a pair of complex poles has radius sqrt(-q) and the angle of cosine p / (2 radius).
    let radius = (-q).sqrt();
    let angle = (0.5 * p / radius).acos();
    let step_s = block as f64 / rate;
    let (decay, turn) = (-radius.ln() / step_s, angle / step_s);
    row.push(format!("{name}_oscillation_hz"), turn.hypot(decay) / TAU);
    row.push(format!("{name}_oscillation_damping"), decay / turn.hypot(decay));
}
