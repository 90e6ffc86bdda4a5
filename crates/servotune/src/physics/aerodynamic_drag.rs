//! Air resists in proportion to the square of the speed.
//!
//! tau = -c v |v|; the mean over an interval by Simpson's rule, velocity taken as straight.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};

/// Strength: the drag coefficient.
pub struct AerodynamicDrag;

static FACTS: Facts = Facts {
    name: "aerodynamic_drag",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -c v |v|",
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

impl Effect for AerodynamicDrag {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Velocity
    }

    fn scan_points(&self, _scene: &Scene) -> Vec<Vec<f64>> {
        vec![vec![]]
    }

    fn law(&self, _inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Drag)
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![Parameter::new("coefficient", setting.strengths[0], Unit::CommandSecondSquaredPerPositionSquared)]
    }

    fn is_possible(&self, setting: &Setting, _errors: &[f64]) -> bool {
        setting.strengths.first().is_some_and(|s| *s > 0.0)
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        Ok(Setting { inner: vec![], strengths: vec![given.need("coefficient")?] })
    }
}
