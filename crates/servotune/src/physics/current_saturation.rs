//! The amplifier's current is limited: i = sat(u, limit).

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};

/// Inner: the limit.
pub struct CurrentSaturation;

static FACTS: Facts = Facts {
    name: "current_saturation",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = clip(u, -limit, limit)",
    says: "the amplifier runs out of current: commands above a limit give no more torque",
    confused_with: &["slew_limit", "torque_factor_rolloff"],
    experiment: "moves of growing length, so that the largest command grows step by step",
    band_hz: [1.0, 3000.0],
};

struct Clip {
    limit: f64,
}

impl Law for Clip {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = to.u.max(-self.limit).min(self.limit) - to.u;
    }
}

impl Effect for CurrentSaturation {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Input
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        // Dense towards the largest command: there few samples are touched, and each point touches others.
        let near = (0..8).map(|i| 1.0 - 0.12 * 0.7f64.powi(i));
        let far = (3..23).map(|i| f64::from(i) / 26.0);
        far.chain(near).map(|s| vec![scene.command * s]).collect()
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Clip { limit: inner[0] })
    }

    fn is_hard_nonlinearity(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![Parameter::new("limit", setting.inner[0], Unit::Command)]
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        Ok(Setting { inner: vec![given.positive("limit")?], strengths: vec![1.0] })
    }
}
