//! A single push from outside: somebody bumps the machine, a neighbour seeks.
//!
//! tau = B sin(pi (t - t0)/w) for t0 < t < t0 + w: the half-sine of shock tests (IEC 60068-2-27); its mean over an interval is exact.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};
use super::share::Share;
use std::f64::consts::PI;

/// Inner: start, width. Strength: the peak, per record.
pub struct Shock;

static FACTS: Facts = Facts {
    name: "shock",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: true,
    equation: "tau = B sin(pi (t - t0)/w), t0 < t < t0 + w",
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

impl Effect for Shock {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let shortest = (8.0 * scene.sample_time_s).max(scene.duration_s / 200.0);
        let mut all = Vec::new();
        for width in logarithmic(shortest, scene.duration_s / 8.0, 4) {
            // Half a width apart: the nearest pulse carries at least nine tenths of any other of this width. None begins at 0, so that
            // all may be refined.
            let count = (2.0 * scene.duration_s / width).floor() as usize;
            all.extend((0..count).map(|i| vec![0.5 * width * (i as f64 + 0.5), width]));
        }
        all
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Pulse { start: inner[0], width: inner[1].abs() })
    }

    fn may_occur_several_times(&self) -> bool {
        true
    }

    fn is_single_event(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("peak_command", setting.strengths[0], Unit::Command),
            Parameter::new("time_s", setting.inner[0], Unit::Second),
            Parameter::new("width_s", setting.inner[1], Unit::Second),
        ]
    }

    fn response_share(&self, _setting: &Setting, _scene: &Scene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let inner = vec![given.need("time_s")?, given.positive("width_s")?];
        Ok(Setting { inner, strengths: vec![given.need("peak_command")?] })
    }
}
