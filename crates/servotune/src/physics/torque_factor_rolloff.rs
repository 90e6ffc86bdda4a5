//! The torque factor falls towards the ends of the stroke: an even function of the position, and a slope.
//!
//! The field of a magnet gap, expanded about its middle; the slope stands for a middle that is not the origin. Gaps with a part of even field
//! have corners that no expansion follows: there the fall ends, or only begins.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// The fall of the torque factor. Its strengths are those of -z i, -f(z) i, -z⁴ i, -z⁶ i with z = position over the travel; f is z² but
/// for shapes with a corner; the linear one moves the centre.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueFactorRolloff {
    /// The shape of the fall.
    pub shape: Shape,
}

/// The shape of a fall over the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A parabola.
    Parabola,
    /// A parabola that begins at a corner.
    Begins {
        /// Distance of the corner from the middle over the travel, above 0.
        corner: f64,
    },
    /// A parabola that ends at a corner.
    Ends {
        /// Distance of the corner from the middle over the travel, above 0.
        corner: f64,
    },
    /// An even polynomial with a slope.
    Polynomial,
}

/// Corners of the grid, over the travel: at either end of these a shape is a parabola or of no effect.
const CORNERS: [f64; 8] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.95];

const DROP_AT_15: Key = Key::new(
    "drop_at_15",
    Unit::Ratio,
    "loss of torque at 15 position units, where the travel is at least half of that",
)
.unless(&["curvature"])
.prior(Prior::Words("made from the others"));
const DROP_AT_TRAVEL: Key = Key::reported("drop_at_travel", Unit::Ratio, "loss of torque at the travel");
const CURVATURE: Key = Key::new("curvature", Unit::PerPositionSquared, "a").unless(&["drop_at_15"]);
const BEGINS_AT: Key = Key::new("begins_at", Unit::Position, "corner where a parabola begins")
    .or_else("no corner")
    .positive()
    .scan(ScanEnd::At(0.3, Measure::Travel), ScanEnd::At(0.95, Measure::Travel));
const ENDS_AT: Key = Key::new("ends_at", Unit::Position, "corner where a parabola ends")
    .or_else("no corner")
    .positive()
    .scan(ScanEnd::At(0.3, Measure::Travel), ScanEnd::At(0.95, Measure::Travel));
const SLOPE: Key = Key::new("slope", Unit::PerPosition, "s").or_else("no such term");
const QUARTIC: Key = Key::new("quartic", Unit::Named("1/position^4"), "b").or_else("no such term");
const SEXTIC: Key = Key::new("sextic", Unit::Named("1/position^6"), "c").or_else("no such term");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "torque_factor_rolloff",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 4,
    fixed: false,
    per_record: false,
    equation: "tau = Kt0 (1 - s x - a x^2 - b x^4 - c x^6) i; with a corner c: a min(|x|, c)^2, or a max(|x| - c, 0)^2",
    keys: &[DROP_AT_15, DROP_AT_TRAVEL, CURVATURE, BEGINS_AT, ENDS_AT, SLOPE, QUARTIC, SEXTIC],
    source: "A. Al Mamun, G. Guo, C. Bi, Hard Disk Drive: Mechatronics and Control, 2007",
    says: "the motor pushes less towards the ends of the stroke: the same current gives less torque there",
    confused_with: &["nonlinear_spring", "encoder_scale_error", "gain_drift", "cable_spring", "mode_shift"],
    experiment: "the same multisine in three or more zones of the stroke",
    band_hz: [1.0, 2000.0],
};

struct Rolloff {
    shape: Shape,
    travel: f64,
}

/// The even part's leading term at z.
fn bowl(shape: Shape, z: f64) -> f64 {
    let z = z.abs();
    match shape {
        Shape::Begins { corner } => (z - corner).max(0.0).powi(2),
        Shape::Ends { corner } => z.min(corner).powi(2),
        Shape::Parabola | Shape::Polynomial => z * z,
    }
}

