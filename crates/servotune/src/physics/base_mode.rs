//! The base rocks under the reaction of the motor, and the encoder reads the arm against the base.
//!
//! Base: x_b'' + 2 z w x_b' + w² x_b = -R i; m = x - x_b, so m = x + g w²/(s² + 2 z w s + w²) i with g = R/w².

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting};
use super::parameter::{Parameter, Unit};
use super::sample::Scene;
use super::share::Share;
use super::unmodelled_resonance::{Ringing, scan, term};
use std::f64::consts::TAU;

/// Inner: frequency (Hz), damping ratio. Strength: the base's displacement per constant command.
pub struct BaseMode;

static FACTS: Facts = Facts {
    name: "base_mode",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "m = x + g w^2/(s^2 + 2 z w s + w^2) i, w within 3 to 80 Hz",
    says: "the whole machine rocks on its feet when the arm is pushed, and rings on after the move",
    confused_with: &["unmodelled_resonance", "pivot_friction", "linear_parameters", "line_disturbance"],
    experiment: "a hard move, then half a second of rest: the base rings on; the same from a neighbouring slot",
    band_hz: [3.0, 80.0],
};

/// Damping ratio of a machine on soft feet, and more than any has: beyond it the law is no mode but a curve.
const HEAVIEST: f64 = 0.3;

impl Effect for BaseMode {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let high = 80f64.min(0.2 / scene.sample_time_s);
        [0.01, 0.05, 0.15].iter().flat_map(|&z| scan(3.0, high, z, scene)).collect()
    }

    fn is_possible(&self, setting: &Setting, _errors: &[f64]) -> bool {
        setting.inner[1] < HEAVIEST
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        Box::new(Ringing::at_rest(inner[0], inner[1], scene.sample_time_s, 1))
    }

    fn free_motions(&self, inner: &[f64], scene: &Scene, n: usize) -> Vec<Vec<f64>> {
        let (w, z) = (TAU * inner[0], inner[1].clamp(0.0, 1.0));
        let turning = w * ((1.0 - z) * (1.0 + z)).sqrt();
        let over = |of: fn(f64) -> f64| {
            let at = |k: usize| k as f64 * scene.sample_time_s;
            (0..n).map(|k| (-z * w * at(k)).exp() * of(turning * at(k))).collect()
        };
        vec![over(f64::cos), over(f64::sin)]
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("frequency_hz", setting.inner[0], Unit::Hertz),
            Parameter::new("damping_ratio", setting.inner[1], Unit::Ratio),
            Parameter::new("static_gain", setting.strengths[0], Unit::PositionPerCommand),
        ]
    }

    fn response_share(&self, setting: &Setting, _scene: &Scene, _w_rad_s: f64) -> Share {
        Share::Terms(vec![term(setting.inner[0], setting.inner[1], setting.strengths[0], 0.0)])
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let damping = given.between("damping_ratio", 0.0, 1.0, "above 0 and below 1")?;
        let strengths = vec![given.need("static_gain")?];
        Ok(Setting { inner: vec![given.positive("frequency_hz")?, damping], strengths })
    }
}
