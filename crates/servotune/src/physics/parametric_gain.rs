//! The gain between command and torque swings periodically: every line gets sidebands.
//!
//! tau = i (1 + e cos(angle + phi)), the angle being a whole order of the spindle or 2 pi f t (a time-periodic gain; Floquet).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Prior};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;
use std::f64::consts::{PI, TAU};

/// The swing. Its strengths are those of i cos and i sin.
#[derive(Clone, Debug, PartialEq)]
pub struct ParametricGain {
    /// Frequency (Hz), above 0.
    pub frequency_hz: f64,
    /// What counts its turns.
    pub clock: Clock,
}

/// What counts the turns of a swing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Time, at the frequency.
    Time,
    /// The spindle's angle, this many turns to one of the spindle; at least 1.
    Spindle(usize),
}

const DEPTH: Key = Key::new("depth", Unit::Ratio, "e");
const FREQUENCY_HZ: Key = Key::new("frequency_hz", Unit::Hertz, "f").positive().prior(Prior::Words("orders 1 to 6 of the spindle; of time from 3 / record in steps of 0.8 / record, 300 points, below a tenth of the sample rate"));
const SPINDLE_ORDER: Key = Key::new("spindle_order", Unit::Ratio, "turns to one of the spindle; 0: f counts in time")
    .or(0.0)
    .points(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
const PHASE_DEG: Key = Key::new("phase_deg", Unit::Degree, "phase").or(0.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "parametric_gain",
    port: Port::Amplifier,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = i (1 + e cos(2 pi f t + phi)), f t counted by the spindle where f is an order of it",
    keys: &[DEPTH, FREQUENCY_HZ, SPINDLE_ORDER, PHASE_DEG],
    source: "J. A. Richards, Analysis of Periodically Time-Varying Systems, 1983",
    says: "the motor's strength swings periodically: every tone of the command gets two neighbours",
    confused_with: &["line_disturbance", "repeatable_runout", "gain_drift"],
    experiment: "single tones at three frequencies and two amplitudes: sidebands follow the tone and grow with it",
    band_hz: [1.0, 3000.0],
};

/// Most points of the scan.
const POINTS: usize = 300;

struct Swing {
    w: f64,
    order: f64,
    mean: f64,
}

impl Law for Swing {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let angle = if self.order > 0.0 {
            // From the first sample on, so that an angle that wraps between two samples does no harm.
            self.order * from.spindle_rad + 0.5 * self.w * (to.t - from.t)
        } else {
            self.w * 0.5 * (from.t + to.t)
        };
        let (sin, cos) = angle.sin_cos();
        (out[0], out[1]) = (from.i * self.mean * cos, from.i * self.mean * sin);
    }
}

impl ParametricGain {
    /// Turns to one of the spindle; 0 where time counts them.
    fn order(&self) -> usize {
        match self.clock {
            Clock::Time => 0,
            Clock::Spindle(order) => order,
        }
    }
}

impl Parametric for ParametricGain {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::FactorOverTime
    }

    fn grid(scene: &MotionScene) -> Vec<ParametricGain> {
        let mut all: Vec<ParametricGain> = Vec::new();
        if let Some(spindle) = scene.spindle_hz {
            let order = |n: usize| ParametricGain { frequency_hz: n as f64 * spindle, clock: Clock::Spindle(n) };
            all.extend((1..=6).map(order));
        }
        if scene.duration_s > 0.0 {
            let high = 0.2 * scene.nyquist_hz();
            // A swing shows at least three times in a record; what is slower is a drift.
            let (first, step) = (3.0 / scene.duration_s, 0.8 / scene.duration_s);
            let timed = |frequency_hz| ParametricGain { frequency_hz, clock: Clock::Time };
            all.extend((0..POINTS).map(|i| first + step * i as f64).take_while(|&f| f < high).map(timed));
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.frequency_hz)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.order()]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let order = self.order() as f64;
        let hz =
            if order > 0.0 { scene.spindle_hz.map_or(self.frequency_hz, |s| order * s) } else { self.frequency_hz };
        let y = PI * hz * scene.sample_time_s;
        Box::new(Swing { w: TAU * hz, order, mean: if y == 0.0 { 1.0 } else { y.sin() / y } })
    }

    fn has_own_clock() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let [a, b] = [strengths[0], strengths[1]];
        vec![
            DEPTH.at(a.hypot(b)),
            FREQUENCY_HZ.at(self.frequency_hz),
            SPINDLE_ORDER.at(self.order() as f64),
            PHASE_DEG.at((-b).atan2(a).to_degrees()),
        ]
    }

    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(ParametricGain, Vec<f64>), PhysicsError> {
        let (depth, phase) = (given.need(&DEPTH)?, given.or(&PHASE_DEG)?.to_radians());
        let clock = match given.or(&SPINDLE_ORDER)?.round().max(0.0) as usize {
            0 => Clock::Time,
            order => Clock::Spindle(order),
        };
        let law = ParametricGain { frequency_hz: given.need(&FREQUENCY_HZ)?, clock };
        Ok((law, vec![depth * phase.cos(), -depth * phase.sin()]))
    }
}
