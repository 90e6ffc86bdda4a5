//! A vibration of the structure that the linear plant leaves out.
//!
//! m = x + (a w² + b w s)/(s² + 2 z w s + w²) i: one modal term of the partial fractions, with any sign and phase (eq. (2) in
//! modal form). Exact for a command held between samples.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, ScanEnd, Takes};
use super::oscillator::Oscillator;
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;
use crate::lti::ModalTerm;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// The vibration. Its strengths are the gains at rest and of the rate.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmodelledResonance {
    /// Natural frequency (Hz), above 0.
    pub frequency_hz: f64,
    /// Damping ratio, between 0 and 1.
    pub damping_ratio: f64,
}

const FREQUENCY_HZ: Key = Key::new("frequency_hz", Unit::Hertz, "natural frequency").positive().scan(
    ScanEnd::Least(&[(30.0, Measure::One), (0.0045, Measure::SampleRate)]),
    ScanEnd::At(0.45, Measure::SampleRate),
);
const DAMPING_RATIO: Key =
    Key::new("damping_ratio", Unit::Ratio, "damping ratio; refined from a third of the first to three times the last")
        .takes(Takes::Between(0.0, 1.0, "above 0 and below 1"))
        .points(&[0.005, 0.02, 0.06]);
const STATIC_GAIN: Key = Key::new("static_gain", Unit::PositionPerCommand, "a");
const RATE_GAIN: Key = Key::new("rate_gain", Unit::PositionPerCommand, "b").or(0.0);
const PEAK_GAIN: Key = Key::reported("peak_gain", Unit::PositionPerCommand, "gain at the peak");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "unmodelled_resonance",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "m = x + (a w^2 + b w s)/(s^2 + 2 z w s + w^2) i",
    keys: &[FREQUENCY_HZ, DAMPING_RATIO, STATIC_GAIN, RATE_GAIN, PEAK_GAIN],
    source: "D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd edition, 2000",
    says: "the structure vibrates at a frequency that the model does not have",
    confused_with: &["aliased_mode", "mode_shift", "line_disturbance", "base_mode", "linear_parameters"],
    experiment: "a multisine through the band at two amplitudes: a vibration follows the command, a disturbance does not",
    band_hz: [30.0, 12000.0],
};

/// The law of one oscillator, its first `responses` as columns.
pub(super) struct Ringing {
    oscillator: Oscillator,
    responses: usize,
}

impl Ringing {
    pub(super) fn at_rest(hz: f64, damping: f64, step: f64, responses: usize) -> Ringing {
        Ringing { oscillator: Oscillator::at_rest(TAU * hz, damping, step), responses }
    }
}

impl Law for Ringing {
    fn columns(&self, from: &Sample, _to: &Sample, out: &mut [f64]) {
        out[..self.responses].copy_from_slice(&self.oscillator.next(from.i)[..self.responses]);
    }

    fn commit(&mut self, from: &Sample, _to: &Sample) {
        self.oscillator.advance(from.i);
    }
}

/// Frequency and damping from `low` to `high`, one half-power width apart, never closer than the longest record resolves.
pub(super) fn scan(low: f64, high: f64, damping: f64, scene: &MotionScene) -> Vec<[f64; 2]> {
    let finest = if scene.duration_s > 0.0 { 0.4 / scene.duration_s } else { low };
    let mut all = Vec::new();
    let mut hz = low;
    while hz <= high && all.len() < 2000 {
        all.push([hz, damping]);
        hz += (3.0 * damping * hz).max(finest);
    }
    all
}

/// (a w² + b w s)/(s² + 2 z w s + w²) by its pole and residue.
pub(super) fn term(hz: f64, damping: f64, a: f64, b: f64) -> ModalTerm {
    let w = TAU * hz;
    let turning = w * ((1.0 - damping) * (1.0 + damping)).sqrt();
    let pole = Complex::new(-damping * w, turning);
    ModalTerm { pole, residue: (pole * b * w + a * w * w) / Complex::new(0.0, 2.0 * turning) }
}

impl UnmodelledResonance {
    fn at([frequency_hz, damping_ratio]: [f64; 2]) -> UnmodelledResonance {
        UnmodelledResonance { frequency_hz, damping_ratio }
    }
}

impl Parametric for UnmodelledResonance {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<UnmodelledResonance> {
        let high = 0.45 / scene.sample_time_s;
        [0.005, 0.02, 0.06]
            .iter()
            .flat_map(|&z| scan(30f64.min(0.01 * high), high, z, scene))
            .map(UnmodelledResonance::at)
            .collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.frequency_hz), Some(&mut self.damping_ratio)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Ringing::at_rest(self.frequency_hz, self.damping_ratio, scene.sample_time_s, 2))
    }

    fn may_occur_several_times() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let [a, b] = [strengths[0], strengths[1]];
        vec![
            FREQUENCY_HZ.at(self.frequency_hz),
            DAMPING_RATIO.at(self.damping_ratio),
            STATIC_GAIN.at(a),
            RATE_GAIN.at(b),
            PEAK_GAIN.at(a.hypot(b) / (2.0 * self.damping_ratio)),
        ]
    }

    fn response_share(&self, strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Terms(vec![term(self.frequency_hz, self.damping_ratio, strengths[0], strengths[1])])
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(UnmodelledResonance, Vec<f64>), PhysicsError> {
        let damping = given.need(&DAMPING_RATIO)?;
        let strengths = vec![given.need(&STATIC_GAIN)?, given.or(&RATE_GAIN)?];
        Ok((UnmodelledResonance::at([given.need(&FREQUENCY_HZ)?, damping]), strengths))
    }
}
