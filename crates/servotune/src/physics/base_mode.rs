//! The base rocks under the reaction of the motor, and the encoder reads the arm against the base.
//!
//! Base: x_b'' + 2 z w x_b' + w² x_b = -R i; m = x - x_b, so m = x + g w²/(s² + 2 z w s + w²) i with g = R/w².

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, ScanEnd, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::MotionScene;
use super::share::Share;
use super::unmodelled_resonance::{Ringing, scan, term};
use std::f64::consts::TAU;

/// The mode of the base. Its strength is the base's displacement per constant command.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseMode {
    /// Natural frequency (Hz), above 0.
    pub frequency_hz: f64,
    /// Damping ratio, between 0 and 1.
    pub damping_ratio: f64,
}

const FREQUENCY_HZ: Key = Key::new("frequency_hz", Unit::Hertz, "natural frequency")
    .positive()
    .scan(ScanEnd::At(3.0, Measure::One), ScanEnd::Least(&[(80.0, Measure::One), (0.2, Measure::SampleRate)]));
const DAMPING_RATIO: Key =
    Key::new("damping_ratio", Unit::Ratio, "damping ratio; refined from a third of the first up, below 0.3")
        .takes(Takes::Between(0.0, 1.0, "above 0 and below 1"))
        .points(&[0.01, 0.05, 0.15]);
const STATIC_GAIN: Key = Key::new("static_gain", Unit::PositionPerCommand, "g");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "base_mode",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "m = x + g w^2/(s^2 + 2 z w s + w^2) i, w within 3 to 80 Hz",
    keys: &[FREQUENCY_HZ, DAMPING_RATIO, STATIC_GAIN],
    source: "E. I. Rivin, Passive Vibration Isolation, 2003",
    says: "the whole machine rocks on its feet when the arm is pushed, and rings on after the move",
    confused_with: &["unmodelled_resonance", "pivot_friction", "linear_parameters", "line_disturbance"],
    experiment: "a hard move, then half a second of rest: the base rings on; the same from a neighbouring slot",
    band_hz: [3.0, 80.0],
};

/// Damping ratio of a machine on soft feet, and more than any has: beyond it the law is no mode but a curve.
const HEAVIEST: f64 = 0.3;

impl BaseMode {
    fn at([frequency_hz, damping_ratio]: [f64; 2]) -> BaseMode {
        BaseMode { frequency_hz, damping_ratio }
    }
}

impl Parametric for BaseMode {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<BaseMode> {
        let high = 80f64.min(0.2 / scene.sample_time_s);
        [0.01, 0.05, 0.15].iter().flat_map(|&z| scan(3.0, high, z, scene)).map(BaseMode::at).collect()
    }

    fn is_possible(&self, _strengths: &[f64], _errors: &[f64]) -> bool {
        self.damping_ratio < HEAVIEST
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.frequency_hz), Some(&mut self.damping_ratio)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Ringing::at_rest(self.frequency_hz, self.damping_ratio, scene.sample_time_s, 1))
    }

    fn free_motions(&self, scene: &MotionScene, n: usize) -> Vec<Vec<f64>> {
        let (w, z) = (TAU * self.frequency_hz, self.damping_ratio.clamp(0.0, 1.0));
        let turning = w * ((1.0 - z) * (1.0 + z)).sqrt();
        let over = |of: fn(f64) -> f64| {
            let at = |k: usize| k as f64 * scene.sample_time_s;
            (0..n).map(|k| (-z * w * at(k)).exp() * of(turning * at(k))).collect()
        };
        vec![over(f64::cos), over(f64::sin)]
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![FREQUENCY_HZ.at(self.frequency_hz), DAMPING_RATIO.at(self.damping_ratio), STATIC_GAIN.at(strengths[0])]
    }

    fn response_share(&self, strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Terms(vec![term(self.frequency_hz, self.damping_ratio, strengths[0], 0.0)])
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(BaseMode, Vec<f64>), PhysicsError> {
        let damping = given.need(&DAMPING_RATIO)?;
        let strengths = vec![given.need(&STATIC_GAIN)?];
        Ok((BaseMode::at([given.need(&FREQUENCY_HZ)?, damping]), strengths))
    }
}
