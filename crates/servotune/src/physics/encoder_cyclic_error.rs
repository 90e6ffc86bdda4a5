//! The encoder's error within one period of its grating: a line in position, not in time.
//!
//! m = x + sum over h = 1, 2 of a_h cos(2 pi h x/P + phi_h): offsets of the two photocurrents give the first harmonic, unequal
//! amplitudes and a phase that is not 90 degrees the second (Heydemann 1981).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use std::f64::consts::TAU;

/// The wave of the grating. Its strengths are cosine and sine of each harmonic.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderCyclicError {
    /// Period of the grating (position_unit), above 0.
    pub period: f64,
    /// Which harmonics it has.
    pub harmonics: Harmonics,
}

/// The harmonics of a wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Harmonics {
    /// The first alone.
    First,
    /// The first and the second.
    FirstAndSecond,
}

const AMPLITUDE: Key = Key::new("amplitude", Unit::Position, "first harmonic");
const PERIOD: Key = Key::new("period", Unit::Position, "length of the wave")
    .positive()
    .scan(ScanEnd::Greatest(&[(8.0, Measure::Noise), (0.01, Measure::Travel)]), ScanEnd::At(0.6, Measure::Travel));
const PHASE_DEG: Key = Key::new("phase_deg", Unit::Degree, "phase").or(0.0);
const AMPLITUDE_2: Key = Key::new("amplitude_2", Unit::Position, "second harmonic").or_else("the first alone");
const PHASE_2_DEG: Key = Key::new("phase_2_deg", Unit::Degree, "its phase").or(0.0).beside("amplitude_2");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "encoder_cyclic_error",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 4,
    fixed: false,
    per_record: false,
    equation: "m = x + sum_h a_h cos(2 pi h x/P + phi_h), h = 1, 2",
    keys: &[AMPLITUDE, PERIOD, PHASE_DEG, AMPLITUDE_2, PHASE_2_DEG],
    source: "P. L. M. Heydemann, Determination and Correction of Quadrature Fringe Measurement Errors in Interferometers, Applied Optics 20(19), 1981",
    says: "the encoder reads wrong by a wave that repeats with the position: its lines are not evenly interpolated",
    confused_with: &["torque_ripple", "unmodelled_resonance", "line_disturbance"],
    experiment: "constant-velocity moves at three speeds: the line moves with the speed",
    band_hz: [1.0, 5000.0],
};

struct Wave {
    period: f64,
    second: bool,
}

impl Law for Wave {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        let (sin, cos) = (TAU * to.x / self.period).sin_cos();
        (out[0], out[1]) = (cos, sin);
        let second = if self.second { (cos * cos - sin * sin, 2.0 * sin * cos) } else { (0.0, 0.0) };
        (out[2], out[3]) = second;
    }
}

/// Second harmonic over the first from which the wave is one of half the period.
const CARRIES: f64 = 2.0;

impl EncoderCyclicError {
    fn second(&self) -> bool {
        self.harmonics == Harmonics::FirstAndSecond
    }
}

impl Parametric for EncoderCyclicError {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn is_wave_over_position() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Position
    }

    fn grid(scene: &MotionScene) -> Vec<EncoderCyclicError> {
        // Evenly in 1/P, seven tenths of a wave over twice the travel apart: the nearest point still sees more than half of any
        // wave, and refinement finds the rest.
        let finest = (8.0 * scene.noise).max(scene.travel / 100.0);
        // A longer wave over the stroke is a scale error, not one of the grating.
        let coarse = 0.6 * scene.travel;
        let step = 0.35 / scene.travel;
        let count = (((1.0 / finest - 1.0 / coarse) / step).ceil() as usize).clamp(1, 700);
        let periods = (0..count).map(|i| 1.0 / (1.0 / coarse + step * i as f64));
        let both = [Harmonics::First, Harmonics::FirstAndSecond];
        periods.flat_map(|period| both.map(|harmonics| EncoderCyclicError { period, harmonics })).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.period)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![if self.second() { 2 } else { 1 }]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Wave { period: self.period, second: self.second() })
    }

    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        // A wave whose second harmonic carries it is one of half the period.
        let size = |i: usize| strengths[i].hypot(strengths[i + 1]);
        !self.second() || size(2) < CARRIES * size(0)
    }

    fn equivalent(&self) -> Option<EncoderCyclicError> {
        Some(EncoderCyclicError { period: 0.5 * self.period, ..self.clone() })
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let at = |i: usize| strengths.get(i).copied().unwrap_or(0.0);
        let pair = |i: usize| (at(i).hypot(at(i + 1)), (-at(i + 1)).atan2(at(i)).to_degrees());
        let (first, second) = (pair(0), pair(2));
        let mut all = vec![AMPLITUDE.at(first.0), PERIOD.at(self.period), PHASE_DEG.at(first.1)];
        if self.second() {
            all.push(AMPLITUDE_2.at(second.0));
            all.push(PHASE_2_DEG.at(second.1));
        }
        all
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(EncoderCyclicError, Vec<f64>), PhysicsError> {
        let pair = |amplitude: f64, phase: f64| [amplitude * phase.cos(), -amplitude * phase.sin()];
        let first = pair(given.need(&AMPLITUDE)?, given.or(&PHASE_DEG)?.to_radians());
        let second = pair(given.or_else(&AMPLITUDE_2, 0.0)?, given.or(&PHASE_2_DEG)?.to_radians());
        let harmonics = if given.has(&AMPLITUDE_2) { Harmonics::FirstAndSecond } else { Harmonics::First };
        Ok((EncoderCyclicError { period: given.need(&PERIOD)?, harmonics }, [first, second].concat()))
    }
}
