//! The current follows the command with a first-order lag: the current loop's bandwidth, coil inductance included.
//!
//! tau i' = u - i with u held between samples; i(t) = u + (i0 - u) exp(-t/tau), and what acts is its mean over the interval.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};
use super::share::Share;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Inner: the time constant.
pub struct AmplifierLag;

static FACTS: Facts = Facts {
    name: "amplifier_lag",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "tau i' = u - i, u held between samples; the mean of i over each interval acts",
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

impl Effect for AmplifierLag {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let t = scene.sample_time_s;
        logarithmic(0.1 * t, 20.0 * t, 14).into_iter().map(|tau| vec![tau]).collect()
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        let ratio = scene.sample_time_s / inner[0];
        Box::new(Lag { keep: (-ratio).exp(), mean: -(-ratio).exp_m1() / ratio, current: None })
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("time_constant_s", setting.inner[0], Unit::Second),
            Parameter::new("bandwidth_hz", 1.0 / (TAU * setting.inner[0]), Unit::Hertz),
        ]
    }

    fn response_share(&self, setting: &Setting, scene: &Scene, w_rad_s: f64) -> Share {
        let ratio = scene.sample_time_s / setting.inner[0];
        let keep = (-ratio).exp();
        // Current over command at the samples, then the mean over the interval.
        let arrived = (1.0 - keep) / (Complex::from_polar(1.0, w_rad_s * scene.sample_time_s) - keep);
        Share::Ratio((arrived - 1.0) * -(-ratio).exp_m1() / ratio)
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let tau = if given.has("time_constant_s") {
            given.positive("time_constant_s")?
        } else {
            1.0 / (TAU * given.positive("bandwidth_hz")?)
        };
        Ok(Setting { inner: vec![tau], strengths: vec![1.0] })
    }
}
