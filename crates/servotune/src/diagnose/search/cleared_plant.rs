//! Where a search sets out: the plant, what it was cleared of, and what the best linear plant leaves.

use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::lti::Plant;

/// Where a search sets out.
#[derive(Default)]
pub(in crate::diagnose) struct Departure {
    /// Another plant than the given one, where that conceals what acts.
    pub from: Option<Cleared>,
    /// What the best linear plant leaves in plain simulation (position_unit, rms); 0 where nobody looked.
    pub linear: f64,
    /// What one number does beside the given plant where a linear refit moves several.
    pub remark: Option<String>,
}

/// A plant from which the search sets out, and what it was cleared of.
pub(in crate::diagnose) struct Cleared {
    pub plant: Plant,
    /// The law, where it has a name.
    pub law: Option<SelectedEffect>,
    /// Whether it was a curve without one.
    pub curve: bool,
    /// Whether the plant is the given one: a law beside it explains all.
    pub given_stands: bool,
    /// What plant and law leave of each run in plain simulation (position_unit).
    pub left: Vec<Vec<f64>>,
}

impl Cleared {
    /// A plant that was fitted together with a curve.
    pub fn beside_curve(plant: Plant, left: Vec<Vec<f64>>) -> Cleared {
        Cleared { plant, law: None, curve: true, given_stands: false, left }
    }

    /// Whether a law or a curve stands beside the plant: what both leave is noise, what a plant leaves alone may be anything.
    pub fn bends(&self) -> bool {
        self.law.is_some() || self.curve
    }

    /// The remark about it.
    pub fn says(&self) -> &'static str {
        match (&self.law, self.curve) {
            (Some(_), _) if self.given_stands => {
                "the search set out from the given plant with a law beside it: both leave at most a tenth more than the noise"
            }
            (Some(_), _) => {
                "the search set out from a plant fitted together with a law: neither the given one nor a refit of it alone comes near the records"
            }
            (None, true) => {
                "the search set out from a plant fitted together with a curve without a name: neither the given one nor a refit of it alone comes near the records"
            }
            (None, false) => {
                "the search set out from a plant fitted to the balance of torques: the given one is far off"
            }
        }
    }
}
