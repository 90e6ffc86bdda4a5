//! Lines whose phase differs from repeat to repeat: run-out of a spindle without index, mains, fans.
//!
//! In: the open-loop error of every run, noise and all. Out: frequencies, and each run's cosine and sine. A mean over repeats
//! would smear such a line and their spread would count it as noise, so lines are found in what repeats differ by and taken
//! out of every run before anything else is estimated. The directions are closed to all later fits.

use super::chance::log_tail;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::NuisanceBasis;
use crate::diagnose::rules::{LINE_CHANCE, LINE_SNAP, MAINS_MULTIPLES, MAINS_OFF_HZ, ORDER_STANDS_OUT};
use crate::numeric::golden::golden_section;
use crate::numeric::least_squares::dot;
use crate::numeric::spectrum::forward;
use std::f64::consts::TAU;
use std::ops::Range;

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Frequency (Hz).
    pub hz: f64,
    /// Order of the spindle, where it is one.
    pub order: Option<usize>,
    /// Logarithm of the chance that noise alone shows it somewhere in the spectrum.
    pub log_p: f64,
}

/// Most lines that are looked for.
const MOST: usize = 8;
/// Bins on each side over which the noise's level is taken, and those next to the line that are left out.
const LEVEL: [usize; 2] = [40, 4];

impl Line {
    /// Cosine and sine over a run.
    pub fn columns(&self, run: &Run, sample_time_s: f64) -> [Vec<f64>; 2] {
        let angle = |k: usize| match (self.order, &run.spindle_rad) {
            (Some(n), Some(psi)) => n as f64 * psi[k],
            _ => TAU * self.hz * k as f64 * sample_time_s,
        };
        [f64::cos, f64::sin].map(|f| (0..run.len()).map(|k| f(angle(k))).collect())
    }

    /// The line in part of `error`, fitted beside free motions of the body over that part: its cosine and sine.
    pub fn fit(&self, run: &Run, over: Range<usize>, free: &[Vec<f64>], sample_time_s: f64, error: &[f64]) -> [f64; 2] {
        let mut basis = NuisanceBasis::default();
        free.iter().for_each(|c| basis.add_local(0, c.clone()));
        let mut e = error[over.clone()].to_vec();
        basis.project(&mut e);
        let [mut c, mut s] = self.columns(run, sample_time_s).map(|c| c[over.clone()].to_vec());
        basis.project(&mut c);
        basis.project(&mut s);
        let (cc, cs, ss, ce, se) = (dot(&c, &c), dot(&c, &s), dot(&s, &s), dot(&c, &e), dot(&s, &e));
        let det = cc * ss - cs * cs;
        if det > 1e-9 * cc * ss { [(ce * ss - se * cs) / det, (se * cc - ce * cs) / det] } else { [0.0; 2] }
    }
}

/// Power of all series, each times its scale, on one grid of `n` samples, twice the longest: zeros stand behind the shorter ones, and as
/// many again, so that no line falls between two bins.
fn power(series: &[Vec<f64>], n: usize, scales: &[f64]) -> Vec<f64> {
    let mut power = vec![0.0; n / 2];
    for (x, scale) in series.iter().zip(scales) {
        let mut padded = x.clone();
        padded.resize(n, 0.0);
        power.iter_mut().zip(forward(&padded)).for_each(|(p, b)| *p += scale * b.norm_sqr());
    }
    power
}

/// The powers around a bin, in ascending order.
fn around(power: &[f64], k: usize) -> Vec<f64> {
    let near = k.saturating_sub(2 * LEVEL[0])..(k + 2 * LEVEL[0]).min(power.len());
    let mut around: Vec<f64> = near.filter(|j| j.abs_diff(k) > 2 * LEVEL[1] && *j > 2).map(|j| power[j]).collect();
    around.sort_by(f64::total_cmp);
    around
}

