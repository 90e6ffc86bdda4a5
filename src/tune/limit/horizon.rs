//! The write as far as any controller can touch it: samples from the start of the move to the end of the window.
//!
//! In: a plant as pulse responses, a profile, the feed-forward. Out: the window's DFT as an affine function of the first taps of
//! G = C S, the loop from error to command. On this horizon every causal linear feedback is one vector of taps, stable or not.
//! Convention: index 0 is the last controller sample before anything moves; spec: `specs/performance_limit.md`.

use super::LimitError;
use crate::controller::Feedforward;
use crate::lti::{DiscretePlant, PlantState};
use crate::pes::{Profile, Reference, runout};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A plant as the limit sees it.
#[derive(Clone, Debug)]
pub enum LimitPlant {
    /// An exactly sampled model; positions between controller samples included.
    Sampled(DiscretePlant),
    /// Position at the controller's samples after a command of 1 at sample 0, held for one; entry 0 is sample 0.
    /// Only for a servo clock that is the controller's. `integrators`: poles on z = 1.
    Pulse {
        /// The response, long enough for the whole write.
        response: Vec<f64>,
        /// Poles at rest.
        integrators: usize,
    },
}

/// Everything that does not depend on the controller.
#[derive(Clone, Debug)]
pub(super) struct Horizon {
    /// Controller samples from the start of the move to the end of the window, which are the taps that count.
    pub taps: usize,
    /// Samples from the start of the record to index 0: noise of that time reaches the window too.
    pub ahead: usize,
    /// Pulse response of the plant at controller samples, `ahead + 2 taps` long.
    pub plant: Vec<f64>,
    /// The same times the shaping of the taps, squared.
    pub shaped_plant: Vec<f64>,
    /// Target of the loop, r - P F r, from index 0.
    pub target: Vec<f64>,
    /// Feed-forward command, from index 0.
    pub forward: Vec<f64>,
    /// Bins, ascending, and for each the rows below.
    pub bins: Vec<Bin>,
    /// Shaping of the taps: G = d² Q with d = ((1 - z⁻¹)/(1 - pole z⁻¹))^integrators.
    pub shaping: Shaping,
    pub encoder: f64,
    /// Standard deviation of the windage's innovation.
    pub windage: f64,
    /// How much of the windage is left after one sample.
    pub keep: f64,
}

/// One bin of the window's DFT.
#[derive(Clone, Debug)]
pub(super) struct Bin {
    pub k: usize,
    pub hz: f64,
    /// DFT of r + run-out - P F r.
    pub still: Complex<f64>,
    /// Sensitivity of the bin to a pulse of the position's driver `shaped command` at sample index - ahead.
    pub command: Vec<Complex<f64>>,
    /// The same for an unshaped pulse of the command.
    pub input: Vec<Complex<f64>>,
}

/// Poles that take the place of integrators, so that taps stay small.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaping {
    pub pole: f64,
    pub order: usize,
}

/// Pole of the shaping: about 900 Hz at 25 kHz, near where such loops cross.
const SHAPING_POLE: f64 = 0.8;

impl Shaping {
    /// d² applied to a signal from rest, in place.
    pub fn apply(&self, x: &mut [f64]) {
        for _ in 0..2 * self.order {
            let (mut before, mut out) = (0.0, 0.0);
            for x in x.iter_mut() {
                out = *x - before + self.pole * out;
                before = *x;
                *x = out;
            }
        }
    }
}

