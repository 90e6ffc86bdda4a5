//! The amplifier ignores small commands: crossover distortion.
//!
//! i = u - clip(u, -D, D), the dead zone of textbooks (Gelb, Vander Velde 1968).
//!
//! A bridge whose switches wait for each other (dead time) is not dead around zero, but loses a voltage with the sign of the current, which
//! fades where the ripple turns the current round within a period (Jeong, Park 1991): i = u - (1 - g) clip(u, -D, D). Inside the band the
//! gain is g, outside it (1 - g) D is lost.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Bound, Key, Measure, Prior, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};

/// The band without an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadBand {
    /// Half of its width (command_unit), above 0.
    pub half_width: f64,
    /// Gain inside the band, above 0 and below 1, of an amplifier with dead time; none where the band is dead.
    pub gain_inside: Option<f64>,
}

/// Gains inside the band within which a fuller form is fitted, and from which its fit sets out.
const GAINS: [f64; 2] = [0.01, 0.99];
const GAIN: f64 = 0.4;

/// Half widths within which a fuller form is fitted, over the largest command.
const WIDTHS: [f64; 2] = [2e-5, 0.5];

const HALF_WIDTH: Key = Key::new("half_width", Unit::Command, "D")
    .unless(&["width"])
    .positive()
    .scan(Bound::At(WIDTHS[0], Measure::Command), Bound::At(WIDTHS[1], Measure::Command));
const WIDTH: Key = Key::new("width", Unit::Command, "2 D")
    .unless(&["half_width"])
    .positive()
    .prior(Prior::Words("made from its half"));
const GAIN_INSIDE: Key =
    Key::new("gain_inside", Unit::Ratio, "gain inside the band, g, of an amplifier with dead time; 0: dead")
        .or(0.0)
        .takes(Takes::Law("at least 0 and below 1"))
        .prior(Prior::Words("in fuller forms"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "dead_band",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = u - (1 - g) clip(u, -D, D)",
    keys: &[HALF_WIDTH, WIDTH, GAIN_INSIDE],
    source: "A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968; S.-G. Jeong, M.-H. Park, The Analysis and Compensation of Dead-Time Effects in PWM Inverters, IEEE Transactions on Industrial Electronics 38(2), 1991",
    says: "the amplifier does nothing for small commands: around zero the arm is left alone",
    confused_with: &["coulomb_friction", "quantisation", "linear_parameters"],
    experiment: "a small multisine around zero and around a constant command: the constant removes the effect",
    band_hz: [1.0, 3000.0],
};

struct Zone {
    half: f64,
    /// Share of the command that is lost inside.
    lost: f64,
}

impl Law for Zone {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -self.lost * to.u.max(-self.half).min(self.half);
    }
}

impl DeadBand {
    /// A band without an answer of this half width (command_unit).
    pub fn dead(half_width: f64) -> DeadBand {
        DeadBand { half_width, gain_inside: None }
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
        let [least, most] = WIDTHS.map(|share| share * scene.command);
        logarithmic(least, most, 20).into_iter().map(DeadBand::dead).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.half_width), self.gain_inside.as_mut()]
    }

    /// With a gain inside.
    fn fuller(&self, scene: &Scene) -> Vec<(DeadBand, Vec<[f64; 2]>)> {
        if self.gain_inside.is_some() {
            return Vec::new();
        }
        let ranges = vec![WIDTHS.map(|share| share * scene.command), GAINS];
        vec![(DeadBand { gain_inside: Some(GAIN), ..self.clone() }, ranges)]
    }

    fn in_motion(&self, _scene: &Scene) -> Box<dyn Law> {
        Box::new(Zone { half: self.half_width.abs(), lost: 1.0 - self.gain_inside.unwrap_or(0.0) })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        let mut all = vec![HALF_WIDTH.at(self.half_width), WIDTH.at(2.0 * self.half_width)];
        all.extend(self.gain_inside.map(|gain| GAIN_INSIDE.at(gain)));
        all
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, _scene: &Scene) -> Result<(DeadBand, Vec<f64>), PhysicsError> {
        let half_width = if given.has(&HALF_WIDTH) { given.need(&HALF_WIDTH)? } else { 0.5 * given.need(&WIDTH)? };
        let gain = given.or(&GAIN_INSIDE)?;
        if !(0.0..1.0).contains(&gain) {
            return Err(given.refused(&GAIN_INSIDE, gain));
        }
        Ok((DeadBand { half_width, gain_inside: Some(gain).filter(|g| *g > 0.0) }, vec![1.0]))
    }
}
