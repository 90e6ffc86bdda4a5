//! The amplifier ignores small commands: crossover distortion.
//!
//! i = u - clip(u, -D, D), the dead zone of textbooks (Gelb, Vander Velde 1968).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Bound, Key, Measure, Prior};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};

/// The band without an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadBand {
    /// Half of its width (command_unit), above 0.
    pub half_width: f64,
}

const HALF_WIDTH: Key = Key::new("half_width", Unit::Command, "D")
    .unless(&["width"])
    .positive()
    .scan(Bound::At(2e-5, Measure::Command), Bound::At(0.5, Measure::Command));
const WIDTH: Key = Key::new("width", Unit::Command, "2 D")
    .unless(&["half_width"])
    .positive()
    .prior(Prior::Words("made from its half"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "dead_band",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = u - clip(u, -D, D)",
    keys: &[HALF_WIDTH, WIDTH],
    source: "A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968",
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

impl Parametric for DeadBand {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Input
    }

    fn grid(scene: &Scene) -> Vec<DeadBand> {
        logarithmic(2e-5 * scene.command, 0.5 * scene.command, 20)
            .into_iter()
            .map(|half_width| DeadBand { half_width })
            .collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.half_width)]
    }

    fn in_motion(&self, _scene: &Scene) -> Box<dyn Law> {
        Box::new(Zone { half: self.half_width.abs() })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        vec![HALF_WIDTH.at(self.half_width), WIDTH.at(2.0 * self.half_width)]
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, _scene: &Scene) -> Result<(DeadBand, Vec<f64>), PhysicsError> {
        let half_width = if given.has(&HALF_WIDTH) { given.need(&HALF_WIDTH)? } else { 0.5 * given.need(&WIDTH)? };
        Ok((DeadBand { half_width }, vec![1.0]))
    }
}
