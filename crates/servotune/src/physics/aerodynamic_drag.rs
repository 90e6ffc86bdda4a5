//! Air resists in proportion to the square of the speed.
//!
//! tau = -c v |v|; the mean over an interval by Simpson's rule, velocity taken as straight.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::Key;
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// Its strength is the drag coefficient.
#[derive(Clone, Debug, PartialEq)]
pub struct AerodynamicDrag;

const COEFFICIENT: Key = Key::new("coefficient", Unit::CommandSecondSquaredPerPositionSquared, "c");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "aerodynamic_drag",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -c v |v|",
    keys: &[COEFFICIENT],
    source: "S. F. Hoerner, Fluid-Dynamic Drag, 1965",
    says: "the air holds the arm back at high speed: twice the speed, four times the drag",
    confused_with: &["coulomb_friction", "linear_parameters", "current_saturation"],
    experiment: "constant-velocity moves in both directions at six speeds over two decades",
    band_hz: [0.5, 200.0],
};

struct Drag;

impl Law for Drag {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let middle = 0.5 * (from.v + to.v);
        out[0] = -(from.v * from.v.abs() + 4.0 * middle * middle.abs() + to.v * to.v.abs()) / 6.0;
    }
}

impl Parametric for AerodynamicDrag {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn acts_on_body() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Velocity
    }

    fn grid(_scene: &MotionScene) -> Vec<AerodynamicDrag> {
        vec![AerodynamicDrag]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Drag)
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![COEFFICIENT.at(strengths[0])]
    }

    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        strengths.first().is_some_and(|s| *s > 0.0)
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(AerodynamicDrag, Vec<f64>), PhysicsError> {
        Ok((AerodynamicDrag, vec![given.need(&COEFFICIENT)?]))
    }
}
