//! A torque that repeats with the position: cogging of magnets or the balls of the bearing, or a torque factor that waves.
//!
//! tau = a cos(2 pi x/P) + b sin(2 pi x/P), times the current where the torque factor waves; the mean over an interval by Simpson's rule along the straight path.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::encoder_cyclic_error::EncoderCyclicError;
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use std::cell::Cell;
use std::f64::consts::TAU;

/// The wave. Its strengths are cosine and sine.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueRipple {
    /// Period (position_unit), above 0.
    pub period: f64,
    /// Whether it waves the torque factor: a factor of the current; else it is a torque of its own.
    pub of_factor: bool,
}

const AMPLITUDE_COMMAND: Key =
    Key::new("amplitude_command", Unit::Command, "of a torque of its own").unless(&["amplitude_relative"]);
const AMPLITUDE_RELATIVE: Key =
    Key::new("amplitude_relative", Unit::Ratio, "of a wave of the torque factor").unless(&["amplitude_command"]);
const PERIOD: Key = Key::new("period", Unit::Position, "length of the wave")
    .positive()
    .scan(ScanEnd::Greatest(&[(8.0, Measure::Noise), (0.01, Measure::Travel)]), ScanEnd::At(0.6, Measure::Travel));
const PHASE_DEG: Key = Key::new("phase_deg", Unit::Degree, "phase").or(0.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "torque_ripple",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = a cos(2 pi x/P + phi), or i a cos(2 pi x/P + phi)",
    keys: &[AMPLITUDE_COMMAND, AMPLITUDE_RELATIVE, PERIOD, PHASE_DEG],
    source: "D. C. Hanselman, Brushless Permanent Magnet Motor Design, 2nd edition, 2003",
    says: "the torque has a wave that repeats with the position: the arm is pulled towards certain places",
    confused_with: &["encoder_cyclic_error", "nonlinear_spring", "cable_spring"],
    experiment: "constant-velocity moves at three speeds: the line moves with the speed and weakens with its square",
    band_hz: [1.0, 500.0],
};

/// Half of the wave's phase over a step (rad) up to which the series of tan(h)/h is exact to 1e-12.
const SHORT: f64 = 0.1;

struct Ripple {
    wave: f64,
    factor: bool,
    /// Position that was asked for last, its sine and cosine: where one interval ends, the next begins.
    last: Cell<[f64; 3]>,
}

impl Law for Ripple {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let [x, mut s0, mut c0] = self.last.get();
        if x != from.x {
            (s0, c0) = (self.wave * from.x).sin_cos();
        }
        let (s2, c2) = (self.wave * to.x).sin_cos();
        self.last.set([to.x, s2, c2]);
        // The mean over a straight way: sin(h)/h times the wave at its middle, which is the ends' mean over cos(h).
        let h = 0.5 * self.wave * (to.x - from.x);
        // The acting command is the mean over the interval already.
        let by = if self.factor { from.i } else { 1.0 };
        (out[0], out[1]) = if h.abs() < SHORT {
            let h2 = h * h;
            let both =
                0.5 * by * (1.0 + h2 * (1.0 / 3.0 + h2 * (2.0 / 15.0 + h2 * (17.0 / 315.0 + h2 * 62.0 / 2835.0))));
            (both * (c0 + c2), both * (s0 + s2))
        } else {
            let (sin, cos) = (self.wave * 0.5 * (from.x + to.x)).sin_cos();
            let by = by * h.sin() / h;
            (by * cos, by * sin)
        };
    }
}

impl Parametric for TorqueRipple {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn is_wave_over_position() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Position
    }

    fn grid(scene: &MotionScene) -> Vec<TorqueRipple> {
        // The same question as for the encoder's wave: no period over the travel may fall between two points.
        let periods = EncoderCyclicError::grid(scene).into_iter().map(|wave| wave.period).step_by(2);
        periods.flat_map(|period| [false, true].map(|of_factor| TorqueRipple { period, of_factor })).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.period)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![usize::from(self.of_factor)]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Ripple { wave: TAU / self.period, factor: self.of_factor, last: Cell::new([f64::NAN; 3]) })
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let [a, b] = [strengths[0], strengths[1]];
        let amplitude = match self.of_factor {
            true => AMPLITUDE_RELATIVE.at(a.hypot(b)),
            false => AMPLITUDE_COMMAND.at(a.hypot(b)),
        };
        vec![amplitude, PERIOD.at(self.period), PHASE_DEG.at((-b).atan2(a).to_degrees())]
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(TorqueRipple, Vec<f64>), PhysicsError> {
        let of_factor = given.has(&AMPLITUDE_RELATIVE);
        let amplitude = given.need(if of_factor { &AMPLITUDE_RELATIVE } else { &AMPLITUDE_COMMAND })?;
        let phase = given.or(&PHASE_DEG)?.to_radians();
        let strengths = vec![amplitude * phase.cos(), -amplitude * phase.sin()];
        Ok((TorqueRipple { period: given.need(&PERIOD)?, of_factor }, strengths))
    }
}
