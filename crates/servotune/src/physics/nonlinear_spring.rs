//! A spring that stiffens with the distance, or a stop at one end of the stroke.
//!
//! tau = -k3 (x - x0)³ (Duffing), or tau = -k max(0, x - x_e) beyond an upper stop, mirrored for a lower one. Means over an
//! interval are exact for a straight path (Simpson's rule for the cubic).

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};

/// Inner: centre, distance of the stop from it (0: cubic spring; negative: lower stop). Strength: k3 or the stop's stiffness.
pub struct NonlinearSpring;

static FACTS: Facts = Facts {
    name: "nonlinear_spring",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -k3 (x - x0)^3, or -k max(0, x - x_e) at a stop",
    says: "the arm is pushed back harder the farther it goes, as by a stiffening spring or a stop",
    confused_with: &["cable_spring", "pivot_friction", "torque_ripple", "torque_factor_rolloff"],
    experiment: "the same multisine at two amplitudes: a stiffening spring raises the low resonance and adds no damping",
    band_hz: [1.0, 200.0],
};

struct Spring {
    centre: f64,
    edge: f64,
}

impl Law for Spring {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let (a, b) = (from.x - self.centre, to.x - self.centre);
        out[0] = if self.edge == 0.0 {
            let middle = 0.5 * (a + b);
            -(a.powi(3) + 4.0 * middle.powi(3) + b.powi(3)) / 6.0
        } else {
            // Depth into the stop; its mean over a path that crosses the edge is the triangle's area.
            let side = self.edge.signum();
            let (p, q) = (side * a - self.edge.abs(), side * b - self.edge.abs());
            let mean = if p >= 0.0 && q >= 0.0 {
                0.5 * (p + q)
            } else if p.max(q) <= 0.0 {
                0.0
            } else {
                0.5 * p.max(q).powi(2) / (p - q).abs()
            };
            -side * mean
        };
    }
}

impl Effect for NonlinearSpring {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Position
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let mut all = vec![vec![scene.centre, 0.0]];
        for share in [0.3, 0.5, 0.65, 0.8, 0.9] {
            all.extend([share, -share].map(|s| vec![scene.centre, s * scene.travel]));
        }
        all
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Spring { centre: inner[0], edge: inner[1] })
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        let [centre, edge] = [setting.inner[0], setting.inner[1]];
        let centre_parameter = Parameter::new("centre", centre, Unit::Position);
        if edge == 0.0 {
            vec![Parameter::new("cubic", setting.strengths[0], Unit::CommandPerPositionCubed), centre_parameter]
        } else {
            vec![
                Parameter::new("stop_stiffness", setting.strengths[0], Unit::CommandPerPosition),
                Parameter::new("stop_position", centre + edge, Unit::Position),
                centre_parameter,
            ]
        }
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        let centre = given.or("centre", scene.centre);
        if given.has("stop_stiffness") {
            let edge = given.need("stop_position")? - centre;
            return Ok(Setting { inner: vec![centre, edge], strengths: vec![given.need("stop_stiffness")?] });
        }
        Ok(Setting { inner: vec![centre, 0.0], strengths: vec![given.need("cubic")?] })
    }
}