impl Horizon {
    /// `harmonics`: bins wanted beside those of both bands.
    pub fn of(
        plant: &LimitPlant,
        sample_time_s: f64,
        feedforward: Option<&Feedforward>,
        profile: &Profile,
        harmonics: &[usize],
    ) -> Result<Horizon, LimitError> {
        profile.check().map_err(crate::pes::PesError::from)?;
        let (t, rate) = (sample_time_s, profile.pes.sample_rate_hz);
        let from = profile.first_servo_sample() + profile.pes.window[0];
        let to = profile.first_servo_sample() + profile.pes.window[1];
        let n = to - from;
        let reference = Reference::of(&profile.spiral);
        // Controller sample and time since it, for every servo sample of the window; as the simulation rounds them.
        let servo: Vec<(usize, f64)> = (from..to)
            .map(|j| {
                let at = j as f64 / rate;
                let k = (at / t).floor();
                let offset = at - k * t;
                if offset > t * (1.0 - 1e-9) { (k as usize + 1, 0.0) } else { (k as usize, offset.max(0.0)) }
            })
            .collect();
        let last = servo[n - 1].0;
        let ahead = (((profile.spiral.start_s / t).floor() as usize).saturating_sub(1)).min(last);
        let taps = last - ahead + 1;
        if taps > MOST_TAPS {
            return Err(LimitError::Horizon { taps, limit: MOST_TAPS });
        }
        let length = ahead + taps;
        let (plant_pulse, readings, integrators) = pulses(plant, t, [length, length + taps], &servo)?;
        let shaping = Shaping { pole: SHAPING_POLE, order: integrators };
        let mut shaped_plant = plant_pulse.clone();
        shaping.apply(&mut shaped_plant);
        let at = |k: usize, i: f64| reference.at(((ahead + k) as f64 + i) * t);
        let forward: Vec<f64> = (0..taps)
            .map(|k| {
                let (a, b, c) = (at(k, -1.0), at(k, 0.0), at(k, 1.0));
                feedforward.map_or(0.0, |f| {
                    f.factor * (f.velocity_s * (c - a) / (2.0 * t) + f.acceleration_s2 * (c - 2.0 * b + a) / (t * t))
                })
            })
            .collect();
        let moved = |k: usize| (0..=k).map(|j| forward[j] * plant_pulse[k - j]).sum::<f64>();
        let target = (0..taps).map(|k| at(k, 0.0) - moved(k)).collect();
        let still: Vec<f64> = (0..n)
            .map(|i| {
                let time = (from + i) as f64 / rate;
                let k = servo[i].0 - ahead;
                let pushed: f64 = (0..=k).map(|j| forward[j] * readings[i][k - j]).sum();
                reference.at(time) + runout(&profile.noise, time) - pushed
            })
            .collect();
        let shaped: Vec<Vec<f64>> = readings
            .iter()
            .map(|r| {
                let mut r = r.clone();
                shaping.apply(&mut r);
                r
            })
            .collect();
        let bins = crate::tune::machine::bins(profile, harmonics)
            .into_iter()
            .map(|k| {
                let turn: Vec<Complex<f64>> = (0..n)
                    .map(|i| Complex::from_polar(1.0 / n as f64, -TAU * ((k * i) % n) as f64 / n as f64))
                    .collect();
                let spread = |rows: &[Vec<f64>]| {
                    let mut sum = vec![Complex::new(0.0, 0.0); length];
                    for ((turn, row), (at, _)) in turn.iter().zip(rows).zip(&servo) {
                        // A pulse at absolute sample s reaches this servo sample after `at - s` samples.
                        for (s, sum) in sum[..=*at].iter_mut().enumerate() {
                            *sum += turn * row[at - s];
                        }
                    }
                    sum
                };
                Bin {
                    k,
                    hz: k as f64 * rate / n as f64,
                    still: turn.iter().zip(&still).map(|(e, x)| e * x).sum(),
                    command: spread(&shaped),
                    input: spread(&readings),
                }
            })
            .collect();
        let keep = (-TAU * profile.noise.windage_corner_hz * t).exp();
        Ok(Horizon {
            taps,
            ahead,
            plant: plant_pulse,
            shaped_plant,
            target,
            forward,
            bins,
            shaping,
            encoder: profile.noise.encoder_rms,
            windage: profile.noise.windage_rms * (1.0 - keep * keep).sqrt(),
            keep,
        })
    }
}

/// Longest horizon: the programme grows with its square.
const MOST_TAPS: usize = 1200;

type Pulses = (Vec<f64>, Vec<Vec<f64>>, usize);

/// Position at controller samples and at every servo sample's offset, after a pulse of the command at sample 0.
fn pulses(
    plant: &LimitPlant,
    t: f64,
    [length, long]: [usize; 2],
    servo: &[(usize, f64)],
) -> Result<Pulses, LimitError> {
    match plant {
        LimitPlant::Sampled(p) => {
            let readings: Vec<_> = servo.iter().map(|(_, offset)| p.intersample(*offset)).collect();
            let mut rows = vec![vec![0.0; length]; servo.len()];
            let mut at_samples = Vec::with_capacity(long);
            let mut state = PlantState::at_rest(p);
            for l in 0..long {
                at_samples.push(state.position());
                state.command(if l == 0 { 1.0 } else { 0.0 });
                if l < length {
                    for (row, reading) in rows.iter_mut().zip(&readings) {
                        row[l] = state.between(reading);
                    }
                }
                state.advance(p);
            }
            Ok((at_samples, rows, p.integrators()))
        }
        LimitPlant::Pulse { response, integrators } => {
            if response.len() < long {
                return Err(LimitError::PulseLength { found: response.len(), expected: long });
            }
            if let Some((_, offset)) = servo.iter().find(|(_, offset)| *offset > 1e-6 * t) {
                return Err(LimitError::ServoClock { offset_s: *offset });
            }
            Ok((response[..long].to_vec(), vec![response[..length].to_vec(); servo.len()], *integrators))
        }
    }
}
