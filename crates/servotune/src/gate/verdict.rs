//! What the gate says of one machine.
//!
//! In: a gate and a row. Out: class, probabilities, action, and why; in doubt `inspect`. Spec: `specs/gate.md`.

use super::attribution::Decided;
use super::classes::{Action, Label};
use super::novelty::NoveltyScore;
use serde::Serialize;

/// A reason not to decide.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Doubt {
    /// More than one class is possible at the stated coverage.
    SeveralClasses {
        /// Names of the classes.
        possible: Vec<String>,
        /// The coverage.
        coverage: f64,
    },
    /// An inspection costs less than any action is expected to.
    Cost {
        /// Expected cost of the class's own action.
        expected: f64,
        /// Expected cost of an inspection.
        inspection: f64,
    },
    /// Another class's action is expected to cost less than the most probable class's own.
    OtherAction {
        /// The cheaper class.
        class: String,
    },
    /// The machine is of no known class.
    Unknown {
        /// Share of known machines that lie as far out.
        p_value: f64,
        /// The feature farthest out.
        feature: String,
        /// How far (robust standard deviations of the class).
        deviations: f64,
    },
    /// The identified plant speaks for another class.
    PlantDisagrees {
        /// The class that the plant speaks for.
        class: String,
        /// What the plant gives the network's class.
        probability: f64,
    },
    /// More than half of the network's features are missing.
    Missing {
        /// Their names.
        features: Vec<String>,
    },
}

impl Doubt {
    /// The reason in words.
    pub fn words(&self) -> String {
        match self {
            Doubt::SeveralClasses { possible, coverage } => {
                format!("at {:.1} % coverage it may be {}", 100.0 * coverage, possible.join(" or "))
            }
            Doubt::Cost { expected, inspection } => {
                format!("the action is expected to cost {expected:.3}, an inspection {inspection:.3}")
            }
            Doubt::OtherAction { class } => format!("the action for {class} is expected to cost less"),
            Doubt::Unknown { p_value, feature, deviations } => format!(
                "of no known class: {:.2} % of known machines lie as far out; farthest is {feature}, {deviations:.1} deviations from the class",
                100.0 * p_value
            ),
            Doubt::PlantDisagrees { class, probability } => {
                format!("the identified plant speaks for {class} and gives this class {probability:.1e}")
            }
            Doubt::Missing { features } => {
                format!("more than half of the deciding features are missing: {}", features.join(", "))
            }
        }
    }
}

/// What the identified plant has to say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlantEvidence {
    /// `agrees`, `undecided`, `disagrees` or `absent`.
    pub says: &'static str,
    /// The class that the plant fits best.
    pub class: Option<Label>,
    /// Its probability of each class; empty where absent.
    pub probabilities: Vec<f64>,
}

/// The verdict on one row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GateVerdict {
    /// The row's id, where the table has them.
    pub id: Option<String>,
    /// Its line in the file.
    pub line: u64,
    /// The most probable class, as the training table writes it.
    pub class: Label,
    /// Its name.
    pub class_name: String,
    /// Its calibrated probability.
    pub probability: f64,
    /// Calibrated probability of every class, in the gate's order.
    pub probabilities: Vec<f64>,
    /// What to do.
    pub action: Action,
    /// Whether the gate left the decision to a person.
    pub abstained: bool,
    /// The reasons in a sentence.
    pub why: String,
    /// Reasons not to decide; empty where it decided.
    pub doubts: Vec<Doubt>,
    /// Classes possible at the stated coverage.
    pub set: Vec<Label>,
    /// The three features that decided, the strongest first.
    pub decided: Vec<Decided>,
    /// The second vote.
    pub plant: PlantEvidence,
    /// How unusual the machine is for its class; none where the gate has no such reference.
    pub novelty: Option<NoveltyScore>,
    /// Expected cost of each class's own action, in the gate's order.
    pub expected_cost: Vec<f64>,
    /// Features of the network that were missing and became the training median.
    pub imputed: Vec<String>,
}
