//! The flex cable pulls: a spring that creeps, and stiffens to one side.
//!
//! tau = -k (x - x_c) - k2 (x - x0)², x_c' = (x - x_c)/tau_c (a spring in series with a dashpot, Maxwell's element). A plain
//! spring in parallel with a second-order body is a new natural frequency: a linear refit absorbs it. What it cannot absorb
//! is the creep and the curvature. A free inertia has no spring of its own, so there creep time 0 stands for the plain one.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};
use crate::lti::Body;

/// Inner: creep time (0: a plain spring), centre. Strengths: stiffness and curvature.
pub struct CableSpring;

static FACTS: Facts = Facts {
    name: "cable_spring",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = -k (x - x_c) - k2 (x - x0)^2, x_c' = (x - x_c)/tau_c (creep); k (x - x0) without creep",
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

impl Effect for CableSpring {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Position
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let times = logarithmic(20.0 * scene.sample_time_s, 2.0 * scene.duration_s, 10);
        let mut all: Vec<Vec<f64>> = times.into_iter().map(|tau| vec![tau, scene.centre]).collect();
        if matches!(scene.plant.body, Body::FreeInertia { .. }) {
            all.insert(0, vec![0.0, scene.centre]);
        }
        all
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        let creeps = inner[0] > 0.0;
        let ratio = if creeps { scene.sample_time_s / inner[0] } else { 1.0 };
        let mean = -(-ratio).exp_m1() / ratio;
        Box::new(Cable { keep: (-ratio).exp(), mean, creeps, centre: inner[1], stretch: 0.0 })
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("stiffness", setting.strengths[0], Unit::CommandPerPosition),
            Parameter::new("quadratic", setting.strengths[1], Unit::CommandPerPositionSquared),
            Parameter::new("creep_time_s", setting.inner[0], Unit::Second),
            Parameter::new("centre", setting.inner[1], Unit::Position),
        ]
    }

    /// Bearings and cables hold to their laws to about a hundredth.
    fn form_uncertainty(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        let inner = vec![given.or("creep_time_s", 0.0), given.or("centre", scene.centre)];
        Ok(Setting { inner, strengths: vec![given.need("stiffness")?, given.or("quadratic", 0.0)] })
    }
}
