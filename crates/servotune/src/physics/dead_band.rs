//! The amplifier ignores small commands: crossover distortion.
//!
//! i = u - clip(u, -D, D), the dead zone of textbooks (Gelb, Vander Velde 1968).

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};

/// Inner: half of the band's width.
pub struct DeadBand;

static FACTS: Facts = Facts {
    name: "dead_band",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = u - clip(u, -D, D)",
    says: "the amplifier does nothing for small commands: around zero the arm is left alone",
    confused_with: &["coulomb_friction", "quantisation", "linear_parameters"],
    experiment: "a small multisine around zero and around a constant command: the constant removes the effect",
    band_hz: [1.0, 3000.0],
};

struct Zone {
    half: f64,
}

impl Law for Zone {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -to.u.max(-self.half).min(self.half);
    }
}

impl Effect for DeadBand {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Input
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        logarithmic(2e-5 * scene.command, 0.5 * scene.command, 20).into_iter().map(|d| vec![d]).collect()
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Zone { half: inner[0].abs() })
    }

    fn is_hard_nonlinearity(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("half_width", setting.inner[0], Unit::Command),
            Parameter::new("width", 2.0 * setting.inner[0], Unit::Command),
        ]
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let half =
            if given.has("half_width") { given.positive("half_width")? } else { 0.5 * given.positive("width")? };
        Ok(Setting { inner: vec![half], strengths: vec![1.0] })
    }
}
