//! The amplifier ignores small commands: crossover distortion.
//!
//! i = u - clip(u, -D, D), the dead zone of textbooks (Gelb, Vander Velde 1968).
//!
//! Or the dead time of a switching bridge, which loses a voltage with the sign of its current (Jeong, Park 1991). Within a small current the ripple
//! carries it through both signs and the loss fades: i = u - (1 - g) clip(u, -D, D), a band that is not wholly dead.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};

/// The band without an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadBand {
    /// Half of its width (command_unit), above 0.
    pub half_width: f64,
    /// Gain inside the band over that outside, above 0 and below 1; none where the band is dead.
    pub gain_inside: Option<f64>,
}

/// Gains of the grid.
const GAINS: [f64; 3] = [0.1, 0.3, 0.6];

const HALF_WIDTH: Key = Key::new("half_width", Unit::Command, "D")
    .unless(&["width"])
    .positive()
    .scan(ScanEnd::At(2e-5, Measure::Command), ScanEnd::At(0.5, Measure::Command));
const WIDTH: Key = Key::new("width", Unit::Command, "2 D")
    .unless(&["half_width"])
    .positive()
    .prior(Prior::Words("made from its half"));
const GAIN_INSIDE: Key =
    Key::new("gain_inside", Unit::Ratio, "g, gain inside the band over that outside; 0: it is dead")
        .or(0.0)
        .takes(Takes::Law("a number of at least 0 and below 1"))
        .points(&GAINS);
const LOST_COMMAND: Key =
    Key::reported("lost_command", Unit::Command, "command lost outside the band, (1 - g) D").beside("gain_inside");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "dead_band",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = u - (1 - g) clip(u, -D, D), g = 0 of a band that is dead",
    keys: &[HALF_WIDTH, WIDTH, GAIN_INSIDE, LOST_COMMAND],
    source: "A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968; the gain inside: S.-G. Jeong, M.-H. Park, The Analysis and Compensation of Dead-Time Effects in PWM Inverters, IEEE Transactions on Industrial Electronics 38(2), 1991",
    says: "the amplifier does nothing for small commands: around zero the arm is left alone",
    confused_with: &["coulomb_friction", "quantisation", "linear_parameters"],
    experiment: "a small multisine around zero and around a constant command: the constant removes the effect",
    band_hz: [1.0, 3000.0],
};

struct Zone {
    half: f64,
    /// Share of a small command that is lost.
    lost: f64,
}

impl Law for Zone {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -self.lost * to.u.max(-self.half).min(self.half);
    }
}

impl Parametric for DeadBand {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Input
    }

    fn grid(scene: &MotionScene) -> Vec<DeadBand> {
        let widths = logarithmic(2e-5 * scene.command, 0.5 * scene.command, 20);
        let forms = std::iter::once(None).chain(GAINS.map(Some));
        forms
            .flat_map(|gain_inside| widths.iter().map(move |&half_width| DeadBand { half_width, gain_inside }))
            .collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.half_width), self.gain_inside.as_mut()]
    }

    fn class(&self) -> Vec<usize> {
        vec![self.member()]
    }

    fn member(&self) -> usize {
        usize::from(self.gain_inside.is_some())
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        // A fit may try a gain of 1 or more on its way: then nothing is lost.
        let lost = 1.0 - self.gain_inside.map_or(0.0, |g| g.clamp(0.0, 1.0));
        Box::new(Zone { half: self.half_width.abs(), lost })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    /// A band that answers more than what lies outside is no band.
    fn is_possible(&self, _strengths: &[f64], _errors: &[f64]) -> bool {
        self.gain_inside.is_none_or(|g| g < 1.0)
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![HALF_WIDTH.at(self.half_width), WIDTH.at(2.0 * self.half_width)];
        if let Some(gain) = self.gain_inside {
            all.extend([GAIN_INSIDE.at(gain), LOST_COMMAND.at((1.0 - gain) * self.half_width)]);
        }
        all
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(DeadBand, Vec<f64>), PhysicsError> {
        let half_width = if given.has(&HALF_WIDTH) { given.need(&HALF_WIDTH)? } else { 0.5 * given.need(&WIDTH)? };
        let gain = given.or(&GAIN_INSIDE)?;
        if !(0.0..1.0).contains(&gain) {
            return Err(given.refused(&GAIN_INSIDE, gain));
        }
        Ok((DeadBand { half_width, gain_inside: Some(gain).filter(|g| *g > 0.0) }, vec![1.0]))
    }
}
