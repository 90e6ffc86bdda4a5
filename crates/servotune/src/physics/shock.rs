//! A single push from outside: somebody bumps the machine, a neighbour seeks.
//!
//! tau = B sin(pi (t - t0)/w) for t0 < t < t0 + w: the half-sine of shock tests (IEC 60068-2-27); its mean over an interval is exact.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;
use std::f64::consts::PI;

/// The bump. Its strength is the peak, per record.
#[derive(Clone, Debug, PartialEq)]
pub struct Shock {
    /// When it begins, from the start of the record (s).
    pub time_s: f64,
    /// How long it lasts (s), above 0.
    pub width_s: f64,
}

const PEAK_COMMAND: Key = Key::new("peak_command", Unit::Command, "B");
const TIME_S: Key =
    Key::new("time_s", Unit::Second, "when it begins, t0").prior(Prior::Words("half a width apart over the record"));
const WIDTH_S: Key = Key::new("width_s", Unit::Second, "w")
    .positive()
    .scan(ScanEnd::Greatest(&[(8.0, Measure::Sample), (0.005, Measure::Record)]), ScanEnd::At(0.125, Measure::Record));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "shock",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: true,
    equation: "tau = B sin(pi (t - t0)/w), t0 < t < t0 + w",
    keys: &[PEAK_COMMAND, TIME_S, WIDTH_S],
    source: "IEC 60068-2-27, Environmental Testing, Test Ea: Shock, 2008",
    says: "the machine was bumped once while recording",
    confused_with: &["lost_samples", "broadband_disturbance", "backlash"],
    experiment: "the same move again: a bump does not repeat at the same time",
    band_hz: [1.0, 1000.0],
};

struct Pulse {
    start: f64,
    width: f64,
}

impl Law for Pulse {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let a = (from.t - self.start).max(0.0).min(self.width);
        let b = (to.t - self.start).max(0.0).min(self.width);
        let step = to.t - from.t;
        out[0] = if b > a && step > 0.0 {
            // cos p - cos q as a product: no cancellation within a wide pulse.
            let (p, q) = (PI * a / self.width, PI * b / self.width);
            2.0 * (0.5 * (p + q)).sin() * (0.5 * (q - p)).sin() * self.width / (PI * step)
        } else {
            0.0
        };
    }
}

impl Parametric for Shock {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<Shock> {
        let shortest = (8.0 * scene.sample_time_s).max(scene.duration_s / 200.0);
        let mut all = Vec::new();
        for width in logarithmic(shortest, scene.duration_s / 8.0, 4) {
            // Half a width apart: the nearest pulse carries at least nine tenths of any other of this width. None begins at 0, so that
            // all may be refined.
            let count = (2.0 * scene.duration_s / width).floor() as usize;
            all.extend((0..count).map(|i| Shock { time_s: 0.5 * width * (i as f64 + 0.5), width_s: width }));
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.time_s), Some(&mut self.width_s)]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        Box::new(Pulse { start: self.time_s, width: self.width_s.abs() })
    }

    fn may_occur_several_times() -> bool {
        true
    }

    fn is_single_event() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![PEAK_COMMAND.at(strengths[0]), TIME_S.at(self.time_s), WIDTH_S.at(self.width_s)]
    }

    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(Shock, Vec<f64>), PhysicsError> {
        let law = Shock { time_s: given.need(&TIME_S)?, width_s: given.need(&WIDTH_S)? };
        Ok((law, vec![given.need(&PEAK_COMMAND)?]))
    }
}
