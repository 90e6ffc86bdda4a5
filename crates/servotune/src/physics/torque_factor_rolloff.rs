//! The torque factor falls towards the ends of the stroke: an even function of the position, and a slope.
//!
//! The field of a magnet gap, expanded about its middle; the slope stands for a middle that is not the origin. Gaps with a part of even field
//! have corners that no expansion follows: there the fall ends, or only begins.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};

/// Inner: which shape, and the position of its corner over the travel. Strengths: of -z i, -f(z) i, -z⁴ i, -z⁶ i with z = position over the
/// travel; f is z² but for shapes with a corner; the linear one moves the centre.
pub struct TorqueFactorRolloff;

/// Shapes, as the first inner number: a parabola; one that begins at the corner; one that ends there; an even polynomial with a slope.
const PARABOLA: f64 = 1.0;
const BEGINS: f64 = 2.0;
const ENDS: f64 = 3.0;
const POLYNOMIAL: f64 = 4.0;

/// Corners of the grid, over the travel: at either end of these a shape is a parabola or of no effect.
const CORNERS: [f64; 8] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.95];

static FACTS: Facts = Facts {
    name: "torque_factor_rolloff",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 4,
    fixed: false,
    per_record: false,
    equation: "tau = Kt0 (1 - s x - a x^2 - b x^4 - c x^6) i; with a corner c: a min(|x|, c)^2, or a max(|x| - c, 0)^2",
    says: "the motor pushes less towards the ends of the stroke: the same current gives less torque there",
    confused_with: &["nonlinear_spring", "encoder_scale_error", "gain_drift", "cable_spring", "mode_shift"],
    experiment: "the same multisine in three or more zones of the stroke",
    band_hz: [1.0, 2000.0],
};

struct Rolloff {
    shape: f64,
    corner: f64,
    travel: f64,
}

/// The even part's leading term at z.
fn bowl(shape: f64, corner: f64, z: f64) -> f64 {
    let z = z.abs();
    if shape == BEGINS {
        (z - corner).max(0.0).powi(2)
    } else if shape == ENDS {
        z.min(corner).powi(2)
    } else {
        z * z
    }
}

impl Law for Rolloff {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        // The command is constant over the interval; functions of the position are averaged by Simpson's rule.
        let (a, c) = (from.x / self.travel, to.x / self.travel);
        let b = 0.5 * (a + c);
        let mean = |f: &dyn Fn(f64) -> f64| -from.i * (f(a) + 4.0 * f(b) + f(c)) / 6.0;
        out.fill(0.0);
        out[1] = mean(&|z| bowl(self.shape, self.corner, z));
        if self.shape == POLYNOMIAL {
            (out[0], out[2], out[3]) = (mean(&|z| z), mean(&|z| z.powi(4)), mean(&|z| z.powi(6)));
        }
    }
}

/// Share of the whole fall by which the torque factor may seem to rise over an eighth of the way: noise, not shape.
const RISE: f64 = 0.05;

/// The position (position_unit) at which the paper's machines are compared, and how far beyond the travel the polynomial may be read.
const KNOWN: f64 = 15.0;
const CONTINUED: f64 = 2.0;

/// Even part of the fall of the torque factor at z, over its value in the middle.
fn fall(setting: &Setting, z: f64) -> f64 {
    let s = &setting.strengths;
    let lead = s[1] * bowl(setting.inner[0], setting.inner[1], z);
    if setting.inner[0] == POLYNOMIAL { lead + s[2] * z.powi(4) + s[3] * z.powi(6) } else { lead }
}

impl Effect for TorqueFactorRolloff {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::FactorOverPosition
    }

    fn scan_points(&self, _scene: &Scene) -> Vec<Vec<f64>> {
        let cornered = [BEGINS, ENDS].into_iter().flat_map(|shape| CORNERS.map(|corner| vec![shape, corner]));
        [vec![PARABOLA, 1.0], vec![POLYNOMIAL, 1.0]].into_iter().chain(cornered).collect()
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        // The magnet's zones are told by the position as recorded.
        Box::new(Rolloff { shape: inner[0], corner: inner[1], travel: scene.travel * scene.arm_over_record() })
    }

    fn is_on_every_machine(&self) -> bool {
        true
    }

    /// Between fields that fall as their curvature says (a parabola, a bell, the edge of a gap) the fall at one place differs by so much.
    fn form_uncertainty(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.07
    }

    /// A magnet's field falls towards its ends and does not rise again on the way.
    fn is_possible(&self, setting: &Setting, _errors: &[f64]) -> bool {
        let whole = fall(setting, 1.0);
        let rises = |i: u8| fall(setting, f64::from(i) / 8.0) - fall(setting, f64::from(i - 1) / 8.0) > -RISE * whole;
        whole > 0.0 && (1..=8).all(rises)
    }

    fn parameters(&self, setting: &Setting, scene: &Scene) -> Vec<Parameter> {
        let (s, l, shape) = (&setting.strengths, scene.travel, setting.inner[0]);
        // What a reader can picture first; the function after it, from which the law is made again.
        let mut all = vec![
            Parameter::new("drop_at_travel", fall(setting, 1.0), Unit::Ratio),
            Parameter::new("curvature", s[1] / l.powi(2), Unit::PerPositionSquared),
        ];
        // Far beyond the motion a polynomial says nothing of a magnet.
        if KNOWN <= CONTINUED * l {
            all.insert(0, Parameter::new("drop_at_15", fall(setting, KNOWN / l), Unit::Ratio));
        }
        if shape == BEGINS || shape == ENDS {
            let name = if shape == BEGINS { "begins_at" } else { "ends_at" };
            all.push(Parameter::new(name, setting.inner[1] * l, Unit::Position));
        }
        if shape == POLYNOMIAL {
            all.push(Parameter::new("slope", s[0] / l, Unit::PerPosition));
            all.push(Parameter::new("quartic", s[2] / l.powi(4), Unit::Named("1/position^4")));
            all.push(Parameter::new("sextic", s[3] / l.powi(6), Unit::Named("1/position^6")));
        }
        all
    }

    fn setting_of(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        let l = scene.travel;
        let inner = if given.has("begins_at") {
            vec![BEGINS, given.positive("begins_at")? / l]
        } else if given.has("ends_at") {
            vec![ENDS, given.positive("ends_at")? / l]
        } else if ["slope", "quartic", "sextic"].iter().any(|p| given.has(p)) {
            vec![POLYNOMIAL, 1.0]
        } else {
            vec![PARABOLA, 1.0]
        };
        let lead = match given.need("curvature") {
            Ok(a) => a * l.powi(2),
            // A fall that begins beyond the known position is not told by it.
            Err(missing) => match bowl(inner[0], inner[1], KNOWN / l) {
                known if known > 0.0 => given.need("drop_at_15").map_err(|_| missing)? / known,
                _ => return Err(missing),
            },
        };
        let strengths = vec![
            given.or("slope", 0.0) * l,
            lead,
            given.or("quartic", 0.0) * l.powi(4),
            given.or("sextic", 0.0) * l.powi(6),
        ];
        Ok(Setting { inner, strengths })
    }
}
