//! The encoder's error within one period of its grating: a line in position, not in time.
//!
//! m = x + a cos(2 pi x/P) + b sin(2 pi x/P); offsets of the two photocurrents give the first harmonic (Heydemann 1981).

use super::effect::{Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
use super::sample::{Sample, Scene};
use std::f64::consts::TAU;

/// Inner: the period. Strengths: cosine and sine.
pub struct EncoderCyclicError;

static FACTS: Facts = Facts {
    name: "encoder_cyclic_error",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "m = x + a cos(2 pi x/P + phi)",
    says: "the encoder reads wrong by a wave that repeats with the position: its lines are not evenly interpolated",
    confused_with: &["torque_ripple", "unmodelled_resonance", "line_disturbance"],
    experiment: "constant-velocity moves at three speeds: the line moves with the speed",
    band_hz: [1.0, 5000.0],
};

struct Wave {
    period: f64,
}

impl Law for Wave {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        let (sin, cos) = (TAU * to.x / self.period).sin_cos();
        (out[0], out[1]) = (cos, sin);
    }
}

impl Effect for EncoderCyclicError {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn grid(&self, scene: &Scene) -> Vec<Vec<f64>> {
        // Evenly in 1/P, seven tenths of a wave over twice the travel apart: the nearest point still sees more than half of any
        // wave, and refinement finds the rest.
        let finest = (8.0 * scene.noise).max(scene.travel / 100.0);
        // A longer wave over the stroke is a scale error, not one of the grating.
        let coarse = 0.6 * scene.travel;
        let step = 0.35 / scene.travel;
        let count = (((1.0 / finest - 1.0 / coarse) / step).ceil() as usize).clamp(1, 700);
        (0..count).map(|i| vec![1.0 / (1.0 / coarse + step * i as f64)]).collect()
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Wave { period: inner[0] })
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        let [a, b] = [setting.strengths[0], setting.strengths[1]];
        vec![
            Parameter::new("amplitude", a.hypot(b), Unit::Position),
            Parameter::new("period", setting.inner[0], Unit::Position),
            Parameter::new("phase_deg", (-b).atan2(a).to_degrees(), Unit::Degree),
        ]
    }

    fn restore(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let (amplitude, phase) = (given.need("amplitude")?, given.or("phase_deg", 0.0).to_radians());
        let strengths = vec![amplitude * phase.cos(), -amplitude * phase.sin()];
        Ok(Setting { inner: vec![given.positive("period")?], strengths })
    }
}
