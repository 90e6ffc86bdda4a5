//! One line of a sealed set: how a diagnosis came out beside the truth.

use serde::{Deserialize, Serialize};
use servotune::diagnose::{Diagnosis, Verdict};

/// Names that are of one family: a drag with a short and with a long sliding length, a line of the spindle and any other.
const KIN: [&[&str]; 2] = [&["coulomb_friction", "pivot_friction"], &["repeatable_runout", "line_disturbance"]];

/// How a diagnosis came out beside the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Nothing acts, and nothing is found.
    Silent,
    /// Nothing acts, and something is found.
    FalseAlarm,
    /// What acts is named, all of it, and nothing else.
    Right,
    /// What acts stands in the families that are given, and nothing else is named.
    InFamily,
    /// Some of what acts is named, and nothing else.
    Partly,
    /// Something else is named.
    Wrong,
    /// A mismatch is said, without a name.
    Unexplained,
    /// Something acts, and nothing is said.
    Missed,
    /// The program ended with an error.
    Refused,
}

/// One case as it came out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Name in the set.
    pub id: String,
    /// What acts, in a word.
    pub kind: String,
    /// Whether the given model was fitted under it.
    pub fitted_under: bool,
    /// Squares of what acts in the positions of the fitted records, over the noise.
    pub lambda: f64,
    /// Names that are right.
    pub expected: String,
    /// Verdict.
    pub verdict: String,
    /// Families that were given.
    pub findings: String,
    /// Outcome.
    pub outcome: Outcome,
    /// Simulation of held-out records over what repeats differ by: given model, linear refit, with findings.
    pub holdout: [f64; 3],
    /// Share of the excess on held-out records that a curve without a name explains; none where none is offered.
    pub curve: Option<f64>,
    /// Known numbers whose interval holds them, and all that were reported.
    pub held: [usize; 2],
    /// Time (s), two cases at once.
    pub seconds: f64,
}

/// How a diagnosis stands beside the truth.
pub fn outcome(expected: &[&str], acts: bool, d: &Diagnosis) -> Outcome {
    let found: Vec<&[String]> =
        d.findings.iter().filter(|f| f.effect != "unexplained").map(|f| &f.family[..]).collect();
    let silent = matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit);
    if !acts {
        return if silent && found.is_empty() { Outcome::Silent } else { Outcome::FalseAlarm };
    }
    if silent {
        return Outcome::Missed;
    }
    let kin =
        |name: &str| expected.iter().any(|e| *e == name || KIN.iter().any(|k| k.contains(e) && k.contains(&name)));
    let meets = |family: &[String]| family.iter().any(|name| kin(name));
    if d.verdict == Verdict::LocatedUnexplained || found.is_empty() {
        return Outcome::Unexplained;
    }
    if !found.iter().all(|f| meets(f)) {
        return Outcome::Wrong;
    }
    let exact = |e: &&str| found.iter().any(|f| f.len() == 1 && f[0] == *e);
    if expected.iter().all(exact) && found.len() == expected.len() {
        Outcome::Right
    } else if found.len() >= expected.len() {
        Outcome::InFamily
    } else {
        Outcome::Partly
    }
}
