//! The loop is later than the model says: computation, transport or interpolation time that was left out.
//!
//! m(t) = x(t - d(t)), d constant, or growing along the session, d = d0 + g t: a buffer that fills, two clocks that run apart. What is constant of
//! a growing delay goes into the plant's own, so the search looks for the growth alone. Between samples the trajectory is the cubic through
//! positions and velocities (Hermite).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, Prior, ScanEnd, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;

/// The delay.
#[derive(Clone, Debug, PartialEq)]
pub enum ExtraDelay {
    /// One that stays as it is.
    Constant {
        /// Delay (s), above 0 and at most 16 samples.
        delay_s: f64,
    },
    /// One that grows, or falls, along the session. It stays between 0 and 16 samples.
    Growing {
        /// Delay at the start of the session (s); without one the least with which the session has none below 0.
        start_s: Option<f64>,
        /// Delay gained over the time (s/s).
        growth: f64,
    },
}

impl ExtraDelay {
    /// Delay at the start of the session (s), and what it gains over the time (s/s).
    fn course(&self, scene: &MotionScene) -> [f64; 2] {
        match *self {
            ExtraDelay::Constant { delay_s } => [delay_s, 0.0],
            ExtraDelay::Growing { start_s, growth } => {
                [start_s.unwrap_or_else(|| (-growth * scene.session_s).max(0.0)), growth]
            }
        }
    }
}

/// Longest delay (samples).
const LONGEST: usize = 16;

const DELAY_S: Key = Key::new("delay_s", Unit::Second, "d")
    .unless(&["delay_growth"])
    .takes(Takes::Law("above 0 and at most 16 samples; beside delay_growth also 0"))
    .scan(ScanEnd::At(0.1, Measure::Sample), ScanEnd::At(6.0, Measure::Sample));
const DELAY_GROWTH: Key = Key::new("delay_growth", Unit::Ratio, "g, of either sign, over the time of the session")
    .unless(&["delay_s"])
    .prior(Prior::Words("0.1 to 3 samples over the session"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "extra_delay",
    port: Port::Time,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "m(t) = x(t - d), or d0 + g t in the place of d; d0 alone is `delay_s`",
    keys: &[DELAY_S, DELAY_GROWTH],
    source: "K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd edition, 1997",
    says: "the machine answers later than the model says: some computing or transport time was left out",
    confused_with: &["misalignment", "amplifier_lag", "sensor_lag", "linear_parameters"],
    experiment: "a multisine up to half the sample rate: a delay turns the phase in proportion to frequency and leaves the gain",
    band_hz: [200.0, 12000.0],
};

struct Late {
    /// Delay at the start of the session (samples), and what a sample gains.
    start: f64,
    growth: f64,
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
        let samples = (self.start + self.growth * to.session / self.step).clamp(0.0, LONGEST as f64);
        let back = samples.floor();
        let late = samples - back;
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

    fn grid(scene: &MotionScene) -> Vec<ExtraDelay> {
        let constant = [0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0];
        let mut all: Vec<ExtraDelay> =
            constant.iter().map(|n| ExtraDelay::Constant { delay_s: n * scene.sample_time_s }).collect();
        for gained in logarithmic(0.1, 3.0, 4).into_iter().flat_map(|n| [n, -n]) {
            let growth = gained * scene.sample_time_s / scene.session_s;
            all.push(ExtraDelay::Growing { start_s: None, growth });
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        match self {
            ExtraDelay::Constant { delay_s } => vec![Some(delay_s), None],
            ExtraDelay::Growing { growth, .. } => vec![None, Some(growth)],
        }
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.member()]
    }

    /// Whether it grows.
    fn member(&self) -> usize {
        usize::from(matches!(self, ExtraDelay::Growing { .. }))
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let step = scene.sample_time_s;
        let [start, growth] = self.course(scene);
        let past = [(0.0, 0.0); LONGEST + 2];
        Box::new(Late { start: start / step, growth, step, past, newest: 0, started: false })
    }

    fn parameters(&self, _strengths: &[f64], scene: &MotionScene) -> Vec<Parameter> {
        let [start, growth] = self.course(scene);
        let grows = self.member() > 0;
        [DELAY_S.at(start)].into_iter().chain(grows.then(|| DELAY_GROWTH.at(growth))).collect()
    }

    /// Of one that grows the longest of the session: the loop has the least of its margin there.
    fn response_share(&self, _strengths: &[f64], scene: &MotionScene, _w_rad_s: f64) -> Share {
        let [start, growth] = self.course(scene);
        Share::Delay((start + (growth * scene.session_s).max(0.0)).min(LONGEST as f64 * scene.sample_time_s))
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(ExtraDelay, Vec<f64>), PhysicsError> {
        let longest = (LONGEST as f64 + 1e-9) * scene.sample_time_s;
        let growth = given.get(&DELAY_GROWTH)?;
        let start_s = if growth.is_some() { given.get(&DELAY_S)? } else { Some(given.need(&DELAY_S)?) };
        if let Some(delay_s) = start_s
            && !(delay_s < longest && (delay_s > 0.0 || (delay_s == 0.0 && growth.is_some())))
        {
            return Err(given.refused(&DELAY_S, delay_s));
        }
        let delay = match growth {
            Some(growth) => ExtraDelay::Growing { start_s, growth },
            None => ExtraDelay::Constant { delay_s: start_s.unwrap_or_default() },
        };
        Ok((delay, vec![1.0]))
    }
}
