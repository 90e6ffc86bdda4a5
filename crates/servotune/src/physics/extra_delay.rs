//! The loop is later than the model says: computation, transport or interpolation time that was left out.
//!
//! m(t) = x(t - d). Between samples the trajectory is the cubic through positions and velocities (Hermite).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Bound, Key, Measure, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};
use super::share::Share;

/// The delay.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraDelay {
    /// Delay (s), above 0 and at most 16 samples.
    pub delay_s: f64,
}

/// Longest delay (samples).
const LONGEST: usize = 16;

const DELAY_S: Key = Key::new("delay_s", Unit::Second, "d")
    .takes(Takes::Law("above 0 and at most 16 samples"))
    .scan(Bound::At(0.1, Measure::Sample), Bound::At(6.0, Measure::Sample));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "extra_delay",
    port: Port::Time,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "m(t) = x(t - d)",
    keys: &[DELAY_S],
    source: "K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd edition, 1997",
    says: "the machine answers later than the model says: some computing or transport time was left out",
    confused_with: &["misalignment", "amplifier_lag", "sensor_lag", "linear_parameters"],
    experiment: "a multisine up to half the sample rate: a delay turns the phase in proportion to frequency and leaves the gain",
    band_hz: [200.0, 12000.0],
};

struct Late {
    /// Delay (samples).
    samples: f64,
    step: f64,
    /// Position and velocity of the last samples, the newest at `newest`.
    past: [(f64, f64); LONGEST + 2],
    newest: usize,
    started: bool,
}

impl Late {
    /// Position and velocity `back` samples before `to`.
    fn at(&self, back: usize, from: &Sample, to: &Sample) -> (f64, f64) {
        match back {
            0 => (to.x, to.v),
            1 => (from.x, from.v),
            _ if self.started => self.past[(self.newest + self.past.len() + 1 - back) % self.past.len()],
            _ => (from.x - (back - 1) as f64 * self.step * from.v, from.v),
        }
    }
}

impl Law for Late {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let back = self.samples.floor();
        let late = self.samples - back;
        let (x1, v1) = self.at(back as usize, from, to);
        let (x0, v0) = self.at(back as usize + 1, from, to);
        let s = 1.0 - late;
        let slopes = (s - 1.0) * ((s - 1.0) * v0 + s * v1) * s * self.step;
        out[0] = x0 + (x1 - x0) * s * s * (3.0 - 2.0 * s) + slopes - to.x;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        let length = self.past.len();
        if !self.started {
            // Before the record the arm is taken to move on as it starts.
            for back in 0..length {
                self.past[(self.newest + length - back) % length] = (from.x - back as f64 * self.step * from.v, from.v);
            }
            self.started = true;
        }
        self.newest = (self.newest + 1) % length;
        self.past[self.newest] = (to.x, to.v);
    }
}

impl Parametric for ExtraDelay {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &Scene) -> Vec<ExtraDelay> {
        [0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0]
            .iter()
            .map(|n| ExtraDelay { delay_s: n * scene.sample_time_s })
            .collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.delay_s)]
    }

    fn in_motion(&self, scene: &Scene) -> Box<dyn Law> {
        let step = scene.sample_time_s;
        let samples = (self.delay_s / step).clamp(0.0, LONGEST as f64);
        Box::new(Late { samples, step, past: [(0.0, 0.0); LONGEST + 2], newest: 0, started: false })
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        vec![DELAY_S.at(self.delay_s)]
    }

    fn response_share(&self, _strengths: &[f64], _scene: &Scene, _w_rad_s: f64) -> Share {
        Share::Delay(self.delay_s)
    }

    fn setting_of(given: &Given, scene: &Scene) -> Result<(ExtraDelay, Vec<f64>), PhysicsError> {
        let longest = (LONGEST as f64 + 1e-9) * scene.sample_time_s;
        let delay_s = given.need(&DELAY_S)?;
        if !(delay_s > 0.0 && delay_s < longest) {
            return Err(given.refused(&DELAY_S, delay_s));
        }
        Ok((ExtraDelay { delay_s }, vec![1.0]))
    }
}