/// The strongest line of series that hold noise only and are white but for it; `groups` says whose repeat each is.
///
/// The statistic is the power of all series at one frequency over the level around it: chi-square with two numbers for each
/// repeat beyond the first of its group.
pub fn strongest(series: &[Vec<f64>], groups: &[usize], sample_time_s: f64, spindle_hz: Option<f64>) -> Option<Line> {
    let share = |i: usize| {
        let repeats = groups.iter().filter(|g| **g == groups[i]).count();
        (repeats - 1) as f64 / repeats as f64
    };
    let shares: Vec<f64> = (0..groups.len()).map(share).collect();
    let numbers = (0..groups.len()).map(|i| usize::from(groups[..i].contains(&groups[i])) * 2).sum();
    peak(series, &shares, numbers, sample_time_s, spindle_hz)
}

/// The strongest line of series each of which holds `share` of the noise of its own, `numbers` in all at one frequency.
pub fn peak(
    series: &[Vec<f64>],
    shares: &[f64],
    numbers: usize,
    sample_time_s: f64,
    spindle_hz: Option<f64>,
) -> Option<Line> {
    let longest = series.iter().map(Vec::len).max()?;
    let n = 2 * longest;
    let scale = |(x, share): (&Vec<f64>, &f64)| {
        let variance = dot(x, x) / x.len() as f64;
        share * 2.0 / (x.len() as f64 * variance.max(1e-300))
    };
    let scales: Vec<f64> = series.iter().zip(shares).map(scale).collect();
    let power = power(series, n, &scales);
    if numbers == 0 {
        return None;
    }
    let mean = numbers as f64;
    let level = |k: usize| {
        let around = around(&power, k);
        // The median of chi-square is close to its mean less two thirds.
        around.get(around.len() / 2).copied().unwrap_or(mean) / (1.0 - 2.0 / (9.0 * mean)).powi(3)
    };
    let mut best = (0.0, 0);
    for (k, p) in power.iter().enumerate().skip(5) {
        if *p > best.0 * 0.8 {
            let g = p / level(k) * mean;
            if g > best.0 {
                best = (g, k);
            }
        }
    }
    let (gain, k) = best;
    let log_p = log_tail(gain, numbers) + (power.len() as f64).ln();
    if log_p > LINE_CHANCE.ln() {
        return None;
    }
    let width = 1.0 / (longest as f64 * sample_time_s);
    let at = k as f64 / (n as f64 * sample_time_s);
    let strength = |hz: f64| {
        let w = TAU * hz * sample_time_s;
        series
            .iter()
            .map(|x| {
                let (c, s) = x.iter().enumerate().fold((0.0, 0.0), |(c, s), (k, v)| {
                    let (sin, cos) = (w * k as f64).sin_cos();
                    (c + v * cos, s + v * sin)
                });
                -(c * c + s * s) / x.len() as f64
            })
            .sum::<f64>()
    };
    let hz = golden_section(strength, at - 0.5 * width, at + 0.5 * width, 1e-3 * width).x;
    let order =
        spindle_hz.map(|s| ((hz / s).round(), s)).filter(|(n, s)| *n >= 1.0 && (hz - n * s).abs() < LINE_SNAP * width);
    Some(match order {
        Some((n, s)) => Line { hz: n * s, order: Some(n as usize), log_p },
        None => Line { hz, order: None, log_p },
    })
}

/// Highest order of the spindle that is looked at, and most orders that are closed.
pub const HIGHEST_ORDER: usize = 24;
/// Quantile of the power around an order that it stands out from: a driven record's error may be all lines, and then the order is to stand out
/// from them.
const AROUND: f64 = 0.9;

/// Orders of the spindle that stand out of series, whatever else is in them; strongest first.
pub fn standing_orders(series: &[Vec<f64>], sample_time_s: f64, spindle_hz: Option<f64>) -> Vec<Line> {
    let (Some(longest), Some(spindle)) = (series.iter().map(Vec::len).max(), spindle_hz) else { return Vec::new() };
    let n = 2 * longest;
    let power = power(series, n, &vec![1.0; series.len()]);
    let stands_out = |hz: f64| {
        let k = (hz * n as f64 * sample_time_s).round() as usize;
        let around = around(&power, k);
        let level = around.get((AROUND * around.len() as f64) as usize)?;
        let most = power.get(k.checked_sub(1)?..=k + 1)?.iter().fold(0.0f64, |m, p| m.max(*p));
        Some(most / level).filter(|r| *r > ORDER_STANDS_OUT)
    };
    let orders = (1..=HIGHEST_ORDER).map(|order| (order, order as f64 * spindle));
    let mut found: Vec<(f64, Line)> =
        orders.filter_map(|(order, hz)| Some((stands_out(hz)?, Line { hz, order: Some(order), log_p: 0.0 }))).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MOST);
    found.into_iter().map(|f| f.1).collect()
}

