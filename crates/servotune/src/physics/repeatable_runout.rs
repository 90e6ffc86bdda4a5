//! What repeats with every revolution of the spindle: runout of disk and spindle, seen in the position.
//!
//! m = x + sum over h = 1, 2, 3 of a_h cos(h n psi + phi_h), psi the spindle's angle, n the base order. Harmonics of orders,
//! not of hertz: where the spindle's speed moves, the lines move with it.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;
use std::f64::consts::TAU;

/// The run-out. Its strengths are cosine and sine of three harmonics.
#[derive(Clone, Debug, PartialEq)]
pub struct RepeatableRunout {
    /// Frequency of the base order (Hz), above 0.
    pub base_hz: f64,
}

const BASE_HZ: Key = Key::new("base_hz", Unit::Hertz, "base order")
    .positive()
    .scan(ScanEnd::At(1.0, Measure::Spindle), ScanEnd::At(8.0, Measure::Spindle));
const AMPLITUDE: Key = Key::new("amplitude", Unit::Position, "first harmonic");
const PHASE_DEG: Key = Key::new("phase_deg", Unit::Degree, "its phase").or(0.0);
const AMPLITUDE_2: Key = Key::new("amplitude_2", Unit::Position, "second harmonic").or(0.0);
const PHASE_2_DEG: Key = Key::new("phase_2_deg", Unit::Degree, "its phase").or(0.0);
const AMPLITUDE_3: Key = Key::new("amplitude_3", Unit::Position, "third harmonic").or(0.0);
const PHASE_3_DEG: Key = Key::new("phase_3_deg", Unit::Degree, "its phase").or(0.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "repeatable_runout",
    port: Port::Disk,
    entry: Entry::Position,
    columns: 6,
    fixed: false,
    per_record: false,
    equation: "m = x + sum_h a_h cos(h n psi + phi_h), h = 1, 2, 3, psi the spindle's angle",
    keys: &[BASE_HZ, AMPLITUDE, PHASE_DEG, AMPLITUDE_2, PHASE_2_DEG, AMPLITUDE_3, PHASE_3_DEG],
    source: "D. Abramovitch, G. Franklin, A Brief History of Disk Drive Control, IEEE Control Systems Magazine 22(3), 2002",
    says: "the error repeats with every turn of the spindle: something on it runs out of round",
    confused_with: &["line_disturbance", "parametric_gain"],
    experiment: "the same move with the spindle one percent faster: runout follows the spindle, mains does not",
    band_hz: [10.0, 2000.0],
};

const AMPLITUDES: [Key; 3] = [AMPLITUDE, AMPLITUDE_2, AMPLITUDE_3];
const PHASES: [Key; 3] = [PHASE_DEG, PHASE_2_DEG, PHASE_3_DEG];

struct Runout {
    /// Whole order of the spindle, or none and then hertz.
    order: Option<f64>,
    hz: f64,
}

impl Law for Runout {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        let angle = self.order.map_or_else(|| TAU * self.hz * to.t, |n| n * to.spindle_rad);
        for h in 0..3 {
            let (sin, cos) = ((h + 1) as f64 * angle).sin_cos();
            (out[2 * h], out[2 * h + 1]) = (cos, sin);
        }
    }
}

impl Parametric for RepeatableRunout {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Spindle
    }

    fn grid(scene: &MotionScene) -> Vec<RepeatableRunout> {
        let Some(spindle) = scene.spindle_hz else { return Vec::new() };
        (1..=8)
            .map(|n| f64::from(n) * spindle)
            .filter(|f| 3.0 * f < scene.nyquist_hz())
            .map(|base_hz| RepeatableRunout { base_hz })
            .collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.base_hz)]
    }

    /// An order of the spindle is a whole number of turns: each is a thing of its own, and none is moved.
    fn member(&self) -> usize {
        self.base_hz.to_bits() as usize
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        // A recorded angle may wrap at one turn: only whole orders may be taken from it.
        let ratio = scene.spindle_hz.map(|s| self.base_hz / s);
        let order = ratio.map(f64::round).filter(|n| *n >= 1.0 && ratio.is_some_and(|r| (r - n).abs() < 1e-2));
        Box::new(Runout { order, hz: self.base_hz })
    }

    fn may_occur_several_times() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![BASE_HZ.at(self.base_hz)];
        for (h, pair) in strengths.chunks_exact(2).take(3).enumerate() {
            all.push(AMPLITUDES[h].at(pair[0].hypot(pair[1])));
            all.push(PHASES[h].at((-pair[1]).atan2(pair[0]).to_degrees()));
        }
        all
    }

    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(RepeatableRunout, Vec<f64>), PhysicsError> {
        let mut strengths = Vec::with_capacity(6);
        for h in 0..3 {
            let (amplitude, phase) = (given.or(&AMPLITUDES[h])?, given.or(&PHASES[h])?.to_radians());
            strengths.extend([amplitude * phase.cos(), -amplitude * phase.sin()]);
        }
        Ok((RepeatableRunout { base_hz: given.need(&BASE_HZ)? }, strengths))
    }
}
