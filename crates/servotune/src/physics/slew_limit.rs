//! The amplifier's current changes at a limited rate.
//!
//! di/dt = S sgn(u - i) until i = u: behind a converter that holds u over a sample the current ramps to every new value, however small
//! the step. A digital limiter works at the samples instead: i_k = i_(k-1) + clip(u_k - i_(k-1), -S T, S T).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// The limit of the rate.
#[derive(Clone, Debug, PartialEq)]
pub struct SlewLimit {
    /// Largest slope of the current (command_unit/s), above 0.
    pub max_slope: f64,
    /// Whether the current ramps between the samples; else it is limited at them.
    pub between_samples: bool,
}

const MAX_SLOPE: Key = Key::new("max_slope", Unit::CommandPerSecond, "largest slope, S")
    .positive()
    .scan(ScanEnd::At(0.02, Measure::SteepestCommand), ScanEnd::At(60.0, Measure::SteepestCommand));
const BETWEEN_SAMPLES: Key =
    Key::new("between_samples", Unit::Ratio, "0: limited at the samples; else the current ramps between them")
        .or(0.0)
        .points(&[0.0, 1.0]);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "slew_limit",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "di/dt = S sgn(u - i) until i = u, u held over the sample; or i_k = i_(k-1) + clip(u_k - i_(k-1), -S T, S T)",
    keys: &[MAX_SLOPE, BETWEEN_SAMPLES],
    source: "P. Horowitz, W. Hill, The Art of Electronics, 3rd edition, 2015",
    says: "the amplifier cannot change its current faster than a limit: quick commands arrive late and rounded",
    confused_with: &["current_saturation", "amplifier_lag"],
    experiment: "the same high-frequency burst at three amplitudes: the lag grows with amplitude times frequency",
    band_hz: [100.0, 12000.0],
};

struct Limiter {
    /// Largest change a sample (command_unit).
    step: f64,
    ramps: bool,
    /// At the end of the last sample.
    current: Option<f64>,
}

impl Limiter {
    /// The current at the end of the sample, and its mean over it.
    fn next(&self, from: &Sample, to: &Sample) -> [f64; 2] {
        let now = self.current.unwrap_or(from.u);
        let off = to.u - now;
        let end = now + off.max(-self.step).min(self.step);
        if !self.ramps {
            return [end, end];
        }
        // The share of the sample that the ramp takes, half of its height missing meanwhile.
        let share = if off.abs() < self.step { off.abs() / self.step } else { 1.0 };
        [end, end - 0.5 * share * (end - now)]
    }
}

impl Law for Limiter {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to)[1] - to.u;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.current = Some(self.next(from, to)[0]);
    }
}

impl Parametric for SlewLimit {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<SlewLimit> {
        // A limit above the largest step that occurs does nothing.
        let largest = scene.command_step / scene.sample_time_s;
        let slope = |share: f64, between_samples| SlewLimit { max_slope: share * largest, between_samples };
        // Dense towards it: there few samples are touched, and each point touches others.
        let near = (0..9).map(|i| 1.0 - 0.4 * 0.7f64.powi(i));
        let at = super::logarithmic(0.02, 0.55, 12).into_iter().chain(near).map(|s| slope(s, false));
        // A ramp shortens every step a little, also where it ends within the sample.
        at.chain(super::logarithmic(0.02, 60.0, 34).into_iter().map(|s| slope(s, true))).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.max_slope)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![usize::from(self.between_samples)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Limiter { step: self.max_slope * scene.sample_time_s, ramps: self.between_samples, current: None })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![MAX_SLOPE.at(self.max_slope), BETWEEN_SAMPLES.at(f64::from(self.between_samples))]
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(SlewLimit, Vec<f64>), PhysicsError> {
        let between_samples = given.or(&BETWEEN_SAMPLES)? != 0.0;
        Ok((SlewLimit { max_slope: given.need(&MAX_SLOPE)?, between_samples }, vec![1.0]))
    }
}
