//! The current follows the command with a first-order lag: the current loop's bandwidth, coil inductance included.
//!
//! tau i' = u - i with u held between samples; i(t) = u + (i0 - u) exp(-t/tau), and what acts is its mean over the interval.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// The lag of the current.
#[derive(Clone, Debug, PartialEq)]
pub struct AmplifierLag {
    /// Time constant (s), above 0.
    pub time_constant_s: f64,
}

/// The keys of a first-order lag, of the reading too; its time constant is searched up to so many samples.
pub(super) const fn time_constant_s(longest: f64) -> Key {
    Key::new("time_constant_s", Unit::Second, "time constant")
        .unless(&["bandwidth_hz"])
        .positive()
        .scan(ScanEnd::At(0.1, Measure::Sample), ScanEnd::At(longest, Measure::Sample))
}
const TIME_CONSTANT_S: Key = time_constant_s(20.0);
pub(super) const BANDWIDTH_HZ: Key = Key::new("bandwidth_hz", Unit::Hertz, "1/(2 pi time_constant_s)")
    .unless(&["time_constant_s"])
    .positive()
    .prior(Prior::Words("made from the time constant"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "amplifier_lag",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "tau i' = u - i, u held between samples; the mean of i over each interval acts",
    keys: &[TIME_CONSTANT_S, BANDWIDTH_HZ],
    source: "G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, 3rd edition, 1998",
    says: "the amplifier follows its command with a lag: high frequencies come late and weaker",
    confused_with: &["extra_delay", "sensor_lag", "linear_parameters", "slew_limit"],
    experiment: "a multisine up to half the sample rate: a lag weakens the top of the band, a delay does not",
    band_hz: [300.0, 12000.0],
};

struct Lag {
    /// exp(-T/tau).
    keep: f64,
    /// Mean of exp(-t/tau) over an interval.
    mean: f64,
    current: Option<f64>,
}

impl Lag {
    /// The current at `to`.
    fn arrived(&self, from: &Sample) -> f64 {
        from.u + (self.current.unwrap_or(from.u) - from.u) * self.keep
    }
}

impl Law for Lag {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = (self.arrived(from) - to.u) * self.mean;
    }

    fn commit(&mut self, from: &Sample, _to: &Sample) {
        self.current = Some(self.arrived(from));
    }
}

impl Parametric for AmplifierLag {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<AmplifierLag> {
        let t = scene.sample_time_s;
        logarithmic(0.1 * t, 20.0 * t, 14).into_iter().map(|time_constant_s| AmplifierLag { time_constant_s }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.time_constant_s)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let ratio = scene.sample_time_s / self.time_constant_s;
        Box::new(Lag { keep: (-ratio).exp(), mean: -(-ratio).exp_m1() / ratio, current: None })
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![TIME_CONSTANT_S.at(self.time_constant_s), BANDWIDTH_HZ.at(1.0 / (TAU * self.time_constant_s))]
    }

    fn response_share(&self, _strengths: &[f64], scene: &MotionScene, w_rad_s: f64) -> Share {
        let ratio = scene.sample_time_s / self.time_constant_s;
        let keep = (-ratio).exp();
        // Current over command at the samples, then the mean over the interval.
        let arrived = (1.0 - keep) / (Complex::from_polar(1.0, w_rad_s * scene.sample_time_s) - keep);
        Share::Ratio((arrived - 1.0) * -(-ratio).exp_m1() / ratio)
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(AmplifierLag, Vec<f64>), PhysicsError> {
        let time_constant_s = if given.has(&TIME_CONSTANT_S) {
            given.need(&TIME_CONSTANT_S)?
        } else {
            1.0 / (TAU * given.need(&BANDWIDTH_HZ)?)
        };
        Ok((AmplifierLag { time_constant_s }, vec![1.0]))
    }
}
