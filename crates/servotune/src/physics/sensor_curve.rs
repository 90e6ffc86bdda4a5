//! The sensor reads along a static curve of its own: folded like an absolute value, limited at both ends, or bent.
//!
//! Folded, as a pulse counter that does not see the direction: m = r + |x - c|, r the lowest reading. Limited: m = clip(x, low, high).
//! Bent: m = x + q (x - c)² + k (x - c)³. A fold hides which side the arm is on, so the library's search, which works along the recorded
//! motion, cannot see it; the estimation of curves does.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Prior, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;

/// The curve that the sensor reads.
#[derive(Clone, Debug, PartialEq)]
pub enum SensorCurve {
    /// Never below a lowest reading, rising to both sides.
    Folded {
        /// Lowest reading (position_unit).
        lowest: f64,
        /// Position at which it is read (position_unit).
        at: f64,
    },
    /// Between two limits.
    Limited {
        /// Lowest reading (position_unit).
        low: f64,
        /// Highest reading (position_unit), not below the lowest.
        high: f64,
    },
    /// Bent.
    Bent {
        /// Position at which it reads right (position_unit).
        centre: f64,
        /// Coefficient of the square (1/position_unit).
        quadratic: f64,
        /// Coefficient of the cube (1/position_unit²).
        cubic: f64,
    },
}

const LOWEST_READING: Key = Key::new(
    "lowest_reading",
    Unit::Position,
    "lowest reading, r or low; of a fold alone it may be left out: the place of the fold",
)
.unless(&["fold_position", "quadratic"])
.prior(Prior::Words("the estimation of curves"));
const FOLD_POSITION: Key = Key::new("fold_position", Unit::Position, "where a folded curve turns, c")
    .unless(&["highest_reading", "quadratic"])
    .prior(Prior::Words("the estimation of curves"));
const HIGHEST_READING: Key = Key::new("highest_reading", Unit::Position, "highest reading")
    .unless(&["fold_position", "quadratic"])
    .takes(Takes::Law("a number above lowest_reading"))
    .prior(Prior::Words("the estimation of curves"));
const QUADRATIC: Key = Key::new("quadratic", Unit::PerPosition, "q of a bent curve")
    .unless(&["fold_position", "highest_reading"])
    .prior(Prior::Words("the estimation of curves"));
const CUBIC: Key = Key::new("cubic", Unit::PerPositionSquared, "k of a bent curve")
    .or(0.0)
    .beside("quadratic")
    .prior(Prior::Words("the estimation of curves"));
const CENTRE: Key = Key::new("centre", Unit::Position, "where a bent curve reads right, c")
    .or_else("the middle of the stroke")
    .beside("quadratic")
    .prior(Prior::Words("the estimation of curves"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "sensor_curve",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "folded: m = r + |x - c|; limited: m = clip(x, low, high); bent: m = x + q (x - c)^2 + k (x - c)^3",
    keys: &[LOWEST_READING, FOLD_POSITION, HIGHEST_READING, QUADRATIC, CUBIC, CENTRE],
    source: "J. Fraden, Handbook of Modern Sensors, 4th edition, 2010",
    says: "the sensor does not read the position itself but a curve of it: folded like an absolute value, limited, or bent",
    confused_with: &["encoder_scale_error", "free_form", "nonlinear_spring"],
    experiment: "a slow ramp over the whole range in both directions, read by a second sensor",
    band_hz: [0.1, 3000.0],
};

impl SensorCurve {
    /// What is read at `x` (position_unit).
    fn reading(&self, x: f64) -> f64 {
        match *self {
            SensorCurve::Folded { lowest, at } => lowest + (x - at).abs(),
            SensorCurve::Limited { low, high } => x.max(low).min(high),
            SensorCurve::Bent { centre, quadratic, cubic } => {
                x + (quadratic + cubic * (x - centre)) * (x - centre).powi(2)
            }
        }
    }
}

struct Reading {
    curve: SensorCurve,
}

impl Law for Reading {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.curve.reading(to.x) - to.x;
    }
}

impl Parametric for SensorCurve {
    fn known() -> &'static Facts {
        &FACTS
    }

    /// None: along a folded or limited record nothing is seen of the motion behind it.
    fn grid(_scene: &MotionScene) -> Vec<SensorCurve> {
        Vec::new()
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Reading { curve: self.clone() })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        match *self {
            SensorCurve::Folded { lowest, at } => vec![LOWEST_READING.at(lowest), FOLD_POSITION.at(at)],
            SensorCurve::Limited { low, high } => vec![LOWEST_READING.at(low), HIGHEST_READING.at(high)],
            SensorCurve::Bent { centre, quadratic, cubic } => {
                vec![CENTRE.at(centre), QUADRATIC.at(quadratic), CUBIC.at(cubic)]
            }
        }
    }

    /// A fold does not tell on which side the arm is.
    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        if matches!(self, SensorCurve::Folded { .. }) { Share::Blind } else { Share::Cycle }
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(SensorCurve, Vec<f64>), PhysicsError> {
        if given.has(&FOLD_POSITION) {
            let at = given.need(&FOLD_POSITION)?;
            return Ok((SensorCurve::Folded { lowest: given.or_else(&LOWEST_READING, at)?, at }, vec![1.0]));
        }
        if given.has(&HIGHEST_READING) {
            let (low, high) = (given.need(&LOWEST_READING)?, given.need(&HIGHEST_READING)?);
            if low >= high {
                return Err(given.refused(&HIGHEST_READING, high));
            }
            return Ok((SensorCurve::Limited { low, high }, vec![1.0]));
        }
        let (quadratic, cubic) = (given.need(&QUADRATIC)?, given.or(&CUBIC)?);
        Ok((SensorCurve::Bent { centre: given.or_else(&CENTRE, scene.centre)?, quadratic, cubic }, vec![1.0]))
    }
}
