//! Pre-sliding friction of the pivot bearing: hysteresis over the distance since the last reversal.
//!
//! Dahl's law (P. Dahl, Aerospace Corp. TOR-0158, 1968): dz/dx = (1 - sgn(dx) z)/x_s with z = friction torque over its sliding
//! level; exact over a step: z1 = s - (s - z0) exp(-|dx|/x_s), s = sgn(dx). Maxwell-slip form (Al-Bender, Lampaert, Swevers
//! 2005): a row of spring-slider elements with evenly spread yield lengths up to x_s, whose first loading is the parabola
//! z = 2 d/x_s - (d/x_s)². The inner parameter `shape` chooses: 0 Dahl, 1 Maxwell slip.

use super::effect::{Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
use super::sample::{Sample, Scene, logarithmic};

/// Inner: sliding length, shape. Strength: the sliding level.
pub struct PivotFriction;

static FACTS: Facts = Facts {
    name: "pivot_friction",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -F z, dz/dx = (1 - sgn(dx) z)/x_s (Dahl) or a row of Maxwell-slip elements up to x_s",
    says: "the arm behaves like a bearing that sticks: after each reversal it first acts as a spring, then slides at a constant drag",
    confused_with: &["coulomb_friction", "cable_spring", "nonlinear_spring", "linear_parameters"],
    experiment: "the same multisine at three amplitudes over a decade, and a slow triangle with small nested reversals",
    band_hz: [1.0, 150.0],
};

/// Elements of the Maxwell-slip row: enough for a smooth parabola (kinks below 0.2 % of the level).
const ELEMENTS: usize = 12;

struct Dahl {
    length: f64,
    z: f64,
}

fn dahl(z: f64, dx: f64, length: f64) -> f64 {
    let s = dx.signum();
    s - (s - z) * (-dx.abs() / length).exp()
}

impl Law for Dahl {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -0.5 * (self.z + dahl(self.z, to.x - from.x, self.length));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.z = dahl(self.z, to.x - from.x, self.length);
    }
}

/// Elements i = 1..n yield at i/n of the sliding length; each carries 1/n of the stiffness 2/x_s.
struct MaxwellSlip {
    length: f64,
    /// Stretch of each spring over its yield length.
    stretch: [f64; ELEMENTS],
}

impl MaxwellSlip {
    fn level(stretch: &[f64; ELEMENTS]) -> f64 {
        let n = ELEMENTS as f64;
        // The levels i sum to n (n + 1)/2: the row slides at 1.
        stretch.iter().enumerate().map(|(i, s)| s * (i + 1) as f64).sum::<f64>() * 2.0 / (n * (n + 1.0))
    }

    fn moved(&self, dx: f64) -> [f64; ELEMENTS] {
        let mut next = self.stretch;
        for (i, s) in next.iter_mut().enumerate() {
            *s = (*s + dx * ELEMENTS as f64 / ((i + 1) as f64 * self.length)).clamp(-1.0, 1.0);
        }
        next
    }
}

impl Law for MaxwellSlip {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -0.5 * (Self::level(&self.stretch) + Self::level(&self.moved(to.x - from.x)));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.stretch = self.moved(to.x - from.x);
    }
}

impl Effect for PivotFriction {
    fn facts(&self) -> &'static Facts {
        &FACTS
    }

    fn grid(&self, scene: &Scene) -> Vec<Vec<f64>> {
        // Below some twelve times the sensor's noise the hysteresis cannot be told from dry friction.
        let low = (12.0 * scene.noise).max(2e-3 * scene.travel);
        let lengths = logarithmic(low, 4.0 * scene.travel, 14);
        lengths.iter().flat_map(|&l| [vec![l, 0.0], vec![l, 1.0]]).collect()
    }

    fn law(&self, inner: &[f64], _scene: &Scene) -> Box<dyn Law> {
        if inner[1] < 0.5 {
            Box::new(Dahl { length: inner[0], z: 0.0 })
        } else {
            Box::new(MaxwellSlip { length: inner[0], stretch: [0.0; ELEMENTS] })
        }
    }

    fn parameters(&self, setting: &Setting, _scene: &Scene) -> Vec<Parameter> {
        vec![
            Parameter::new("sliding_length", setting.inner[0], Unit::Position),
            Parameter::new("level_command", setting.strengths[0], Unit::Command),
            Parameter::new("shape", setting.inner[1], Unit::Ratio),
        ]
    }

    fn restore(&self, given: &Given, _scene: &Scene) -> Result<Setting, PhysicsError> {
        let inner = vec![given.positive("sliding_length")?, given.or("shape", 0.0)];
        Ok(Setting { inner, strengths: vec![given.need("level_command")?] })
    }
}
