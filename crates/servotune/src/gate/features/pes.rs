//! Features of the PES: the paper's ten and their kin (window of the DFT), and the clock.
//!
//! In: the record or nothing. Out: named numbers in the PES's own unit, hertz, seconds.

use super::machine::PesRecord;
use super::pes_shape::shape;
use super::pes_spectrum::spectrum;
use super::row::Row;
use crate::numeric::statistics::{deviation, range};
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, WindowDft};

/// Servo samples of the window, first (included) to last (excluded), from the start of the move (section 2.7).
pub(super) const WINDOW: [usize; 2] = [200, 400];
/// Harmonics that are features.
const HARMONICS: usize = 40;

/// Adds the features of a record; all are missing where there is none.
pub(super) fn pes_features(record: Option<&PesRecord>, row: &mut Row) {
    let rate = record.map_or(f64::NAN, PesRecord::rate_hz);
    let moving = record.map_or(&[][..], PesRecord::moving);
    let window = moving.get(WINDOW[0]..WINDOW[1]).unwrap_or(&[]);
    paper(window, rate, row);
    shape(moving, window, rate, row);
    spectrum(moving, window, rate, row);
    clock(record, rate, row);
}

/// Eqs. (40) to (44).
fn paper(window: &[f64], rate: f64, row: &mut Row) {
    let mut amplitude = Vec::new();
    let dft = WindowDft::whole(window.len(), rate);
    let here = !window.is_empty() && rate.is_finite();
    if here {
        dft.amplitudes(window, &mut amplitude);
    }
    let band = |hz| if here { dft.band(&amplitude, hz) } else { f64::NAN };
    row.push("DFT_Euclidean_Low", band(LOW_BAND_HZ));
    row.push("DFT_Euclidean_High", band(HIGH_BAND_HZ));
    row.push("PES_Range", range(window));
    row.push("PES_STD", deviation(window));
    for k in 1..=HARMONICS {
        row.push(format!("Harmonic_{k}"), amplitude.get(k - 1).copied().unwrap_or(f64::NAN));
    }
}

/// What the clock of the record says: a fault of the time base shows here.
fn clock(record: Option<&PesRecord>, rate: f64, row: &mut Row) {
    let time: &[f64] = record.map_or(&[], |r| &r.time_s);
    let ticks: Vec<f64> = time.windows(2).map(|w| (w[1] - w[0]) * rate).collect();
    let or_missing = |x: f64| if ticks.is_empty() { f64::NAN } else { x };
    row.push("pes_rate_hz", rate);
    row.push("pes_samples", or_missing(time.len() as f64));
    row.push("pes_duration_s", time.last().zip(time.first()).map_or(f64::NAN, |(b, a)| b - a));
    row.push("pes_lost_samples", or_missing(ticks.iter().map(|t| (t.round() - 1.0).max(0.0)).sum()));
    // Printed clocks are rounded to some nanoseconds: below a thousandth of a tick there is no jitter.
    let jitter = ticks.iter().map(|t| (t - 1.0).abs()).fold(0.0, f64::max);
    row.push("pes_clock_jitter", or_missing((jitter * 1e3).floor() / 1e3));
}
