//! Whether a table meets every limit in a slot, in every case: the one place that says "proven".
//!
//! In: the slot's cases, a controller, the spec. Out: [`Proved`]: figures as measured, and the worst case with the limit that it misses most.
//! Every figure is that of the exact judgement ([`judge`]), never of the search's grid.

use super::Evidence;
use crate::controller::Controller;
use crate::tune::{Proof, Spec, Summary, TuneError, What, judge};
use serde::{Deserialize, Serialize};

/// A table judged in every case of a slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Proved {
    /// Every limit is met in every case.
    pub passes: bool,
    /// Figures as measured.
    pub figures: Summary,
    /// Largest miss over all cases, as a share of the limit; negative where there is room; very large where unstable.
    pub worst: f64,
    /// The limit that is nearest to being missed, or missed most.
    pub limit: What,
    /// In which case.
    pub case: String,
    /// Frequency that goes with the limit (Hz): of the crossing, of the sensitivity's peak, of the band or harmonic.
    pub at_hz: Option<f64>,
}

/// Stands for an unstable loop: far above any share of a limit, and finite, so that it can be written.
pub const UNSTABLE: f64 = 1e3;

/// Judges a controller in every case.
pub fn prove(evidence: &Evidence, controller: &Controller, spec: &Spec) -> Result<Proved, TuneError> {
    let machines = evidence.machines();
    let measured = judge(&machines[0], controller, spec)?;
    let (mut worst, mut limit, mut at_hz) = nearest(&measured, spec);
    let mut case = 0;
    for (i, machine) in machines.iter().enumerate().skip(1) {
        let found = nearest(&judge(machine, controller, spec)?, spec);
        if found.0 > worst {
            ((worst, limit, at_hz), case) = (found, i);
        }
    }
    let case = evidence.case(case).to_owned();
    Ok(Proved { passes: worst <= 0.0, figures: figures_of(&measured), worst, limit, case, at_hz })
}

/// The limit nearest to being missed: its violation, what it is, and where.
fn nearest(proof: &Proof, spec: &Spec) -> (f64, What, Option<f64>) {
    let m = &proof.margins;
    if proof.judged.found.unstable_poles != 0 || !m.stable {
        return (UNSTABLE, What::GainMargin, m.phase_crossover_hz);
    }
    let mut worst = (-UNSTABLE, What::PhaseMargin, None);
    for l in &proof.judged.limits {
        let violation = l.violation.clamp(-UNSTABLE, 0.5 * UNSTABLE);
        if violation > worst.0 {
            let [first, last] = spec.profile.pes.window;
            let at_hz = match l.wanted.what {
                What::PhaseMargin | What::GainCrossover => m.gain_crossover_hz,
                What::GainMargin => m.phase_crossover_hz,
                What::MaxSensitivity => Some(m.max_sensitivity_hz),
                What::Harmonic { k } => Some(k as f64 * spec.profile.pes.sample_rate_hz / (last - first) as f64),
                What::DftLow | What::DftHigh | What::CommandPeak => None,
            };
            worst = (violation, l.wanted.what, at_hz);
        }
    }
    worst
}

/// The figures; what is infinite becomes the largest number, which can be written.
fn figures_of(proof: &Proof) -> Summary {
    let mut s = Summary::of(proof);
    let values = [
        &mut s.max_sensitivity,
        &mut s.max_sensitivity_hz,
        &mut s.modulus_margin,
        &mut s.disk_margin,
        &mut s.dft_low,
        &mut s.dft_high,
        &mut s.command_peak,
    ];
    for value in values {
        if !value.is_finite() {
            *value = f64::MAX;
        }
    }
    s
}
