//! The gain between command and torque swings periodically: every line gets sidebands.
//!
//! tau = i (1 + e cos(angle + phi)), the angle being a whole order of the spindle or 2 pi f t (a time-periodic gain; Floquet).

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene};
use super::share::Share;
use std::f64::consts::{PI, TAU};

/// Inner: frequency (Hz), order of the spindle (0: time). Strengths: of i cos and i sin.
pub struct ParametricGain;

static FACTS: Facts = Facts {
    name: "parametric_gain",
    port: Port::Amplifier,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: false,
    equation: "tau = i (1 + e cos(2 pi f t + phi)), f t counted by the spindle where f is an order of it",
    says: "the motor's strength swings periodically: every tone of the command gets two neighbours",
    confused_with: &["line_disturbance", "repeatable_runout", "gain_drift"],
    experiment: "single tones at three frequencies and two amplitudes: sidebands follow the tone and grow with it",
    band_hz: [1.0, 3000.0],
};

/// Most points of the scan.
const POINTS: usize = 300;

struct Swing {
    w: f64,
    order: f64,
    mean: f64,
}

impl Law for Swing {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let angle = if self.order > 0.0 {
            // From the first sample on, so that an angle that wraps between two samples does no harm.
            self.order * from.spindle_rad + 0.5 * self.w * (to.t - from.t)
        } else {
            self.w * 0.5 * (from.t + to.t)
        };
        let (sin, cos) = angle.sin_cos();
        (out[0], out[1]) = (from.i * self.mean * cos, from.i * self.mean * sin);
    }
}

impl Effect for ParametricGain {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::FactorOverTime
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = Vec::new();
        if let Some(spindle) = scene.spindle_hz {
            all.extend((1..=6).map(|n| vec![f64::from(n) * spindle, f64::from(n)]));
        }
        if scene.duration_s > 0.0 {
            let high = 0.2 * scene.nyquist_hz();
            // A swing shows at least three times in a record; what is slower is a drift.
            let (first, step) = (3.0 / scene.duration_s, 0.8 / scene.duration_s);
            all.extend((0..POINTS).map(|i| first + step * i as f64).take_while(|&f| f < high).map(|f| vec![f, 0.0]));
        }
        all
    }

    fn law(&self, inner: &[f64], scene: &Scene) -> Box<dyn Law> {
        let order = inner[1].round().max(0.0);
        let hz = if order > 0.0 { scene.spindle_hz.map_or(inner[0], |s| order * s) } else { inner[0] };
        let y = PI * hz * scene.sample_time_s;
        Box::new(Swing { w: TAU * hz, order, mean: if y == 0.0 { 1.0 } else { y.sin() / y } })
    }

    fn has_own_clock(&self) -> bool {
        true
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        let [a, b] = [setting.strengths[0], setting.strengths[1]];
        vec![
            Parameter::new("depth", a.hypot(b), Unit::Ratio),
            Parameter::new("frequency_hz", setting.inner[0], Unit::Hertz),
            Parameter::new("spindle_order", setting.inner[1], Unit::Ratio),
            Parameter::new("phase_deg", (-b).atan2(a).to_degrees(), Unit::Degree),
        ]
    }

    fn response_share(&self, _setting: &Setting, _scene: &Scene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let (depth, phase) = (given.need("depth")?, given.or("phase_deg", 0.0).to_radians());
        let inner = vec![given.positive("frequency_hz")?, given.or("spindle_order", 0.0)];
        Ok(Setting { inner, strengths: vec![depth * phase.cos(), -depth * phase.sin()] })
    }
}
