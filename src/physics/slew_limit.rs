//! The amplifier's current changes at a limited rate.
//!
//! i_k = i_(k-1) + clip(u_k - i_(k-1), -S T, S T): the rate limiter of textbooks, in samples.

use super::effect::{Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
use super::sample::{Sample, Scene};

/// Inner: the largest slope.
pub struct SlewLimit;

static FACTS: Facts = Facts {
    name: "slew_limit",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i_k = i_(k-1) + clip(u_k - i_(k-1), -S T, S T)",
    says: "the amplifier cannot change its current faster than a limit: quick commands arrive late and rounded",
    confused_with: &["current_saturation", "amplifier_lag"],
    experiment: "the same high-frequency burst at three amplitudes: the lag grows with amplitude times frequency",
    band_hz: [100.0, 12000.0],
};

struct Limiter {
    /// Largest change a sample (command_unit).
    step: f64,
    current: Option<f64>,
}

impl Limiter {
    fn next(&self, from: &Sample, to: &Sample) -> f64 {
        let now = self.current.unwrap_or(from.u);
        now + (to.u - now).clamp(-self.step, self.step)
    }
}

impl Law for Limiter {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to) - to.u;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.current = Some(self.next(from, to));
    }
}

impl Effect for SlewLimit {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn grid(&self, scene: &Scene) -> Vec<Vec<f64>> {
        // A limit above the largest step that occurs does nothing.
        let largest = scene.command_step / scene.sample_time_s;
        // Dense towards it: there few samples are touched, and each point touches others.
        let near = (0..9).map(|i| 1.0 - 0.4 * 0.7f64.powi(i));
        super::logarithmic(0.02, 0.55, 12).into_iter().chain(near).map(|s| vec![s * largest]).collect()
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        Box::new(Limiter { step: inner[0] * scene.sample_time_s, current: None })
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![Parameter::new("max_slope", setting.inner[0], Unit::CommandPerSecond)]
    }

    fn restore(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        Ok(Setting { inner: vec![given.positive("max_slope")?], strengths: vec![1.0] })
    }
}
