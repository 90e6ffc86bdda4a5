//! The amplifier's current is limited: i = sat(u, limit).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};

/// The amplifier's limit.
#[derive(Clone, Debug, PartialEq)]
pub struct CurrentSaturation {
    /// Largest current, as a command (command_unit), above 0.
    pub limit: f64,
}

/// What is known beforehand.
pub static FACTS: Facts = Facts {
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

impl Parametric for CurrentSaturation {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Input
    }

    fn grid(scene: &Scene) -> Vec<CurrentSaturation> {
        // Dense towards the largest command: there few samples are touched, and each point touches others.
        let near = (0..8).map(|i| 1.0 - 0.12 * 0.7f64.powi(i));
        let far = (3..23).map(|i| f64::from(i) / 26.0);
        far.chain(near).map(|s| CurrentSaturation { limit: scene.command * s }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.limit)]
    }

    fn in_motion(&self, _scene: &Scene) -> Box<dyn Law> {
        Box::new(Clip { limit: self.limit })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        vec![Parameter::new("limit", self.limit, Unit::Command)]
    }

    /// Amplifiers round their corner off: a limit that is met softly is taken for one a little lower.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.02
    }

    fn setting_of(given: &Given, _scene: &Scene) -> Result<(CurrentSaturation, Vec<f64>), PhysicsError> {
        Ok((CurrentSaturation { limit: given.positive("limit")? }, vec![1.0]))
    }
}
