//! Long records of a slow motion, every so many samples: a machine that moves at 1 Hz is known as well at 100 samples a second as at 1000.
//!
//! In: all runs of a case in open loop, and the plant. Out: how many samples become one; the runs so thinned. The command over each new sample is the
//! mean of what was held over it: the same impulse on the arm. Positions are read by a cubic through those around each new sample.

use super::run::Run;
use crate::lti::Plant;
use crate::numeric::spectrum::forward;
use crate::numeric::statistics::{mean, median};
use crate::recording::Role;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Samples to fit from which records are thinned, and to which they may be thinned together.
const LONG: usize = 30_000;
const TOGETHER: usize = 10_000;
/// Fewest that are worth it, and shortest record (samples) that a spectrum and a thinned motion can be had of.
const LEAST: f64 = 3.0;
const SHORTEST: usize = 256;
/// New samples to a period of the fastest motion or mode.
const A_PERIOD: f64 = 5.0;
/// Share of the motion's power, white noise aside, that may lie above the fastest motion; share of the command's that may be averaged away.
const ABOVE: f64 = 1e-6;
const AVERAGED: f64 = 0.01;

/// Power over frequency of a series behind a Hann window, from 0 to half the sample rate.
fn power(series: &[f64]) -> Vec<f64> {
    let n = series.len();
    let middle = mean(series);
    let window = |k: usize| (PI * (k as f64 + 0.5) / n as f64).sin().powi(2);
    let shaped: Vec<f64> = series.iter().enumerate().map(|(k, v)| (v - middle) * window(k)).collect();
    forward(&shaped)[1..n / 2].iter().map(Complex::norm_sqr).collect()
}

/// The bin above which a share of the power lies at most, white noise aside.
fn top(power: &[f64], share: f64) -> usize {
    // The upper half is noise where a record is sampled fast; the median of an exponential distribution is ln 2 of its mean.
    let white = median(&power[power.len() / 2..]).unwrap_or(0.0) / std::f64::consts::LN_2;
    let may = share * power.iter().sum::<f64>();
    let mut above = 0.0;
    let reaches = power.iter().rposition(|p| {
        above += p - white;
        above > may
    });
    reaches.map_or(0, |i| i + 1)
}

/// Samples, not always a whole number of them, that become one without a loss to the motion; none where they had better stay.
pub(in crate::diagnose) fn thinning(runs: &[Run], plant: &Plant, sample_time_s: f64) -> Option<f64> {
    let fit = || runs.iter().filter(|r| r.role == Role::Fit);
    let fitted: usize = fit().map(Run::len).sum();
    if fitted < LONG || runs.iter().any(|r| r.len() < SHORTEST) {
        return None;
    }
    let modes = plant.modes.iter().flat_map(|m| [m.pole_rad_s, m.zero_rad_s]).fold(0.0, f64::max) / TAU;
    let fastest = |r: &Run| {
        let bin = 1.0 / (r.len() as f64 * sample_time_s);
        let [moves, driven] = [&r.position, &r.input].map(|x| power(x));
        let rate = A_PERIOD * bin * top(&moves, ABOVE) as f64;
        // Half of a new rate is the highest frequency that it holds.
        rate.max(2.0 * bin * top(&driven, AVERAGED) as f64)
    };
    let rate = runs.iter().map(fastest).fold(A_PERIOD * modes, f64::max);
    let samples = (1.0 / (sample_time_s * rate)).min(fitted as f64 / TOGETHER as f64);
    // A lap stays a whole number of samples.
    let whole = |lap: usize| lap as f64 / (lap as f64 / samples).ceil();
    let samples = fit().find_map(Run::lap).map_or(samples, whole);
    (samples >= LEAST).then_some(samples)
}

/// The mean of a value that is held from sample to sample over every new sample.
fn held(series: &[f64], samples: f64) -> Vec<f64> {
    let mut sums = Vec::with_capacity(series.len() + 1);
    sums.push(0.0);
    series.iter().for_each(|v| sums.push(sums[sums.len() - 1] + v));
    let upto = |s: f64| {
        let k = (s as usize).min(series.len() - 1);
        sums[k] + (s - k as f64) * series[k]
    };
    (0..count(series, samples)).map(|k| (upto((k + 1) as f64 * samples) - upto(k as f64 * samples)) / samples).collect()
}

