//! The torque that holds the arm drifts along a record.
//!
//! tau = a t + b t², t from the start of the record: the first terms of any slow change. The constant is the torque offset.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::Key;
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;

/// Its strengths are slope and curvature, per record.
#[derive(Clone, Debug, PartialEq)]
pub struct OffsetDrift;

const SLOPE: Key = Key::new("slope", Unit::CommandPerSecond, "a");
const CURVATURE: Key = Key::new("curvature", Unit::CommandPerSecondSquared, "b").or(0.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "offset_drift",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: true,
    equation: "tau = a t + b t^2",
    keys: &[SLOPE, CURVATURE],
    source: "L. Ljung, System Identification: Theory for the User, 2nd edition, 1999",
    says: "a constant push on the arm slowly changes while recording",
    confused_with: &["cable_spring", "bearing_bias", "gain_drift"],
    experiment: "rest at one place for as long as a record takes, before and after",
    band_hz: [0.0, 5.0],
};

struct Drift;

impl Law for Drift {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = 0.5 * (from.t + to.t);
        out[1] = (from.t * from.t + from.t * to.t + to.t * to.t) / 3.0;
    }
}

impl Parametric for OffsetDrift {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(_scene: &MotionScene) -> Vec<OffsetDrift> {
        vec![OffsetDrift]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Drift)
    }

    fn independent_of_motion() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![SLOPE.at(strengths[0]), CURVATURE.at(strengths[1])]
    }

    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(OffsetDrift, Vec<f64>), PhysicsError> {
        Ok((OffsetDrift, vec![given.need(&SLOPE)?, given.or(&CURVATURE)?]))
    }
}
