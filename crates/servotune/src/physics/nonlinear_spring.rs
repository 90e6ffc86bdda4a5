//! A spring that stiffens with the distance, or a stop at one end of the stroke.
//!
//! tau = -k3 (x - x0)³ (Duffing), or tau = -k max(0, x - x_e) beyond an upper stop, mirrored for a lower one. Means over an
//! interval are exact for a straight path (Simpson's rule for the cubic).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Prior};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// The spring. Its strength is k3 or the stop's stiffness.
#[derive(Clone, Debug, PartialEq)]
pub struct NonlinearSpring {
    /// Position that it pushes back to (position_unit).
    pub centre: f64,
    /// How it stiffens.
    pub stiffening: Stiffening,
}

/// How a spring stiffens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stiffening {
    /// With the cube of the distance.
    Cubic,
    /// At a stop.
    Stop {
        /// Position of the stop less the centre (position_unit); an upper stop lies above 0, a lower one below.
        offset: f64,
    },
}

const CUBIC: Key = Key::new("cubic", Unit::CommandPerPositionCubed, "k3").unless(&["stop_stiffness"]);
const STOP_STIFFNESS: Key = Key::new("stop_stiffness", Unit::CommandPerPosition, "k of a stop").unless(&["cubic"]);
const STOP_POSITION: Key = Key::new("stop_position", Unit::Position, "where the stop begins")
    .beside("stop_stiffness")
    .prior(Prior::Words("0.3, 0.5, 0.65, 0.8 and 0.9 travel to either side of the centre"));
const CENTRE: Key = Key::new("centre", Unit::Position, "where it pushes to, x0")
    .or_else("the middle of the stroke")
    .prior(Prior::Words("the middle of the positions"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "nonlinear_spring",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -k3 (x - x0)^3, or -k max(0, x - x_e) at a stop",
    keys: &[CUBIC, STOP_STIFFNESS, STOP_POSITION, CENTRE],
    source: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979",
    says: "the arm is pushed back harder the farther it goes, as by a stiffening spring or a stop",
    confused_with: &["cable_spring", "pivot_friction", "torque_ripple", "torque_factor_rolloff"],
    experiment: "the same multisine at two amplitudes: a stiffening spring raises the low resonance and adds no damping",
    band_hz: [1.0, 200.0],
};

struct Spring {
    centre: f64,
    stiffening: Stiffening,
}

impl Law for Spring {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let (a, b) = (from.x - self.centre, to.x - self.centre);
        let Stiffening::Stop { offset } = self.stiffening else {
            let middle = 0.5 * (a + b);
            out[0] = -(a.powi(3) + 4.0 * middle.powi(3) + b.powi(3)) / 6.0;
            return;
        };
        out[0] = {
            // Depth into the stop; its mean over a path that crosses the edge is the triangle's area.
            let side = offset.signum();
            let (p, q) = (side * a - offset.abs(), side * b - offset.abs());
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

impl Parametric for NonlinearSpring {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn acts_on_body() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Position
    }

    fn grid(scene: &MotionScene) -> Vec<NonlinearSpring> {
        let at = |stiffening| NonlinearSpring { centre: scene.centre, stiffening };
        let mut all = vec![at(Stiffening::Cubic)];
        for share in [0.3, 0.5, 0.65, 0.8, 0.9] {
            all.extend([share, -share].map(|s| at(Stiffening::Stop { offset: s * scene.travel })));
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        let offset = match &mut self.stiffening {
            Stiffening::Cubic => None,
            Stiffening::Stop { offset } => Some(offset),
        };
        vec![Some(&mut self.centre), offset]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Spring { centre: self.centre, stiffening: self.stiffening })
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let centre = CENTRE.at(self.centre);
        match self.stiffening {
            Stiffening::Cubic => vec![CUBIC.at(strengths[0]), centre],
            Stiffening::Stop { offset } => {
                vec![STOP_STIFFNESS.at(strengths[0]), STOP_POSITION.at(self.centre + offset), centre]
            }
        }
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(NonlinearSpring, Vec<f64>), PhysicsError> {
        let centre = given.or_else(&CENTRE, scene.centre)?;
        if given.has(&STOP_STIFFNESS) {
            let offset = given.need(&STOP_POSITION)? - centre;
            let law = NonlinearSpring { centre, stiffening: Stiffening::Stop { offset } };
            return Ok((law, vec![given.need(&STOP_STIFFNESS)?]));
        }
        Ok((NonlinearSpring { centre, stiffening: Stiffening::Cubic }, vec![given.need(&CUBIC)?]))
    }
}
