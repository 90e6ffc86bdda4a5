//! The sensor reads along a static curve of its own: folded like an absolute value, limited at both ends, or bent.
//!
//! Folded, as a pulse counter that does not see the direction: m = r + |x - c|, r the lowest reading. Limited: m = clip(x, low, high).
//! Bent: m = x + q (x - c)² + k (x - c)³. A fold hides which side the arm is on, so the library's search, which works along the recorded
//! motion, cannot see it; the estimation of curves does.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};
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

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "sensor_curve",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "folded: m = r + |x - c|; limited: m = clip(x, low, high); bent: m = x + q (x - c)^2 + k (x - c)^3",
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
    fn grid(_scene: &Scene) -> Vec<SensorCurve> {
        Vec::new()
    }

    fn in_motion(&self, _scene: &Scene) -> Box<dyn Law> {
        Box::new(Reading { curve: self.clone() })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        let position = |name, value| Parameter::new(name, value, Unit::Position);
        match *self {
            SensorCurve::Folded { lowest, at } => {
                vec![position("lowest_reading", lowest), position("fold_position", at)]
            }
            SensorCurve::Limited { low, high } => {
                vec![position("lowest_reading", low), position("highest_reading", high)]
            }
            SensorCurve::Bent { centre, quadratic, cubic } => vec![
                position("centre", centre),
                Parameter::new("quadratic", quadratic, Unit::PerPosition),
                Parameter::new("cubic", cubic, Unit::PerPositionSquared),
            ],
        }
    }

    /// A fold does not tell on which side the arm is.
    fn response_share(&self, _strengths: &[f64], _scene: &Scene, _w_rad_s: f64) -> Share {
        if matches!(self, SensorCurve::Folded { .. }) { Share::Blind } else { Share::Cycle }
    }

    fn setting_of(given: &Given, scene: &Scene) -> Result<(SensorCurve, Vec<f64>), PhysicsError> {
        if given.has("fold_position") {
            let at = given.need("fold_position")?;
            return Ok((SensorCurve::Folded { lowest: given.or("lowest_reading", at), at }, vec![1.0]));
        }
        if given.has("highest_reading") {
            let (low, high) = (given.need("lowest_reading")?, given.need("highest_reading")?);
            if low >= high {
                let expected = "a number above lowest_reading";
                let parameter = "highest_reading";
                return Err(PhysicsError::Range { effect: "sensor_curve", parameter, found: high, expected });
            }
            return Ok((SensorCurve::Limited { low, high }, vec![1.0]));
        }
        let (quadratic, cubic) = (given.need("quadratic")?, given.or("cubic", 0.0));
        Ok((SensorCurve::Bent { centre: given.or("centre", scene.centre), quadratic, cubic }, vec![1.0]))
    }
}
