//! Dry friction: a constant drag against the motion, optionally higher at low speed.
//!
//! Coulomb with Stribeck's rise: level (1 + rise exp(-(v/v_s)²)) (Armstrong-Helouvry, Dupont, Canudas de Wit 1994). At rest the
//! torque is what holds the arm: Dahl's law with a pre-sliding length near what the sensor resolves, never sgn(v). A film that
//! shears instead of sticking lets the arm creep: the drag then turns round over a speed, not over a length, tanh(v/v_c). The
//! viscous part belongs to the linear plant; a mean offset belongs to the torque offset.

use super::effect::{Effect, Entry, Facts, Given, Law, PhysicsError, Port, Setting, ShownOver};
use super::parameter::{Parameter, Unit};
use super::pivot_friction::{SLID, dahl, shortest_loop};
use super::sample::{Sample, Scene, logarithmic};

/// Inner: pre-sliding length, or the speed of a creep with a minus; Stribeck speed (0 for none), Stribeck rise. Strength: the level at
/// speed.
pub struct CoulombFriction;

static FACTS: Facts = Facts {
    name: "coulomb_friction",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -F (1 + rise exp(-(v/v_s)^2)) z, dz/dx = (1 - sgn(dx) z)/length (sgn(v) once sliding); of a film z = tanh(v/v_c)",
    says: "the arm drags with the same force at every speed, and the force turns round with the motion",
    confused_with: &["pivot_friction", "backlash", "dead_band", "torque_ripple"],
    experiment: "constant-velocity moves in both directions at six speeds over two decades",
    band_hz: [1.0, 300.0],
};

/// Speeds over which a creeping drag turns round, over the highest: a slower one is dry, a faster one all but viscous.
const CREEP: [f64; 2] = [1e-3, 0.3];

/// Lengths to a doubling.
const OCTAVE: f64 = 1.34;

/// Shortest length that a simulation is fitted with, over the shortest of the grid.
const DRIER: f64 = 0.02;

struct Slider {
    length: f64,
    speed: f64,
    rise: f64,
    z: f64,
}

impl Slider {
    fn moved(&self, from: &Sample, to: &Sample) -> f64 {
        dahl(self.z, to.x - from.x, self.length)
    }

    fn level(&self, v: f64) -> f64 {
        if self.speed > 0.0 { 1.0 + self.rise * (-(v / self.speed).powi(2)).exp() } else { 1.0 }
    }
}

impl Law for Slider {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let z = self.moved(from, to);
        // The mean over a straight path: s - (s - z0) (1 - exp(-r))/r with r the path in lengths.
        let (path, s) = ((to.x - from.x).abs() / self.length, (to.x - from.x).signum());
        let mean = match path {
            // Simpson's rule; the sign turns round over more than one sample.
            _ if self.length < 0.0 => {
                let at = |v: f64| (v / -self.length).tanh();
                (at(from.v) + 4.0 * at(0.5 * (from.v + to.v)) + at(to.v)) / 6.0
            }
            p if p < 1e-6 => 0.5 * (self.z + z),
            p if p > SLID => s - (s - self.z) / p,
            p => s + (s - self.z) * (-p).exp_m1() / p,
        };
        out[0] = -mean * self.level(0.5 * (from.v + to.v));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        if self.length > 0.0 {
            self.z = self.moved(from, to);
        }
    }
}

impl Effect for CoulombFriction {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn shown_over(&self) -> ShownOver {
        ShownOver::Loop
    }

    fn finer_simulated(&self, place: usize) -> Option<f64> {
        (place == 0).then_some(DRIER)
    }

    fn scan_points(&self, scene: &Scene) -> Vec<Vec<f64>> {
        // Up to the length from which on pre-sliding friction is told by its loop.
        let (short, long) = ((1.5 * scene.noise).max(3e-6 * scene.travel), shortest_loop(scene));
        let count = 1 + (OCTAVE * (long / short).log2()).ceil().max(4.0) as usize;
        let mut all: Vec<Vec<f64>> = logarithmic(short, long, count).into_iter().map(|l| vec![l, 0.0, 0.0]).collect();
        // A rise that reaches up to the highest speed is no rise but the level.
        let rises = logarithmic(0.015, 0.2, 4);
        all.extend([0.25, 0.5].iter().flat_map(|l| rises.iter().map(move |v| vec![l * long, v * scene.speed, 0.5])));
        all.extend(
            logarithmic(CREEP[0] * scene.speed, CREEP[1] * scene.speed, 8).into_iter().map(|v| vec![-v, 0.0, 0.0]),
        );
        all
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        Box::new(Slider { length: inner[0], speed: inner[1], rise: inner[2], z: 0.0 })
    }

    fn is_drag(&self) -> bool {
        true
    }

    fn is_hard_nonlinearity(&self) -> bool {
        true
    }

    fn stiffness(&self, setting: &Setting) -> f64 {
        // A creeping drag holds by its speed, and is no spring.
        let held = setting.inner.first().copied().filter(|l| *l > 0.0);
        let rise = 1.0 + setting.inner.get(2).copied().unwrap_or(0.0);
        held.map_or(0.0, |l| rise * setting.strengths.first().copied().unwrap_or(0.0).abs() / l)
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        let mut all = vec![
            Parameter::new("level_command", setting.strengths[0], Unit::Command),
            if setting.inner[0] > 0.0 {
                Parameter::new("sliding_length", setting.inner[0], Unit::Position)
            } else {
                Parameter::new("creep_speed", -setting.inner[0], Unit::PositionPerSecond)
            },
        ];
        if setting.inner[1] > 0.0 {
            all.push(Parameter::new("stribeck_speed", setting.inner[1], Unit::PositionPerSecond));
            all.push(Parameter::new("stribeck_rise", setting.inner[2], Unit::Ratio));
        }
        all
    }

    fn is_possible(&self, setting: &Setting, _errors: &[f64]) -> bool {
        setting.strengths.first().is_some_and(|s| *s > 0.0)
    }

    /// Bearings and cables hold to their laws to about a hundredth.
    fn form_uncertainty(&self, _setting: &Setting, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(&self, given: &Given, scene: &Scene) -> Result<Setting, PhysicsError> {
        let length = if given.has("creep_speed") {
            -given.positive("creep_speed")?
        } else if given.has("sliding_length") {
            given.positive("sliding_length")?
        } else {
            (6.0 * scene.noise).max(1e-5 * scene.travel)
        };
        let (speed, rise) = if given.has("stribeck_speed") {
            (given.positive("stribeck_speed")?, given.need("stribeck_rise")?)
        } else {
            (0.0, 0.0)
        };
        Ok(Setting { inner: vec![length, speed, rise], strengths: vec![given.need("level_command")?] })
    }
}