impl Law for Rolloff {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        // The command is constant over the interval; functions of the position are averaged by Simpson's rule.
        let (a, c) = (from.x / self.travel, to.x / self.travel);
        let b = 0.5 * (a + c);
        let mean = |f: &dyn Fn(f64) -> f64| -from.i * (f(a) + 4.0 * f(b) + f(c)) / 6.0;
        out.fill(0.0);
        out[1] = mean(&|z| bowl(self.shape, z));
        if self.shape == Shape::Polynomial {
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
fn fall(shape: Shape, s: &[f64], z: f64) -> f64 {
    let lead = s[1] * bowl(shape, z);
    if shape == Shape::Polynomial { lead + s[2] * z.powi(4) + s[3] * z.powi(6) } else { lead }
}

impl Parametric for TorqueFactorRolloff {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::FactorOverPosition
    }

    fn grid(_scene: &MotionScene) -> Vec<TorqueFactorRolloff> {
        let begins = CORNERS.map(|corner| Shape::Begins { corner });
        let ends = CORNERS.map(|corner| Shape::Ends { corner });
        let all = [Shape::Parabola, Shape::Polynomial].into_iter().chain(begins).chain(ends);
        all.map(|shape| TorqueFactorRolloff { shape }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        match &mut self.shape {
            Shape::Parabola | Shape::Polynomial => vec![None],
            Shape::Begins { corner } | Shape::Ends { corner } => vec![Some(corner)],
        }
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.member()]
    }

    /// Shape and corner, of which a shape without one has it nowhere.
    fn told(&self) -> usize {
        2
    }

    fn member(&self) -> usize {
        match self.shape {
            Shape::Parabola => 1,
            Shape::Begins { .. } => 2,
            Shape::Ends { .. } => 3,
            Shape::Polynomial => 4,
        }
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        // The magnet's zones are told by the position as recorded.
        Box::new(Rolloff { shape: self.shape, travel: scene.travel * scene.arm_over_record() })
    }

    fn is_on_every_machine() -> bool {
        true
    }

    /// Between fields that fall as their curvature says (a parabola, a bell, the edge of a gap) the fall at one place differs by so much.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.07
    }

    /// A magnet's field falls towards its ends and does not rise again on the way.
    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        let at = |z: f64| fall(self.shape, strengths, z);
        let whole = at(1.0);
        let rises = |i: u8| at(f64::from(i) / 8.0) - at(f64::from(i - 1) / 8.0) > -RISE * whole;
        whole > 0.0 && (1..=8).all(rises)
    }

    fn parameters(&self, strengths: &[f64], scene: &MotionScene) -> Vec<Parameter> {
        let (s, l, shape) = (strengths, scene.travel, self.shape);
        // What a reader can picture first; the function after it, from which the law is made again.
        let mut all = vec![DROP_AT_TRAVEL.at(fall(shape, s, 1.0)), CURVATURE.at(s[1] / l.powi(2))];
        // Far beyond the motion a polynomial says nothing of a magnet.
        if KNOWN <= CONTINUED * l {
            all.insert(0, DROP_AT_15.at(fall(shape, s, KNOWN / l)));
        }
        match shape {
            Shape::Parabola => {}
            Shape::Begins { corner } => all.push(BEGINS_AT.at(corner * l)),
            Shape::Ends { corner } => all.push(ENDS_AT.at(corner * l)),
            Shape::Polynomial => {
                all.extend([SLOPE.at(s[0] / l), QUARTIC.at(s[2] / l.powi(4)), SEXTIC.at(s[3] / l.powi(6))])
            }
        }
        all
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(TorqueFactorRolloff, Vec<f64>), PhysicsError> {
        let l = scene.travel;
        let shape = if given.has(&BEGINS_AT) {
            Shape::Begins { corner: given.need(&BEGINS_AT)? / l }
        } else if given.has(&ENDS_AT) {
            Shape::Ends { corner: given.need(&ENDS_AT)? / l }
        } else if [SLOPE, QUARTIC, SEXTIC].iter().any(|k| given.has(k)) {
            Shape::Polynomial
        } else {
            Shape::Parabola
        };
        let lead = match given.need(&CURVATURE) {
            Ok(a) => a * l.powi(2),
            // A fall that begins beyond the known position is not told by it.
            Err(missing) => match bowl(shape, KNOWN / l) {
                known if known > 0.0 => given.need(&DROP_AT_15).map_err(|_| missing)? / known,
                _ => return Err(missing),
            },
        };
        let strengths = vec![
            given.or_else(&SLOPE, 0.0)? * l,
            lead,
            given.or_else(&QUARTIC, 0.0)? * l.powi(4),
            given.or_else(&SEXTIC, 0.0)? * l.powi(6),
        ];
        Ok((TorqueFactorRolloff { shape }, strengths))
    }
}
