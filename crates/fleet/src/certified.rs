//! A second opinion on a slot's final table: its margins bounded at every frequency, between the points of the sweep too, by the prover of
//! [`servotune::verify`], which shares no algorithm with the search and its margins.
//!
//! In: the plants of every case, identified, drawn and at each temperature. Out: [`Certified`]. It speaks of these models, [`super::worst_case()`] of the
//! measured curve: the two differ by what the model leaves over. The write is not in it. Spec: `specs/fleet.md`, "Acceptance".

use super::{Context, Evidence};
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::tune::{Limits, Requirement, Side, What};
use servotune::verify::{LoopBounds, Stability, Uncertainty, VerifySettings, prove_loop};

/// What is proved of a table on the models of all cases.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Certified {
    /// Every loop is stable and no limit of a margin is missed.
    pub passes: bool,
    /// Largest miss of a limit of a margin by the proven bound, as a share of the limit; negative where there is room. None where a loop is not
    /// proved stable or a bound is open.
    pub worst: Option<f64>,
    /// The limit nearest to being missed, or without a bound.
    pub limit: Option<What>,
    /// In which case.
    pub case: String,
    /// Why nothing is said, where nothing is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open: Option<String>,
}

/// Tighter than the guard by more than ten times: Ms to 1e-3, angles to 0.03 deg, gain to 4e-3 dB.
const SETTINGS: VerifySettings = VerifySettings { relative: 1e-3, angle_rad: 5e-4, ln_size: 5e-4, cells: 100_000 };

/// Proves the margins of a table on the plant of every case.
pub fn certified(context: &Context, evidence: &Evidence, gains: &Controller) -> Certified {
    let open = |case: usize, limit: Option<What>, why: String| Certified {
        limit,
        case: evidence.case(case).to_owned(),
        open: Some(why),
        ..Certified::default()
    };
    let sections = match gains.sections() {
        Ok(sections) => sections,
        Err(e) => return open(0, None, e.to_string()),
    };
    let wanted = Requirement::list(&context.spec.margins, &Limits::default());
    let mut all = Certified::default();
    for (case, plant) in evidence.plants().enumerate() {
        let b = match prove_loop(plant, &sections.chain, gains.sample_time_s, &Uncertainty::default(), &SETTINGS) {
            Ok(b) => b,
            Err(e) => return open(case, None, e.to_string()),
        };
        if b.stability != Stability::Stable {
            return open(case, None, "not proved stable".into());
        }
        for w in &wanted {
            let Some(violation) = missed(w, &b) else { return open(case, Some(w.what), "no bound".into()) };
            if all.worst.is_none_or(|x| violation > x) {
                (all.worst, all.limit) = (Some(violation), Some(w.what));
                evidence.case(case).clone_into(&mut all.case);
            }
        }
    }
    all.passes = all.worst.is_none_or(|x| x <= 0.0);
    all
}

/// The violation at the bad end of what is proved; none where that end is open.
fn missed(w: &Requirement, b: &LoopBounds) -> Option<f64> {
    let found = match w.what {
        What::PhaseMargin => b.phase_margin_deg,
        What::GainMargin => b.gain_margin_db,
        What::MaxSensitivity => b.max_sensitivity,
        _ => b.gain_crossover_hz,
    };
    match (w.side, found.low, found.high) {
        (Side::AtLeast, Some(low), _) => Some(w.violation(low)),
        // A loop that never crosses has all the margin there is.
        (Side::AtLeast, None, _) if w.what != What::GainCrossover => Some(-super::UNSTABLE),
        (Side::AtMost, _, Some(high)) => Some(w.violation(high)),
        _ => None,
    }
}
