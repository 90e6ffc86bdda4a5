//! Whether a table meets every limit in a slot, in every case: the one place that says "accepted".
//!
//! In: the slot's cases, a controller, the spec. Out: [`WorstCase`]: figures as measured, and the worst case with the limit that it misses most.
//! No margin is the search grid's.

use super::Ready;
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::feedback::{MeasuredLoop, margins};
use servotune::tune::{FoundFigures, Judged, Judgement, Machine, Requirement, Spec, Summary, TuneError, What, judge};

/// A table judged in every case of a slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorstCase {
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
///
/// Margins are refined on the measured curve; the write is read off the spectrum, prepared once for the slot. Gains of another shape than
/// the fleet's are judged by [`judge`], which prepares everything again.
pub fn worst_case(ready: &mut Ready<'_>, controller: &Controller) -> Result<WorstCase, TuneError> {
    let spec = ready.spec;
    let sections = controller.sections()?;
    // What the bench knows of the write; none where it saw an unstable case, whose write means nothing.
    let writes = if ready.fits(controller) { Some(ready.writes(controller)) } else { None };
    let unstable = matches!(writes, Some(None));
    let wanted = Requirement::list(&spec.margins, &spec.limits);
    let machines = ready.evidence.machines();
    let judged = |i: usize| -> Result<Judgement, TuneError> {
        match (&writes, &machines[i]) {
            (Some(writes), Machine::Response { frf, .. }) => {
                let found = writes.as_ref().map(|w| w[i].clone()).unwrap_or_default();
                Ok(measured(&MeasuredLoop::new(frf, &sections)?, found, &wanted))
            }
            _ => judge(&machines[i], controller, spec),
        }
    };
    let first = judged(0)?;
    let figures = figures_of(&first);
    let (mut worst, mut limit, mut at_hz) = nearest(&first, spec);
    let mut case = 0;
    for i in 1..machines.len() {
        let found = nearest(&judged(i)?, spec);
        if found.0 > worst {
            ((worst, limit, at_hz), case) = (found, i);
        }
    }
    if unstable && worst < UNSTABLE {
        (worst, limit) = (UNSTABLE, What::GainMargin);
    }
    let case = ready.evidence.case(case).to_owned();
    Ok(WorstCase { passes: worst <= 0.0, figures, worst, limit, case, at_hz: at_hz.filter(|hz| hz.is_finite()) })
}

/// The judgement of a measured loop whose write is known.
fn measured(l: &MeasuredLoop<'_>, write: FoundFigures, wanted: &[Requirement]) -> Judgement {
    let margins = margins(l);
    let found = FoundFigures {
        unstable_poles: margins.unstable_poles,
        phase_margin_deg: margins.phase_margin_deg,
        gain_margin_db: margins.gain_margin_db,
        max_sensitivity: margins.max_sensitivity,
        gain_crossover_hz: margins.gain_crossover_hz,
        ..write
    };
    Judgement { judged: Judged::of(wanted, found), margins }
}

/// The limit nearest to being missed: its violation, what it is, and where.
fn nearest(judgement: &Judgement, spec: &Spec) -> (f64, What, Option<f64>) {
    let m = &judgement.margins;
    if judgement.judged.found.unstable_poles != 0 || !m.stable {
        return (UNSTABLE, What::GainMargin, m.phase_crossover_hz);
    }
    let mut worst = (-UNSTABLE, What::PhaseMargin, None);
    for l in &judgement.judged.limits {
        let violation = l.violation.clamp(-UNSTABLE, 0.5 * UNSTABLE);
        if violation > worst.0 {
            let at_hz = match l.wanted.what {
                What::PhaseMargin | What::GainCrossover => m.gain_crossover_hz,
                What::GainMargin => m.phase_crossover_hz,
                What::MaxSensitivity => Some(m.max_sensitivity_hz),
                What::Harmonic { k } => spec.profile.as_ref().map(|p| {
                    let [first, last] = p.pes.window;
                    k as f64 * p.pes.sample_rate_hz / (last - first) as f64
                }),
                What::Curve { index } => judgement.judged.found.curves.get(index).map(|c| c.hz),
                What::Bandwidth => judgement.judged.found.bandwidth_hz,
                _ => None,
            };
            worst = (violation, l.wanted.what, at_hz);
        }
    }
    worst
}

/// The figures; what is infinite becomes the largest number, which can be written.
fn figures_of(judgement: &Judgement) -> Summary {
    let mut s = Summary::of(judgement);
    let values = [&mut s.max_sensitivity, &mut s.max_sensitivity_hz, &mut s.modulus_margin, &mut s.disk_margin];
    let figures = [&mut s.dft_low, &mut s.dft_high, &mut s.command_peak].into_iter().flatten();
    for value in values.into_iter().chain(figures) {
        if !value.is_finite() {
            *value = f64::MAX;
        }
    }
    s
}
