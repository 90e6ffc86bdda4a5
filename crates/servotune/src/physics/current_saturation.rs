//! The amplifier's current is limited: i = sat(u, limit), at a corner that electronics and voltage headroom round off.
//!
//! The rounded corner is the soft knee of limiters (Giannoulis, Massberg and Reiss 2012, equation 4): a parabola that meets both lines with
//! their slopes.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, ScanEnd, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};

/// The amplifier's limit.
#[derive(Clone, Debug, PartialEq)]
pub struct CurrentSaturation {
    /// Largest current, as a command (command_unit), above 0.
    pub limit: f64,
    /// Half the width of the rounded corner over the limit, above 0, at most 1; none where it is sharp.
    pub knee: Option<f64>,
}

/// Knees of the grid, and the widest: there the gain falls from the first volt on.
const KNEES: [f64; 3] = [0.04, 0.1, 0.25];
const WIDEST: f64 = 1.0;

const LIMIT: Key = Key::new("limit", Unit::Command, "largest current, as a command")
    .positive()
    .scan(ScanEnd::At(0.115, Measure::Command), ScanEnd::At(0.991, Measure::Command));
const KNEE: Key = Key::new("knee", Unit::Ratio, "half the width of the rounded corner over the limit")
    .or_else("a sharp corner")
    .takes(Takes::Between(0.0, f64::next_up(WIDEST), "a number above 0, at most 1"))
    .points(&KNEES);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "current_saturation",
    port: Port::Amplifier,
    entry: Entry::Command,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "i = clip(u, -limit, limit); with a knee k the corner is the parabola |u| - (|u| - (1 - k) limit)^2 / (4 k limit)",
    keys: &[LIMIT, KNEE],
    source: "A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968; the knee: D. Giannoulis, M. Massberg, J. D. Reiss, Digital Dynamic Range Compressor Design, Journal of the Audio Engineering Society 60(6), 2012",
    says: "the amplifier runs out of current: commands above a limit give no more torque",
    confused_with: &["slew_limit", "torque_factor_rolloff"],
    experiment: "moves of growing length, so that the largest command grows step by step",
    band_hz: [1.0, 3000.0],
};

struct Clip {
    limit: f64,
    knee: f64,
}

impl Clip {
    /// What the amplifier takes from a command of this size, at least 0.
    fn taken(&self, size: f64) -> f64 {
        let (half, over) = (self.knee * self.limit, size - self.limit);
        if over >= half {
            over
        } else if over > -half {
            (over + half).powi(2) / (4.0 * half)
        } else {
            0.0
        }
    }
}

impl Law for Clip {
    fn columns(&self, _from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -self.taken(to.u.abs()).copysign(to.u);
    }
}

impl Parametric for CurrentSaturation {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Input
    }

    fn grid(scene: &MotionScene) -> Vec<CurrentSaturation> {
        // Dense towards the largest command: there few samples are touched, and each point touches others.
        let near = (0..8).map(|i| 1.0 - 0.12 * 0.7f64.powi(i));
        let far = (3..23).map(|i| f64::from(i) / 26.0);
        let limits: Vec<f64> = far.chain(near).map(|s| scene.command * s).collect();
        let forms = std::iter::once(None).chain(KNEES.map(Some));
        forms.flat_map(|knee| limits.iter().map(move |&limit| CurrentSaturation { limit, knee })).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.limit), self.knee.as_mut()]
    }

    fn choices(&self) -> Vec<usize> {
        vec![usize::from(self.knee.is_some())]
    }

    fn member(&self) -> usize {
        usize::from(self.knee.is_some())
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Clip { limit: self.limit, knee: self.knee.unwrap_or(0.0) })
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let knee = self.knee.map(|k| KNEE.at(k));
        std::iter::once(LIMIT.at(self.limit)).chain(knee).collect()
    }

    /// Amplifiers round their corner off: a limit that is met softly is taken for one a little lower.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.02
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(CurrentSaturation, Vec<f64>), PhysicsError> {
        let knee = given.get(&KNEE)?;
        Ok((CurrentSaturation { limit: given.need(&LIMIT)?, knee }, vec![1.0]))
    }
}
