//! The flex cable pulls: a spring that creeps, and stiffens to one side.
//!
//! tau = -k (x - x_c) - k2 (x - x0)², x_c' = (x - x_c)/tau_c (a spring in series with a dashpot, Maxwell's element). A plain
//! spring in parallel with a second-order body is a new natural frequency: a linear refit absorbs it. What it cannot absorb
//! is the creep and the curvature. A free inertia has no spring of its own, so there creep time 0 stands for the plain one.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use crate::lti::Body;

/// The cable. Its strengths are stiffness and curvature.
#[derive(Clone, Debug, PartialEq)]
pub struct CableSpring {
    /// Time constant of the creep (s), above 0; none for a plain spring.
    pub creep_time_s: Option<f64>,
    /// Position at which it does not pull (position_unit).
    pub centre: f64,
}

const STIFFNESS: Key = Key::new("stiffness", Unit::CommandPerPosition, "k");
const QUADRATIC: Key = Key::new("quadratic", Unit::CommandPerPositionSquared, "k2").or(0.0);
const CREEP_TIME_S: Key =
    Key::new("creep_time_s", Unit::Second, "time constant of the creep; 0 for none, which is tried on a free inertia")
        .or(0.0)
        .scan(ScanEnd::At(20.0, Measure::Sample), ScanEnd::At(2.0, Measure::Record));
const CENTRE: Key = Key::new("centre", Unit::Position, "where it does not pull, x0")
    .or_else("the middle of the stroke")
    .prior(Prior::Words("the middle of the positions"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "cable_spring",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = -k (x - x_c) - k2 (x - x0)^2, x_c' = (x - x_c)/tau_c (creep); k (x - x0) without creep",
    keys: &[STIFFNESS, QUADRATIC, CREEP_TIME_S, CENTRE],
    source: "W. N. Findley, J. S. Lai, K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976; A. Al Mamun, G. Guo, C. Bi, Hard Disk Drive: Mechatronics and Control, 2007",
    says: "the cable pulls on the arm like a spring that slowly gives way",
    confused_with: &["nonlinear_spring", "pivot_friction", "offset_drift", "linear_parameters", "bearing_bias"],
    experiment: "a staircase of long dwells over the stroke, upwards and downwards",
    band_hz: [0.1, 50.0],
};

struct Cable {
    /// Share of the stretch that is left after a sample, and its mean over the interval.
    keep: f64,
    mean: f64,
    creeps: bool,
    centre: f64,
    /// Stretch x - x_c.
    stretch: f64,
}

impl Law for Cable {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let (x0, x1) = (from.x - self.centre, to.x - self.centre);
        // Exact for a straight path: the stretch decays, and grows with the motion.
        let dx = to.x - from.x;
        out[0] = if self.creeps {
            -(self.stretch * self.mean + dx * (1.0 - self.mean) / -self.keep.ln())
        } else {
            -0.5 * (x0 + x1)
        };
        out[1] = -(x0 * x0 + x0 * x1 + x1 * x1) / 3.0;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.stretch = self.stretch * self.keep + (to.x - from.x) * self.mean;
    }
}

impl Parametric for CableSpring {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn changes_with_amplitude() -> bool {
        false
    }

    fn acts_on_body() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Position
    }

    fn grid(scene: &MotionScene) -> Vec<CableSpring> {
        let times = logarithmic(20.0 * scene.sample_time_s, 2.0 * scene.duration_s, 10);
        let at = |creep_time_s| CableSpring { creep_time_s, centre: scene.centre };
        let mut all: Vec<CableSpring> = times.into_iter().map(|tau| at(Some(tau))).collect();
        if matches!(scene.plant.body, Body::FreeInertia { .. }) {
            all.insert(0, at(None));
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![self.creep_time_s.as_mut(), Some(&mut self.centre)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let ratio = self.creep_time_s.map_or(1.0, |tau| scene.sample_time_s / tau);
        let mean = -(-ratio).exp_m1() / ratio;
        Box::new(Cable {
            keep: (-ratio).exp(),
            mean,
            creeps: self.creep_time_s.is_some(),
            centre: self.centre,
            stretch: 0.0,
        })
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![
            STIFFNESS.at(strengths[0]),
            QUADRATIC.at(strengths[1]),
            CREEP_TIME_S.at(self.creep_time_s.unwrap_or(0.0)),
            CENTRE.at(self.centre),
        ]
    }

    /// Bearings and cables hold to their laws to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(CableSpring, Vec<f64>), PhysicsError> {
        let creep_time_s = Some(given.or(&CREEP_TIME_S)?).filter(|tau| *tau > 0.0);
        let law = CableSpring { creep_time_s, centre: given.or_else(&CENTRE, scene.centre)? };
        Ok((law, vec![given.need(&STIFFNESS)?, given.or(&QUADRATIC)?]))
    }
}
