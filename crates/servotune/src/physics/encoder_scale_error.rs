//! The encoder's scale is not even over the stroke: an error that changes smoothly with the position.
//!
//! m = x + e2 (x - x0)² + e3 (x - x0)³: the first terms of an eccentric scale's e cos(x + phi) over a part of a turn. The
//! constant and the slope are offset and gain of the plant.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Prior};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// The uneven scale. Its strengths are e2 and e3.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderScaleError {
    /// Position at which it reads right (position_unit).
    pub centre: f64,
}

const QUADRATIC: Key = Key::new("quadratic", Unit::PerPosition, "e2");
const CUBIC: Key = Key::new("cubic", Unit::PerPositionSquared, "e3").or(0.0);
const CENTRE: Key = Key::new("centre", Unit::Position, "where it reads right, x0")
    .or_else("the middle of the stroke")
    .prior(Prior::Words("the middle of the positions"));
const ERROR_AT_TRAVEL: Key = Key::reported("error_at_travel", Unit::Position, "error at the travel");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "encoder_scale_error",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "m = x + e2 (x - x0)^2 + e3 (x - x0)^3",
    keys: &[QUADRATIC, CUBIC, CENTRE, ERROR_AT_TRAVEL],
    source: "A. H. Slocum, Precision Machine Design, 1992",
    says: "the encoder's scale stretches over the stroke: distances read differently at the ends",
    confused_with: &["torque_factor_rolloff", "cable_spring", "nonlinear_spring"],
    experiment: "the same small multisine in five zones, read by encoder and PES: the scale differs, the torque does not",
    band_hz: [0.1, 300.0],
};

struct Scale {
    centre: f64,
}

impl Law for Scale {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        let d = to.x - self.centre;
        (out[0], out[1]) = (d * d, d * d * d);
    }
}

impl Parametric for EncoderScaleError {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Position
    }

    fn grid(scene: &MotionScene) -> Vec<EncoderScaleError> {
        vec![EncoderScaleError { centre: scene.centre }]
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.centre)]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Scale { centre: self.centre })
    }

    fn parameters(&self, strengths: &[f64], scene: &MotionScene) -> Vec<Parameter> {
        let [e2, e3] = [strengths[0], strengths[1]];
        let travel = scene.travel;
        vec![
            QUADRATIC.at(e2),
            CUBIC.at(e3),
            CENTRE.at(self.centre),
            ERROR_AT_TRAVEL.at(travel * travel * (e2 + e3 * travel)),
        ]
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(EncoderScaleError, Vec<f64>), PhysicsError> {
        let law = EncoderScaleError { centre: given.or_else(&CENTRE, scene.centre)? };
        Ok((law, vec![given.need(&QUADRATIC)?, given.or(&CUBIC)?]))
    }
}
