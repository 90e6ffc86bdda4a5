//! The gain between command and torque changes while the machine warms up.
//!
//! tau = i (1 + a (1 - exp(-t/tau_th))): first-order warming from the start of the record, or of the session, whose records follow one
//! another as the case lists them (each then has a gain of its own, which a refit of all records together cannot imitate); or, where
//! a temperature was recorded, tau = i (1 + c (T - T0)): copper's resistance rises by 0.39 %/K, a magnet's field falls by about 0.1 %/K.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};
use super::share::Share;
use nalgebra::Complex;

/// Inner: thermal time constant (0: by the recorded temperature), clock (0: the record's, 1: the session's). Strength: final change, or change per degree.
pub struct GainDrift;

static FACTS: Facts = Facts {
    name: "gain_drift",
    port: Port::Amplifier,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = i (1 + a (1 - exp(-t/tau_th))) (t of record or session) or i (1 + c (T - T0))",
    says: "the motor gets weaker or stronger while it runs, as when it warms up",
    confused_with: &["torque_factor_rolloff", "offset_drift", "linear_parameters"],
    experiment: "the same multisine at the start and at the end of a long session, temperature recorded",
    band_hz: [1.0, 3000.0],
};

/// Length of the session in longest records above which it has a clock of its own.
const ONE: f64 = 1.5;

struct Warming {
    tau: f64,
    /// Whether the session's clock counts, not the record's.
    session: bool,
    /// Mean of exp(-t/tau) over an interval that starts at 0.
    mean: f64,
}

impl Law for Warming {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = if self.tau > 0.0 {
            let t = if self.session { from.session } else { from.t };
            from.i * (1.0 - (-t / self.tau).exp() * self.mean)
        } else {
            from.i * 0.5 * (from.temperature + to.temperature)
        };
    }
}

impl Effect for GainDrift {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::FactorOverTime
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = if scene.warm { vec![vec![0.0, 0.0]] } else { Vec::new() };
        // A time constant much above record or session is a straight line in time already.
        let record = logarithmic(0.03 * scene.duration_s, 3.0 * scene.duration_s, 7);
        all.extend(record.into_iter().map(|tau| vec![tau, 0.0]));
        if scene.session_s > ONE * scene.duration_s {
            let session = logarithmic(0.03 * scene.session_s, 3.0 * scene.session_s, 7);
            all.extend(session.into_iter().map(|tau| vec![tau, 1.0]));
        }
        all
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        let ratio = if inner[0] > 0.0 { scene.sample_time_s / inner[0] } else { 1.0 };
        Box::new(Warming { tau: inner[0], session: inner[1] != 0.0, mean: -(-ratio).exp_m1() / ratio })
    }

    fn has_own_clock(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        if setting.inner[0] > 0.0 {
            vec![
                Parameter::new("gain_change", setting.strengths[0], Unit::Ratio),
                Parameter::new("time_constant_s", setting.inner[0], Unit::Second),
                Parameter::new("from_session_start", setting.inner[1], Unit::Ratio),
            ]
        } else {
            vec![Parameter::new("gain_per_degree", setting.strengths[0], Unit::PerDegreeCelsius)]
        }
    }

    fn response_share(&self, setting: &Setting, _scene: &Scene, _w_rad_s: f64) -> Share {
        // Fully warm: the machine after a long session. With a recorded temperature the cold machine.
        Share::Ratio(Complex::new(if setting.inner[0] > 0.0 { setting.strengths[0] } else { 0.0 }, 0.0))
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        if given.has("gain_per_degree") {
            return Ok(Setting { inner: vec![0.0, 0.0], strengths: vec![given.need("gain_per_degree")?] });
        }
        let strengths = vec![given.need("gain_change")?];
        let session = f64::from(given.or("from_session_start", 0.0) != 0.0);
        Ok(Setting { inner: vec![given.positive("time_constant_s")?, session], strengths })
    }
}
