//! What the factory measures of a machine: swept sine, PES of a write, feed-forward of the warm-up, log.
//!
//! In: a [`Truth`] and its random stream. Out: a [`LineMachine`].

use super::{LineMachine, Truth, log};
use crate::controller::Feedforward;
use crate::gate::features::{PesRecord, RawMachine};
use crate::lti::{Body, DiscretePlant};
use crate::numeric::random::Random;
use crate::pes::{Noise, WriteScene};
use crate::twin::plants::{log_grid, measure};
use crate::twin::{MachineClass, TwinError, paper_machine};

/// The sweep of section 2.1: 40 to 5000 Hz.
const SWEEP: (f64, f64, usize) = (40.0, 5000.0, 300);
/// Servo samples kept of the record, from the start of the move.
const SAMPLES: usize = 1200;
/// Longest run of samples that a failing clock loses.
const LONGEST_LOSS: f64 = 6.0;

/// Measures a machine.
pub(in crate::twin) fn measured(id: String, truth: Truth, random: &mut Random) -> Result<LineMachine, TwinError> {
    let frf = measure(&truth.plant, &log_grid(SWEEP.0, SWEEP.1, SWEEP.2), truth.sweep_noise, random)?;
    let sampled = DiscretePlant::of(&truth.plant, truth.controller.sample_time_s)?;
    let chain = truth.controller.sections()?.chain;
    let limit = truth.controller.output_limit;
    let mut profile = truth.profile.clone();
    let stated_hz = profile.pes.sample_rate_hz;
    profile.pes.sample_rate_hz = stated_hz * truth.clock_ratio;
    let write = |noise: Noise, forward: Option<&Feedforward>| -> Result<Vec<f64>, TwinError> {
        let mut profile = profile.clone();
        profile.noise = noise;
        let scene = WriteScene::new(&profile, &sampled)?;
        let mut work = scene.workspace(&sampled, chain.len());
        scene.run(&sampled, &chain, forward, limit, &mut work);
        let start = profile.first_servo_sample();
        Ok(work.pes[start..].iter().take(SAMPLES).copied().collect())
    };
    let pes = write(profile.noise.clone(), None)?;
    let quiet = write(Noise::default(), None)?;
    let forward = write(Noise::default(), Some(&feed_forward()?))?;
    let factor = best_factor(&pes, &quiet, &forward, profile.pes.window[1]);
    let record = clocked(pes, stated_hz, truth.lost_share, random);
    let log = log::log(&truth, factor, &record, random);
    let label = truth.class.map(|c| (c as usize).to_string());
    let record = RawMachine { id, response: Some(frf), pes: Some(record), log: log.entries, label };
    Ok(LineMachine { record, words: log.words, truth })
}

/// Unit feed-forward of the slot: what the healthy body needs to follow without error.
fn feed_forward() -> Result<Feedforward, TwinError> {
    let plant = paper_machine(MachineClass::Healthy)?;
    let (velocity_s, acceleration_s2) = match plant.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
            let gain = dc_gain * plant.resonance_gain;
            (2.0 * damping_ratio / (w * gain), 1.0 / (w * w * gain))
        }
        Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
            let gain = acceleration_gain * plant.resonance_gain;
            (viscous_rate_per_s / gain, 1.0 / gain)
        }
        Body::Rational(_) => (0.0, 0.0),
    };
    Ok(Feedforward { factor: 1.0, velocity_s, acceleration_s2, ahead_samples: 0 })
}

/// The factor that leaves least PES up to the end of the window. The loop is linear, so one write with and one without tell.
fn best_factor(pes: &[f64], quiet: &[f64], forward: &[f64], last: usize) -> f64 {
    let (mut pd, mut dd) = (0.0, 0.0);
    for ((p, q), f) in pes.iter().zip(quiet).zip(forward).take(last) {
        pd += p * (f - q);
        dd += (f - q) * (f - q);
    }
    -pd / dd
}

/// The record with the times that the clock states, less the samples that it loses in runs.
fn clocked(pes: Vec<f64>, stated_hz: f64, lost_share: f64, random: &mut Random) -> PesRecord {
    let mut record = PesRecord { time_s: Vec::with_capacity(pes.len()), pes: Vec::with_capacity(pes.len()) };
    let mut lose = 0;
    for (i, value) in pes.into_iter().enumerate() {
        if lost_share > 0.0 && lose == 0 && i > 0 && random.uniform() < 2.0 * lost_share / LONGEST_LOSS {
            lose = 1 + (random.uniform() * (LONGEST_LOSS - 1.0)) as usize;
        }
        if lose > 0 {
            lose -= 1;
            continue;
        }
        record.time_s.push(i as f64 / stated_hz);
        record.pes.push(value);
    }
    record
}
