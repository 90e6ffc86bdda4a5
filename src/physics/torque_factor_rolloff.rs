//! The torque factor falls towards the ends of the stroke: Kt(x) = Kt0 (1 - a (x - x0)²).
//!
//! The even second-order term of the magnet gap's field (a textbook expansion; specs/mismatch.md).

use super::effect::{Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
use super::sample::{Sample, Scene};

/// Strengths: of -x i and of -x² i; the linear one moves the centre.
pub struct TorqueFactorRolloff;

static FACTS: Facts = Facts {
    name: "torque_factor_rolloff",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = Kt0 (1 - a (x - x0)^2) i",
    says: "the motor pushes less towards the ends of the stroke: the same current gives less torque there",
    confused_with: &["gain_drift", "cable_spring", "mode_shift"],
    experiment: "the same multisine in three or more zones of the stroke",
    band_hz: [1.0, 2000.0],
};

struct Rolloff;

impl Law for Rolloff {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        // The command is constant over the interval; position is not: mean of x and of x² by trapezium and Simpson.
        let middle = 0.5 * (from.x + to.x);
        out[0] = -from.i * middle;
        out[1] = -from.i * (from.x * from.x + 4.0 * middle * middle + to.x * to.x) / 6.0;
    }
}

impl Effect for TorqueFactorRolloff {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn grid(&self, _scene: &Scene) -> Vec<Vec<f64>> {
        vec![vec![]]
    }

    fn law(&self, _inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Rolloff)
    }

    fn parameters(&self, setting: &Setting, scene: &Scene) -> Vec<Parameter> {
        let [b, a] = [setting.strengths[0], setting.strengths[1]];
        // 1 - b x - a x² = (1 + b²/4a) (1 - a' (x - x0)²), x0 = -b/2a.
        let mut all = vec![
            Parameter::new("slope", b, Unit::PerPosition),
            Parameter::new("curvature", a, Unit::PerPositionSquared),
            Parameter::new("drop_at_15", a * 225.0, Unit::Ratio),
            Parameter::new("drop_at_travel", a * scene.travel * scene.travel, Unit::Ratio),
        ];
        if a != 0.0 {
            all.push(Parameter::new("centre", -b / (2.0 * a), Unit::Position));
        }
        all
    }

    fn restore(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let a = match given.need("curvature") {
            Ok(a) => a,
            Err(missing) => given.need("drop_at_15").map_err(|_| missing)? / 225.0,
        };
        Ok(Setting { inner: vec![], strengths: vec![given.or("slope", 0.0), a] })
    }
}