/// The value at every new sample, by the cubic through the four readings around it.
fn read(series: &[f64], samples: f64) -> Vec<f64> {
    let one = |k: usize| {
        let s = k as f64 * samples;
        let from = (s as usize).clamp(1, series.len() - 3) - 1;
        let at = s - from as f64;
        let weight =
            |i: usize| (0..4).filter(|&j| j != i).map(|j| (at - j as f64) / (i as f64 - j as f64)).product::<f64>();
        (0..4).map(|i| weight(i) * series[from + i]).sum()
    };
    (0..count(series, samples)).map(one).collect()
}

/// New samples of a series.
fn count(series: &[f64], samples: f64) -> usize {
    (series.len() as f64 / samples + 1e-9) as usize
}

impl Run {
    /// So many samples as one.
    pub(in crate::diagnose) fn thinned(&self, samples: f64) -> Run {
        let [held, read] = [held, read].map(|f| move |x: &Vec<f64>| f(x, samples));
        let may = |x: &Option<Vec<f64>>| x.as_ref().map(read);
        Run {
            reference: may(&self.reference),
            command: held(&self.command),
            excitation: held(&self.excitation),
            input: held(&self.input),
            position: read(&self.position),
            // Readings between servo samples are none of a machine in open loop.
            pes: None,
            spindle_rad: may(&self.spindle_rad),
            temperature: may(&self.temperature),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::diagnose::data::run::tests::run_at;

    fn waves(hz: &[f64], rate: f64, n: usize) -> Vec<f64> {
        (0..n).map(|k| hz.iter().map(|f| (TAU * f * k as f64 / rate).sin()).sum()).collect()
    }

    #[test]
    fn a_mean_of_what_is_held_keeps_the_impulse_and_a_reading_lies_on_the_wave() {
        let u: Vec<f64> = (0..1000).map(|k| f64::from(k * k % 17)).collect();
        let (few, samples) = (held(&u, 6.4), 6.4);
        assert_eq!(few.len(), 156);
        let whole: f64 = u[..998].iter().sum::<f64>() + 0.4 * u[998];
        assert!((few.iter().sum::<f64>() * samples - whole).abs() < 1e-9);
        let wave = waves(&[1.0], 100.0, 1000);
        for (k, v) in read(&wave, samples).into_iter().enumerate() {
            assert!((v - (TAU * 0.01 * k as f64 * samples).sin()).abs() < 1e-5, "{k}: {v}");
        }
    }

    #[test]
    fn only_what_moves_slowly_is_thinned_and_as_fast_as_its_fastest_wave() {
        let plant = crate::lti::Plant {
            position_unit: "mm".into(),
            command_unit: "V".into(),
            body: crate::lti::Body::FreeInertia { acceleration_gain: 1.0, viscous_rate_per_s: 1.0 },
            delay_s: 0.0,
            resonance_gain: 1.0,
            modes: vec![],
            physics: vec![],
        };
        let of = |hz: &[f64], n: usize| {
            let run = Run { input: waves(&[1.0], 1000.0, n), ..run_at(waves(hz, 1000.0, n)) };
            thinning(&[run], &plant, 1e-3)
        };
        let slow = of(&[1.0, 12.5], 100_000).unwrap();
        assert!((slow - 100_000.0 / 10_000.0).abs() < 1e-9, "{slow}");
        let faster = of(&[1.0, 40.0], 100_000).unwrap();
        assert!((faster - 1000.0 / (A_PERIOD * 40.0)).abs() < 0.02, "{faster}");
        assert_eq!((of(&[1.0, 200.0], 100_000), of(&[1.0], 20_000)), (None, None));
        // One long record beside a held-out one of three samples.
        let long = Run { input: waves(&[1.0], 1000.0, 100_000), ..run_at(waves(&[1.0], 1000.0, 100_000)) };
        assert_eq!(thinning(&[long, run_at(vec![0.0, 1.0, 0.0])], &plant, 1e-3), None);
    }
}