/// A run and its error.
pub type RunError = (usize, Vec<f64>);
/// White series of noise, and the group of repeats that each belongs to.
pub type NoiseSeries = (Vec<Vec<f64>>, Vec<usize>);

/// Finds lines one after the other and takes them out of `errors` (run and its error, free motions of the body still in it);
/// `noise` makes white noise series of them, with their groups.
pub fn take_lines(
    errors: &mut [RunError],
    runs: &[Run],
    free: &dyn Fn(usize) -> Vec<Vec<f64>>,
    sample_time_s: f64,
    spindle_hz: Option<f64>,
    noise: &dyn Fn(&[RunError]) -> NoiseSeries,
) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    while lines.len() < MOST {
        let (series, groups) = noise(errors);
        let Some(line) = strongest(&series, &groups, sample_time_s, spindle_hz) else { break };
        // A line that stays after it was taken out is no line.
        if lines.iter().any(|l| (l.hz - line.hz).abs() < 1e-6 * line.hz) {
            break;
        }
        for (r, e) in errors.iter_mut() {
            let run = &runs[*r];
            let fitted = line.fit(run, 0..run.len(), &free(run.len()), sample_time_s, e);
            for (column, a) in line.columns(run, sample_time_s).iter().zip(fitted) {
                e.iter_mut().zip(column).for_each(|(e, c)| *e -= a * c);
            }
        }
        lines.push(line);
    }
    lines
}

/// Whether the mains may hum at a frequency: a single higher order of the spindle there may be either.
pub(in crate::diagnose) fn mains(hz: f64) -> bool {
    [50.0, 60.0].iter().any(|base| {
        let k = (hz / base).round();
        (1.0..=MAINS_MULTIPLES).contains(&k) && (hz - k * base).abs() < MAINS_OFF_HZ
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    const T: f64 = 1e-4;

    /// White noise with a cosine.
    fn noisy(amplitude: f64, hz: f64, seed: u64) -> Vec<f64> {
        let mut noise = Random::new(seed);
        (0..3000).map(|k| noise.normal() + amplitude * (TAU * hz * f64::from(k) * T).cos()).collect()
    }

    fn found(series: &[Vec<f64>]) -> Vec<Option<usize>> {
        standing_orders(series, T, Some(90.0)).into_iter().map(|l| l.order).collect()
    }

    #[test]
    fn an_order_of_the_spindle_stands_out_of_noise_and_another_line_does_not() {
        let of = |amplitude, hz| (0..4).map(|i| noisy(amplitude, hz, i)).collect::<Vec<_>>();
        assert_eq!(found(&of(0.5, 180.0)), [Some(2)]);
        assert_eq!(found(&of(0.5, 215.0)), []);
        assert_eq!(standing_orders(&of(0.5, 180.0), T, None).len(), 0);
    }

    #[test]
    fn noise_alone_has_no_order_and_one_among_lines_as_strong_as_it_stands_not_out() {
        for seed in 0..40 {
            assert_eq!(found(&[noisy(0.0, 0.0, 2 * seed), noisy(0.0, 0.0, 2 * seed + 1)]), [], "seed {seed}");
        }
        // Every tenth hertz is driven, 90 among them.
        let driven =
            |k: usize| (1..40).map(|h| (TAU * 10.0 * f64::from(h) * k as f64 * T + f64::from(h * h)).cos()).sum();
        assert_eq!(found(&[(0..3000).map(driven).collect()]), []);
    }
}
