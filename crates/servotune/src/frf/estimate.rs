//! A response with its uncertainty from time records.
//!
//! In: input and output samples at one rate. Out: H1 response, relative standard deviation, coherence.
//! Sources: Pintelon and Schoukens, System Identification (periodic averages); Bendat and Piersol, Random Data (H1, coherence). Spec: `specs/frf.md`.

use super::error::FrfError;
use super::response::Frf;
use crate::numeric::spectrum::forward;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// A response estimated from records.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedResponse {
    /// The response with the relative standard deviation of each value.
    pub frf: Frf,
    /// Share of the output power that is linear in the input at each point, 0 to 1.
    pub coherence: Vec<f64>,
    /// Periods or segments that were averaged.
    pub averaged: usize,
}

/// How to average a periodic record.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicSettings {
    /// Samples in one period.
    pub period: usize,
    /// Periods at the start that still carry the transient and are left out.
    pub discard: usize,
    /// Excited lines (multiples of 1 / (period * sample time)); `None` takes all whose input stands out.
    pub lines: Option<Vec<usize>>,
    /// With `lines` left open: least input amplitude of a line, relative to the largest.
    pub least_amplitude: f64,
}

impl Default for PeriodicSettings {
    fn default() -> Self {
        PeriodicSettings { period: 0, discard: 1, lines: None, least_amplitude: 0.05 }
    }
}

/// How to average a record without a period: Hann windows, half overlapping.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentSettings {
    /// Samples in one segment; its inverse times the rate is the resolution.
    pub segment: usize,
    /// Lowest and highest frequency of the result (Hz).
    pub band_hz: (f64, f64),
}

impl Default for SegmentSettings {
    fn default() -> Self {
        SegmentSettings { segment: 4096, band_hz: (0.0, f64::INFINITY) }
    }
}

/// The sums of one line over periods or segments.
#[derive(Clone, Copy, Default)]
struct Sums {
    uu: f64,
    yy: f64,
    yu: Complex<f64>,
}

/// The response at the excited lines of a periodic record: mean output over mean input, period by period.
///
/// The standard deviation comes from the scatter of (output - response * input) over the periods, divided by their number; it needs two.
/// The coherence is that of the single periods.
pub fn periodic(
    input: &[f64],
    output: &[f64],
    sample_time_s: f64,
    settings: &PeriodicSettings,
) -> Result<EstimatedResponse, FrfError> {
    check(input, output, sample_time_s)?;
    let n = settings.period;
    if n < 4 {
        return Err(FrfError::Setting { name: "period", found: n as f64, expected: "at least 4 samples" });
    }
    let found = (input.len() / n).saturating_sub(settings.discard);
    if found < 2 {
        return Err(FrfError::RecordShort { unit: "periods", found, discarded: settings.discard, needed: 2 });
    }
    let bins = |record: &[f64]| -> Vec<Vec<Complex<f64>>> {
        record.chunks_exact(n).skip(settings.discard).map(forward).collect()
    };
    let (u, y) = (bins(input), bins(output));
    let mean = |all: &[Vec<Complex<f64>>], k: usize| all.iter().map(|b| b[k]).sum::<Complex<f64>>() / found as f64;
    let half = n.div_ceil(2);
    let largest = (1..half).map(|k| mean(&u, k).norm()).fold(0.0, f64::max);
    let lines = match &settings.lines {
        Some(lines) => {
            if let Some(k) = lines.iter().find(|k| !(1..half).contains(*k)) {
                return Err(FrfError::Setting {
                    name: "line",
                    found: *k as f64,
                    expected: "1 to less than half the period",
                });
            }
            let mut lines = lines.clone();
            lines.sort_unstable();
            lines.dedup();
            lines
        }
        None => {
            (1..half).filter(|&k| largest > 0.0 && mean(&u, k).norm() >= settings.least_amplitude * largest).collect()
        }
    };
    let step_hz = 1.0 / (n as f64 * sample_time_s);
    let mut parts = Parts::default();
    for &k in &lines {
        let (mu, my) = (mean(&u, k), mean(&y, k));
        if mu.norm() <= 1e-9 * largest {
            return Err(FrfError::NotExcited { line_hz: k as f64 * step_hz });
        }
        let g = my / mu;
        let scatter: f64 =
            u.iter().zip(&y).map(|(u, y)| (y[k] - g * u[k]).norm_sqr()).sum::<f64>() / (found - 1) as f64;
        let mut sums = Sums::default();
        u.iter().zip(&y).for_each(|(u, y)| sums.add(u[k], y[k]));
        parts.push(k as f64 * step_hz, g, (scatter / found as f64).sqrt() / my.norm(), sums.coherence());
    }
    parts.finish(found)
}

