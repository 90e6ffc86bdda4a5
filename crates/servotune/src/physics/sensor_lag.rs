//! The encoder's reading follows the position with a first-order lag: an anti-alias filter or an interpolator.
//!
//! tau y' = x - y; over an interval where x runs straight with slope s: y = x - s tau + (y0 - x0 + s tau) exp(-t/tau).

use super::amplifier_lag::{BANDWIDTH_HZ, time_constant_s};
use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::Key;
use super::parameter::Parameter;
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// The lag of the reading.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorLag {
    /// Time constant (s), above 0.
    pub time_constant_s: f64,
}

/// Longer than an amplifier's: the drive of a bench may filter the speed that it logs at a few hertz.
const TIME_CONSTANT_S: Key = time_constant_s(100.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "sensor_lag",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "tau y' = x - y, y is recorded",
    keys: &[TIME_CONSTANT_S, BANDWIDTH_HZ],
    source: "G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, 3rd edition, 1998",
    says: "the encoder's reading lags behind the position: something in the sensor filters it",
    confused_with: &["amplifier_lag", "extra_delay", "linear_parameters"],
    experiment: "a multisine up to half the sample rate, read by the encoder and by the PES: only the encoder shows the lag",
    band_hz: [300.0, 12000.0],
};

struct Lag {
    tau: f64,
    step: f64,
    keep: f64,
    /// Reading minus position.
    behind: Option<f64>,
}

impl Lag {
    fn next(&self, from: &Sample, to: &Sample) -> f64 {
        let drag = self.tau * (to.x - from.x) / self.step;
        // Before the record the arm is taken to move on as it starts.
        let behind = self.behind.unwrap_or(-self.tau * from.v);
        -drag + (behind + drag) * self.keep
    }
}

impl Law for Lag {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.behind = Some(self.next(from, to));
    }
}

impl Parametric for SensorLag {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<SensorLag> {
        let t = scene.sample_time_s;
        logarithmic(0.1 * t, 100.0 * t, 18).into_iter().map(|time_constant_s| SensorLag { time_constant_s }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.time_constant_s)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let step = scene.sample_time_s;
        Box::new(Lag { tau: self.time_constant_s, step, keep: (-step / self.time_constant_s).exp(), behind: None })
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![TIME_CONSTANT_S.at(self.time_constant_s), BANDWIDTH_HZ.at(1.0 / (TAU * self.time_constant_s))]
    }

    fn response_share(&self, _strengths: &[f64], scene: &MotionScene, w_rad_s: f64) -> Share {
        let (step, tau) = (scene.sample_time_s, self.time_constant_s);
        let keep = (-step / tau).exp();
        let z = Complex::from_polar(1.0, w_rad_s * step);
        Share::Ratio((z - 1.0) / (z - keep) * (keep - 1.0) * tau / step)
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(SensorLag, Vec<f64>), PhysicsError> {
        let time_constant_s = if given.has(&TIME_CONSTANT_S) {
            given.need(&TIME_CONSTANT_S)?
        } else {
            1.0 / (TAU * given.need(&BANDWIDTH_HZ)?)
        };
        Ok((SensorLag { time_constant_s }, vec![1.0]))
    }
}
