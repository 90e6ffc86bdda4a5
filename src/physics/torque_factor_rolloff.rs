//! The torque factor falls towards the ends of the stroke: an even polynomial of the position, and a slope.
//!
//! The field of a magnet gap, expanded about its middle; the slope stands for a middle that is not the origin.

use super::effect::{Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
use super::sample::{Sample, Scene};

/// Strengths: of -z i, -z² i, -z⁴ i, -z⁶ i with z = position over the travel; the linear one moves the centre.
pub struct TorqueFactorRolloff;

static FACTS: Facts = Facts {
    name: "torque_factor_rolloff",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 4,
    fixed: false,
    per_record: false,
    equation: "tau = Kt0 (1 - s x - a x^2 - b x^4 - c x^6) i",
    says: "the motor pushes less towards the ends of the stroke: the same current gives less torque there",
    confused_with: &["gain_drift", "cable_spring", "mode_shift"],
    experiment: "the same multisine in three or more zones of the stroke",
    band_hz: [1.0, 2000.0],
};

struct Rolloff {
    /// Whether slope, quartic and sextic are there beside the curvature.
    whole: bool,
    travel: f64,
}

impl Law for Rolloff {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        // The command is constant over the interval; the powers of the position are averaged by Simpson's rule.
        let (a, c) = (from.x / self.travel, to.x / self.travel);
        let b = 0.5 * (a + c);
        let mean = |f: fn(f64) -> f64| -from.i * (f(a) + 4.0 * f(b) + f(c)) / 6.0;
        out.fill(0.0);
        out[1] = mean(|z| z * z);
        if self.whole {
            (out[0], out[2], out[3]) = (mean(|z| z), mean(|z| z.powi(4)), mean(|z| z.powi(6)));
        }
    }
}

/// Share of the whole fall by which the torque factor may seem to rise over an eighth of the way: noise, not shape.
const RISE: f64 = 0.05;

/// The position (position_unit) at which the paper's machines are compared, and how far beyond the travel the polynomial may be read.
const KNOWN: f64 = 15.0;
const CONTINUED: f64 = 2.0;

/// Fall of the torque factor at a position, over its value at 0.
fn drop(strengths: &[f64], z: f64) -> f64 {
    strengths[0] * z + strengths[1] * z * z + strengths[2] * z.powi(4) + strengths[3] * z.powi(6)
}

impl Effect for TorqueFactorRolloff {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn grid(&self, _scene: &Scene) -> Vec<Vec<f64>> {
        // The curvature alone first: most magnets ask for no more.
        vec![vec![1.0], vec![4.0]]
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        // The magnet's zones are told by the position as recorded.
        Box::new(Rolloff { whole: inner[0] > 1.5, travel: scene.travel * scene.arm_over_record() })
    }

    /// Between fields that fall as their curvature says (a parabola, a bell, the edge of a gap) the fall at one place differs by so much.
    fn form(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.07
    }

    /// A magnet's field falls towards its ends and does not rise again on the way.
    fn possible(&self, setting: &Setting, _errors: &[f64]) -> bool {
        let s = &setting.strengths;
        let even = |z: f64| if setting.inner[0] > 1.5 { 0.5 * (drop(s, z) + drop(s, -z)) } else { s[1] * z * z };
        let whole = even(1.0);
        whole > 0.0 && (1..=8).all(|i| even(f64::from(i) / 8.0) - even(f64::from(i - 1) / 8.0) > -RISE * whole)
    }

    fn parameters(&self, setting: &Setting, scene: &Scene) -> Vec<Parameter> {
        let (s, l) = (&setting.strengths, scene.travel);
        let only = [0.0, s[1], 0.0, 0.0];
        let s: &[f64] = if setting.inner[0] > 1.5 { s } else { &only };
        let at = |x: f64| 0.5 * (drop(s, x / l) + drop(s, -x / l));
        // What a reader can picture first; the polynomial after it, from which the law is made again.
        let mut all = vec![
            Parameter::new("drop_at_travel", at(l), Unit::Ratio),
            Parameter::new("curvature", s[1] / l.powi(2), Unit::PerPositionSquared),
        ];
        // Far beyond the motion a polynomial says nothing of a magnet.
        if KNOWN <= CONTINUED * l {
            all.insert(0, Parameter::new("drop_at_15", at(KNOWN), Unit::Ratio));
        }
        if setting.inner[0] > 1.5 {
            all.push(Parameter::new("slope", s[0] / l, Unit::PerPosition));
            all.push(Parameter::new("quartic", s[2] / l.powi(4), Unit::Named("1/position^4")));
            all.push(Parameter::new("sextic", s[3] / l.powi(6), Unit::Named("1/position^6")));
        }
        all
    }

    fn restore(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        let l = scene.travel;
        let curvature = match given.need("curvature") {
            Ok(a) => a,
            Err(missing) => given.need("drop_at_15").map_err(|_| missing)? / KNOWN.powi(2),
        };
        let strengths = vec![
            given.or("slope", 0.0) * l,
            curvature * l.powi(2),
            given.or("quartic", 0.0) * l.powi(4),
            given.or("sextic", 0.0) * l.powi(6),
        ];
        let terms = if ["slope", "quartic", "sextic"].iter().any(|p| given.has(p)) { 4.0 } else { 1.0 };
        Ok(Setting { inner: vec![terms], strengths })
    }
}
