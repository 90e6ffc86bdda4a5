//! The gain between command and torque changes while the machine warms up.
//!
//! tau = i (1 + a (1 - exp(-t/tau_th))): first-order warming from the start of the record, or of the session, whose records follow one
//! another as the case lists them (each then has a gain of its own, which a refit of all records together cannot imitate); or, where
//! a temperature was recorded, tau = i (1 + c (T - T0)): copper's resistance rises by 0.39 %/K, a magnet's field falls by about 0.1 %/K.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;
use nalgebra::Complex;

/// What the gain goes by. Its strength is the final change, or the change per degree.
#[derive(Clone, Debug, PartialEq)]
pub enum GainDrift {
    /// The recorded temperature.
    ByTemperature,
    /// A first-order warming.
    Warming {
        /// Thermal time constant (s), above 0.
        time_constant_s: f64,
        /// What it counts from.
        from: Start,
    },
}

/// What a warming counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The start of each record.
    Record,
    /// The start of the session, whose records follow one another.
    Session,
}

const GAIN_PER_DEGREE: Key =
    Key::new("gain_per_degree", Unit::PerDegreeCelsius, "c, by a recorded temperature").unless(&["gain_change"]);
const GAIN_CHANGE: Key = Key::new("gain_change", Unit::Ratio, "a").unless(&["gain_per_degree"]);
const TIME_CONSTANT_S: Key =
    Key::new("time_constant_s", Unit::Second, "thermal time constant; of a session the same in its length")
        .beside("gain_change")
        .positive()
        .scan(ScanEnd::At(0.03, Measure::Record), ScanEnd::At(3.0, Measure::Record));
const FROM_SESSION_START: Key = Key::new(
    "from_session_start",
    Unit::Ratio,
    "0: t counts from the start of each record; else from that of the session",
)
.or(0.0)
.beside("gain_change")
.prior(Prior::Words("0; 1 too where the session is longer than 1.5 records"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "gain_drift",
    port: Port::Amplifier,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = i (1 + a (1 - exp(-t/tau_th))) (t of record or session) or i (1 + c (T - T0))",
    keys: &[GAIN_PER_DEGREE, GAIN_CHANGE, TIME_CONSTANT_S, FROM_SESSION_START],
    source: "IEC 60028, International Standard of Resistance for Copper, 1925",
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
    fn columns(&self, from: &Sample, _to: &Sample, out: &mut [f64]) {
        let t = if self.session { from.session } else { from.t };
        out[0] = from.i * (1.0 - (-t / self.tau).exp() * self.mean);
    }
}

struct ByTemperature;

impl Law for ByTemperature {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = from.i * 0.5 * (from.temperature + to.temperature);
    }
}

impl Parametric for GainDrift {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::FactorOverTime
    }

    fn grid(scene: &MotionScene) -> Vec<GainDrift> {
        let mut all = if scene.warm { vec![GainDrift::ByTemperature] } else { Vec::new() };
        // A time constant much above record or session is a straight line in time already.
        let record = logarithmic(0.03 * scene.duration_s, 3.0 * scene.duration_s, 7);
        let warming = |from| move |time_constant_s| GainDrift::Warming { time_constant_s, from };
        all.extend(record.into_iter().map(warming(Start::Record)));
        if scene.session_s > ONE * scene.duration_s {
            let session = logarithmic(0.03 * scene.session_s, 3.0 * scene.session_s, 7);
            all.extend(session.into_iter().map(warming(Start::Session)));
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        match self {
            GainDrift::ByTemperature => vec![None],
            GainDrift::Warming { time_constant_s, .. } => vec![Some(time_constant_s)],
        }
    }

    fn choices(&self) -> Vec<usize> {
        vec![usize::from(matches!(self, GainDrift::Warming { from: Start::Session, .. }))]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let &GainDrift::Warming { time_constant_s: tau, from } = self else { return Box::new(ByTemperature) };
        let ratio = scene.sample_time_s / tau;
        Box::new(Warming { tau, session: from == Start::Session, mean: -(-ratio).exp_m1() / ratio })
    }

    fn has_own_clock() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        match *self {
            GainDrift::ByTemperature => vec![GAIN_PER_DEGREE.at(strengths[0])],
            GainDrift::Warming { time_constant_s, from } => vec![
                GAIN_CHANGE.at(strengths[0]),
                TIME_CONSTANT_S.at(time_constant_s),
                FROM_SESSION_START.at(f64::from(from == Start::Session)),
            ],
        }
    }

    fn response_share(&self, strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        // Fully warm: the machine after a long session. With a recorded temperature the cold machine.
        let warm = matches!(self, GainDrift::Warming { .. });
        Share::Ratio(Complex::new(if warm { strengths[0] } else { 0.0 }, 0.0))
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(GainDrift, Vec<f64>), PhysicsError> {
        if given.has(&GAIN_PER_DEGREE) {
            return Ok((GainDrift::ByTemperature, vec![given.need(&GAIN_PER_DEGREE)?]));
        }
        let strengths = vec![given.need(&GAIN_CHANGE)?];
        let from = if given.or(&FROM_SESSION_START)? != 0.0 { Start::Session } else { Start::Record };
        Ok((GainDrift::Warming { time_constant_s: given.need(&TIME_CONSTANT_S)?, from }, strengths))
    }
}