/// The H1 response of a record without a period: cross spectrum over input spectrum, Hann windows, half overlapping.
///
/// The standard deviation is sqrt((1 - c) / (2 c m)) with coherence c and m effective segments (Bendat and Piersol), m taken as the
/// number of segments that do not overlap; it knows noise only, no leakage.
pub fn segments(
    input: &[f64],
    output: &[f64],
    sample_time_s: f64,
    settings: &SegmentSettings,
) -> Result<EstimatedResponse, FrfError> {
    check(input, output, sample_time_s)?;
    let n = settings.segment;
    if n < 8 {
        return Err(FrfError::Setting { name: "segment", found: n as f64, expected: "at least 8 samples" });
    }
    let apart = input.len() / n;
    if apart < 2 {
        return Err(FrfError::RecordShort { unit: "segments", found: apart, discarded: 0, needed: 2 });
    }
    let window: Vec<f64> = (0..n).map(|i| (PI * i as f64 / n as f64).sin().powi(2)).collect();
    let windowed = |record: &[f64]| -> Vec<Complex<f64>> {
        let mean = record.iter().sum::<f64>() / n as f64;
        forward(&record.iter().zip(&window).map(|(x, w)| (x - mean) * w).collect::<Vec<f64>>())
    };
    let mut sums = vec![Sums::default(); n.div_ceil(2)];
    let hop = n / 2;
    let count = (input.len() - n) / hop + 1;
    for s in 0..count {
        let part = s * hop..s * hop + n;
        let (u, y) = (windowed(&input[part.clone()]), windowed(&output[part]));
        sums.iter_mut().zip(u.iter().zip(&y)).for_each(|(sum, (u, y))| sum.add(*u, *y));
    }
    let step_hz = 1.0 / (n as f64 * sample_time_s);
    let largest = sums.iter().map(|s| s.uu).fold(0.0, f64::max);
    let mut parts = Parts::default();
    // Line 1 shares the window's main lobe with the mean that was taken off.
    for (k, sum) in sums.iter().enumerate().skip(2) {
        let hz = k as f64 * step_hz;
        if hz < settings.band_hz.0 || hz > settings.band_hz.1 {
            continue;
        }
        if sum.uu <= 1e-18 * largest {
            return Err(FrfError::NotExcited { line_hz: hz });
        }
        let c = sum.coherence();
        // No coherence, no knowledge: the deviation is then as large as a double holds with sense.
        let std = ((1.0 - c) / (2.0 * c.max(1e-12) * apart as f64)).sqrt();
        parts.push(hz, sum.yu / sum.uu, std, c);
    }
    parts.finish(count)
}

impl Sums {
    fn add(&mut self, u: Complex<f64>, y: Complex<f64>) {
        self.uu += u.norm_sqr();
        self.yy += y.norm_sqr();
        self.yu += y * u.conj();
    }
    fn coherence(&self) -> f64 {
        let power = self.uu * self.yy;
        if power > 0.0 { (self.yu.norm_sqr() / power).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The columns of a result.
#[derive(Default)]
struct Parts {
    w: Vec<f64>,
    value: Vec<Complex<f64>>,
    std: Vec<f64>,
    coherence: Vec<f64>,
}

impl Parts {
    fn push(&mut self, hz: f64, value: Complex<f64>, std: f64, coherence: f64) {
        self.w.push(hz * TAU);
        self.value.push(value);
        self.std.push(std);
        self.coherence.push(coherence);
    }
    fn finish(self, averaged: usize) -> Result<EstimatedResponse, FrfError> {
        let shape = |source| FrfError::Shape { file: "record".to_owned(), source };
        let frf = Frf::new(self.w, self.value, Some(self.std)).map_err(shape)?;
        Ok(EstimatedResponse { frf, coherence: self.coherence, averaged })
    }
}

fn check(input: &[f64], output: &[f64], sample_time_s: f64) -> Result<(), FrfError> {
    if input.len() != output.len() {
        return Err(FrfError::RecordLength { input: input.len(), output: output.len() });
    }
    for (record, samples) in [("input", input), ("output", output)] {
        if let Some(sample) = samples.iter().position(|x| !x.is_finite()) {
            return Err(FrfError::RecordSample { record, sample });
        }
    }
    if !(sample_time_s.is_finite() && sample_time_s > 0.0) {
        return Err(FrfError::SampleTime { found_s: sample_time_s });
    }
    Ok(())
}
