//! Play between the arm and what it pushes: a loose pushpin.
//!
//! The pushed part rests until the arm has crossed the gap: p = clip(p, x - g/2, x + g/2), the play operator (Krasnoselskii,
//! Pokrovskii 1989); what is recorded is p. Contact is taken as rigid and the part as held by its own friction.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};

/// The play.
#[derive(Clone, Debug, PartialEq)]
pub struct Backlash {
    /// Gap between the two contacts (position_unit), above 0.
    pub gap: f64,
}

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "backlash",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "m = p, p = clip(p, x - g/2, x + g/2)",
    says: "there is play between the arm and the part it pushes: after each reversal the part waits until the gap is crossed",
    confused_with: &["coulomb_friction", "pivot_friction", "quantisation"],
    experiment: "slow triangles of three sizes with the PES and the encoder recorded: the PES stops at reversals",
    band_hz: [1.0, 5000.0],
};

struct Play {
    half: f64,
    part: Option<f64>,
}

impl Play {
    fn next(&self, from: &Sample, to: &Sample) -> f64 {
        // Not `clamp`, which panics where the motion is no number.
        self.part.unwrap_or(from.x).max(to.x - self.half).min(to.x + self.half)
    }
}

impl Law for Play {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to) - to.x;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.part = Some(self.next(from, to));
    }
}

impl Parametric for Backlash {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Loop
    }

    fn grid(scene: &Scene) -> Vec<Backlash> {
        // A gap below the sensor's noise still shows: thousands of reversals tell of it.
        let low = (0.1 * scene.noise).max(1e-5 * scene.travel);
        logarithmic(low, scene.travel, 24).into_iter().map(|gap| Backlash { gap }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.gap)]
    }

    fn in_motion(&self, _scene: &Scene) -> Box<dyn Law> {
        Box::new(Play { half: 0.5 * self.gap.abs(), part: None })
    }

    fn parameters(&self, _strengths: &[f64], _scene: &Scene) -> Vec<Parameter> {
        vec![Parameter::new("gap", self.gap, Unit::Position)]
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, _scene: &Scene) -> Result<(Backlash, Vec<f64>), PhysicsError> {
        Ok((Backlash { gap: given.positive("gap")? }, vec![1.0]))
    }
}
