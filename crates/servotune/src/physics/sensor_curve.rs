//! The sensor reads along a static curve of its own: folded like an absolute value, limited at both ends, or bent.
//!
//! Folded, as a pulse counter that does not see the direction: m = r + |x - c|, r the lowest reading. Limited: m = clip(x, low, high).
//! Bent: m = x + q (x - c)² + k (x - c)³. A fold hides which side the arm is on, so the library's search, which works along the recorded
//! motion, cannot see it; the estimation of curves does.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};
use super::share::Share;

/// Inner: form, then fold (lowest reading, place), limits (low, high), or bend (centre, quadratic, cubic).
pub struct SensorCurve;

/// Forms.
const FOLDED: f64 = 0.0;
const LIMITED: f64 = 1.0;
const BENT: f64 = 2.0;

static FACTS: Facts = Facts {
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
    /// A reading that is never below `lowest` and is there at `at`.
    pub fn folded(lowest: f64, at: f64) -> Setting {
        Setting { inner: vec![FOLDED, lowest, at], strengths: vec![1.0] }
    }

    /// A reading within two limits.
    pub fn limited(low: f64, high: f64) -> Setting {
        Setting { inner: vec![LIMITED, low, high], strengths: vec![1.0] }
    }
}

/// What is read at `x`.
fn reading(inner: &[f64], x: f64) -> f64 {
    match *inner {
        [form, lowest, at] if form == FOLDED => lowest + (x - at).abs(),
        [_, low, high] => x.max(low).min(high),
        [_, centre, quadratic, cubic] => x + (quadratic + cubic * (x - centre)) * (x - centre).powi(2),
        _ => x,
    }
}

struct Reading {
    inner: Vec<f64>,
}

impl Law for Reading {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = reading(&self.inner, to.x) - to.x;
    }
}

impl Effect for SensorCurve {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    /// None: along a folded or limited record nothing is seen of the motion behind it.
    fn scan_points(&self, _scene: &Scene) -> Vec<Vec<f64>> {
        Vec::new()
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Reading { inner: inner.to_vec() })
    }

    fn is_hard_nonlinearity(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        let named = |name, i: usize, unit| Parameter::new(name, setting.inner[i], unit);
        match setting.inner[0] {
            FOLDED => {
                vec![named("lowest_reading", 1, Unit::Position), named("fold_position", 2, Unit::Position)]
            }
            LIMITED => vec![named("lowest_reading", 1, Unit::Position), named("highest_reading", 2, Unit::Position)],
            _ => vec![
                named("centre", 1, Unit::Position),
                named("quadratic", 2, Unit::PerPosition),
                named("cubic", 3, Unit::PerPositionSquared),
            ],
        }
    }

    /// A fold does not tell on which side the arm is.
    fn response_share(&self, setting: &Setting, _scene: &Scene, _w_rad_s: f64) -> Share {
        if setting.inner[0] == FOLDED { Share::Blind } else { Share::Cycle }
    }

    fn setting_of(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        if given.has("fold_position") {
            let at = given.need("fold_position")?;
            return Ok(SensorCurve::folded(given.or("lowest_reading", at), at));
        }
        if given.has("highest_reading") {
            let (low, high) = (given.need("lowest_reading")?, given.need("highest_reading")?);
            if low >= high {
                let expected = "a number above lowest_reading";
                let parameter = "highest_reading";
                return Err(PhysicsError::Range { effect: "sensor_curve", parameter, found: high, expected });
            }
            return Ok(SensorCurve::limited(low, high));
        }
        let centre = given.or("centre", scene.centre);
        let inner = vec![BENT, centre, given.need("quadratic")?, given.or("cubic", 0.0)];
        Ok(Setting { inner, strengths: vec![1.0] })
    }
}
