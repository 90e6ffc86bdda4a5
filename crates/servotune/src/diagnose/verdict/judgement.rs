//! From findings to a verdict: what the search found, what hold-out records say of it, and what the logs, the lines, pushes and the noise tell beside it.

use super::diagnosis_json::Diagnosis;
use super::finding::{Finding, FitFigures, Verdict};
use super::gain_modulation::gain_modulation;
use super::held_out::{HeldOut, astray, contradicts, unseen};
use super::line_finding::{line_findings, same_line};
use super::linear_verdict::{coloured, linear_verdict};
use super::naming::{finding, unexplained};
use super::offered_models::Reported;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::simulation::Simulation;
use crate::diagnose::rules::{
    BELOW_NOISE, BOOTSTRAP_CHANCE, CLEAN, CLEAN_EXPLAINS, CLEAN_HELD_OUT, DECISIVE_LEFT, DECISIVE_RIVAL,
    DECISIVE_SHARE, GIVEN_FAR, HELD_OUT_ABOVE, HELD_OUT_DOWN, HELD_OUT_HOLDS, HELD_OUT_NO_WORSE, LEFTOVER,
    LOOP_EXPLAINS, LOOP_EXPLAINS_HALF, LOOP_LEFT, LOOP_LEFT_TWICE, NAME_FAR, NAMED_SHARE, NAMED_SHARE_OF_SEVERAL,
    RESTLESS_RATIO, RESTLESS_SIGMA, SEEN_CHANCE, WIND_LEFT,
};
use crate::diagnose::search::selection::Selection;
use crate::diagnose::search::shortlist::same_drag;
use crate::lti::Plant;
use crate::numeric::digits::said;
use crate::physics::{AnyLaw, Port, library};

/// Findings that the search has no part in.
pub(in crate::diagnose) struct ByOthers {
    pub logs: Option<Finding>,
    pub shocks: Vec<Finding>,
    pub noise: Vec<Finding>,
}

/// What stands for and against the model of the search.
struct Evidence<'a> {
    data: &'a DiagnosisData,
    selection: &'a Selection,
    model: &'a Model,
    /// Share of the error in excess of noise that it explains.
    explained: f64,
    clean: bool,
    restless: bool,
    /// Whether it holds in the reported simulation and on records that were not used.
    holds: bool,
    /// The record that was not used and contradicts it.
    against: Option<HeldOut>,
}

impl<'a> Evidence<'a> {
    fn of(d: &Diagnosis, data: &'a DiagnosisData, selection: &'a Selection, reported: &Reported) -> Evidence<'a> {
        let (base, model) = (&selection.baseline, selection.best());
        let explained = if base.excess() > 0.0 { 1.0 - model.excess().max(0.0) / base.excess() } else { 1.0 };
        // Down to the noise, and not only because there was little above it; or as near as its level may err, no law seeing anything more.
        let spent = selection.leftover.is_none() && model.cost / model.freedom < RESTLESS_RATIO;
        // The level of the noise errs in the records that it is taken from; those that were held out tell on their own how much is explained.
        let held = d.holdout_whitened.is_some_and(|[refit, after]| after - 1.0 < CLEAN_HELD_OUT * (refit - 1.0));
        let clean = (model.excess_sigma() < CLEAN && base.excess_sigma() < CLEAN)
            || (explained >= CLEAN_EXPLAINS && (model.excess_sigma() < CLEAN || spent))
            || (explained >= CLEAN_HELD_OUT * CLEAN_EXPLAINS && spent && held);
        // Where no law was found, much more is asked of the excess: noise may differ a little from what its repeats say.
        let restless = model.excess_sigma() > RESTLESS_SIGMA && model.cost / model.freedom > RESTLESS_RATIO;
        // Along the recorded motion, and simulated: in closed loop limits and noise play into each other, in open loop a free body
        // drifts away; a model must hold in one of them.
        let simulated = |h: FitFigures| {
            h.rms_after <= HELD_OUT_NO_WORSE * h.rms_refit_linear || h.rms_after <= HELD_OUT_HOLDS * h.noise_floor
        };
        let simulations: Vec<FitFigures> = d.fit.holdout.into_iter().chain(d.fit.open_loop).collect();
        let holds = d
            .holdout_whitened
            .is_none_or(|[refit, after]| after <= HELD_OUT_NO_WORSE * refit || after <= HELD_OUT_HOLDS)
            && (simulations.is_empty() || simulations.into_iter().any(simulated))
            && reported.withdrawn.is_none();
        let against = contradicts(data, &d.held_out, &selection.model).cloned();
        Evidence { data, selection, model, explained, clean, restless, holds, against }
    }

    /// Whether the laws of the model may be named; what speaks against it is said.
    fn names(&self, d: &mut Diagnosis) -> bool {
        let Evidence { selection, model, explained, .. } = *self;
        // In open loop a free body drifts, and how far from the noise it ends says little of the law.
        let near = d.fit.simulation != Simulation::ClosedLoop
            || d.fit.holdout.is_none_or(|h| h.rms_after <= DECISIVE_LEFT * h.noise_floor);
        let decisive = near && explained >= DECISIVE_SHARE && rival_share(selection) < DECISIVE_RIVAL;
        if let Some(h) = &self.against {
            d.remarks.push(format!(
                "the nearest law holds on the records that it was fitted to, but not on {}, which {}: whitened error {:.3} after {:.3} under the linear refit, 1 being noise",
                h.record,
                if h.inside { "stays within their range" } else { "goes beyond their range" },
                h.whitened[1],
                h.whitened[0]
            ));
        }
        // A law that is asked where it hardly acts errs by its form; where the hold-out records are simulated down to their noise by it, and only
        // by it, they have answered.
        let down = |h: FitFigures| {
            h.rms_after < HELD_OUT_DOWN * h.noise_floor && h.rms_refit_linear > HELD_OUT_ABOVE * h.rms_after
        };
        let answered = model.chosen.len() < 2 && d.fit.holdout.is_some_and(down);
        let denied = d.confirmed.iter().find(|c| c.denied() && !answered).cloned();
        if let Some(c) = &denied {
            d.remarks.push(format!(
                "the records that were not used deny {}: it should take {:.0} units of their error, and takes {:.0}",
                c.effect, c.says, c.gains
            ));
        }
        let mixture = self.data.noise_known && selection.mixture();
        if mixture {
            let laws: Vec<&str> = model.chosen.iter().map(|c| c.setting.facts().name).collect();
            d.remarks.push(format!(
                "it takes {} together to explain the records and none leads: likelier one thing that the library lacks; the corrected plant carries the mixture as a stand-in",
                laws.join(", ")
            ));
        }
        let beside = selection.leftover.as_ref().filter(|l| l.share > LEFTOVER);
        if let Some(l) = beside {
            d.remarks.push(format!(
                "beside the nearest laws {} can still be seen, with {:.1} % of what they explain: they are near to what acts here, and not it",
                l.effect,
                100.0 * l.share
            ));
        }
        // Of several laws together more is asked while yet another sees something: each further one is nearer to anything.
        let laws = model.chosen.len();
        let several =
            selection.leftover.is_some() && (laws > 2 || laws > 1 && !self.clean && explained < NAMED_SHARE_OF_SEVERAL);
        // Where all noise is the encoder's rounding, it is no draw of chance, and what fits it takes nothing of other records.
        let below = selection.baseline.cost < BELOW_NOISE * selection.baseline.freedom;
        let rounded = below && d.holdout_whitened.is_some_and(|[refit, after]| after >= refit);
        let told = !rounded
            && !self.rounding(d)
            && (explained >= NAMED_SHARE || self.clean || decisive)
            && !several
            && beside.is_none()
            && !mixture;
        let left = d.fit.holdout.is_some_and(|h| loop_left(d, h) || less_than_half(d, h));
        told && !left && self.holds && self.against.is_none() && denied.is_none()
    }

    /// Whether the encoder's rounding is what the laws were fitted to: they take nothing of records that were not used.
    fn rounding(&self, d: &Diagnosis) -> bool {
        let near = |h: FitFigures| h.rms_refit_linear < HELD_OUT_HOLDS * h.noise_floor;
        self.data.coarse() && d.fit.holdout.is_some_and(|h| near(h) && h.rms_after >= h.rms_refit_linear)
    }

    /// The findings of the search by name.
    fn named(&self, d: &mut Diagnosis) {
        if !self.clean && self.explained < NAMED_SHARE {
            d.remarks.push(format!(
                "no other law of the library comes near, but {:.1} % of the error in excess of noise stays unexplained",
                100.0 * (1.0 - self.explained)
            ));
        }
        let mut found: Vec<Finding> = Vec::new();
        for f in (0..self.model.chosen.len()).filter_map(|at| finding(self.data, self.selection, at)) {
            if found.iter().all(|g| g.effect != f.effect) {
                found.push(f);
            }
        }
        if d.findings.is_empty() && !found.is_empty() {
            let open = found.iter().any(|f| f.family.len() > 1);
            d.verdict = if open { Verdict::Family } else { Verdict::Named };
        }
        // A log that slipped explains what comes after it better than any physics does.
        if d.verdict != Verdict::DataFault {
            d.findings.extend(found);
        }
    }

    /// There, without a name: unless it is a gain that swings in a phase of its own.
    fn unnamed(&self, d: &mut Diagnosis, explained: f64) {
        // A swing in one phase for all records may have taken the first step of one that has a phase in each.
        let of_the_gain = self.model.chosen.iter().all(|c| matches!(c.setting.law, AnyLaw::ParametricGain(_)));
        match of_the_gain.then(|| gain_modulation(self.data, self.selection)).flatten() {
            Some(f) => {
                d.verdict = Verdict::Named;
                d.findings.push(f);
            }
            None => {
                d.verdict = Verdict::LocatedUnexplained;
                d.findings.push(unexplained(self.data, self.selection, explained));
            }
        }
    }
}

/// From findings to a verdict.
pub(in crate::diagnose) fn judge(
    d: &mut Diagnosis,
    data: &DiagnosisData,
    selection: &Selection,
    given: &Plant,
    reported: &Reported,
    by_others: ByOthers,
) {
    let evidence = Evidence::of(d, data, selection, reported);
    let ByOthers { logs, shocks, noise } = by_others;
    if let Some(f) = logs {
        d.verdict = if f.port == Port::Controller { Verdict::Named } else { Verdict::DataFault };
        d.findings.push(f);
    }
    let chosen = !evidence.model.chosen.is_empty();
    if !believed(d, selection) && chosen {
        d.remarks.push(
            "the bootstrap finds as much in records without physics: the findings of the search are withdrawn".into(),
        );
    } else if chosen {
        let said = d.remarks.len();
        d.remarks.extend(reported.withdrawn.clone());
        if evidence.names(d) {
            evidence.named(d);
        } else if selection.baseline.excess_sigma() < CLEAN || evidence.rounding(d) {
            // Nothing is there to be named, and nothing to be said of it.
            d.remarks.truncate(said);
        } else if d.findings.is_empty() {
            evidence.unnamed(d, evidence.explained);
        }
    } else if d.findings.is_empty()
        && let Some(f) = gain_modulation(data, selection)
    {
        d.verdict = Verdict::Named;
        d.findings.push(f);
    } else if (evidence.restless || unaccounted(selection)) && d.findings.is_empty() {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(unexplained(data, selection, 0.0));
    }
    if d.verdict != Verdict::DataFault {
        take_lines(d, data, selection, shocks);
    }
    linear_verdict(d, data, selection, given);
    if d.verdict == Verdict::Refit && !reported.refits {
        // The given plant stands as the refit; whether it agrees, its own error says, what further inputs move apart.
        let far = d.fit.fit.rms_refit_linear > GIVEN_FAR * d.fit.fit.noise_floor;
        d.verdict = if far { Verdict::LocatedUnexplained } else { Verdict::NoMismatch };
        d.findings.extend(far.then(|| unexplained(data, selection, 0.0)));
    }
    take_noise(d, data, noise);
    beyond_the_fit(d, data, selection);
    far_from_noise(d, data, selection);
}

/// Nothing is said to be explained while several times what repeats differ by stays in closed loop, where nothing drifts.
fn far_from_noise(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection) {
    let says = matches!(d.verdict, Verdict::Named | Verdict::Family | Verdict::NoMismatch | Verdict::Refit);
    let figures = d.fit.holdout.unwrap_or(d.fit.fit);
    if !(says && data.levels.from_repeats && loop_left(d, figures)) {
        return;
    }
    let times = figures.rms_after / figures.noise_floor;
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    let beside = if names.is_empty() { String::new() } else { format!(" beside {}", names.join(", ")) };
    d.remarks.push(format!("{times:.1} times the noise stay in the simulation{beside}: something else acts"));
    d.verdict = Verdict::LocatedUnexplained;
    d.findings = vec![unexplained(data, selection, figures.explained_share.clamp(0.0, 1.0))];
}

/// Whether names stand that leave several times what repeats differ by.
pub(in crate::diagnose) fn named_far_from_noise(d: &Diagnosis, data: &DiagnosisData) -> bool {
    let f = d.fit.holdout.unwrap_or(d.fit.fit);
    let named = matches!(d.verdict, Verdict::Named | Verdict::Family);
    named && data.levels.from_repeats && f.rms_after > NAME_FAR * f.noise_floor
}

/// Takes names back whose model leaves so many times the noise, for a curve that leaves this many.
pub(in crate::diagnose) fn yield_to_curve(
    d: &mut Diagnosis,
    data: &DiagnosisData,
    selection: &Selection,
    [names_leave, curve_leaves]: [f64; 2],
) {
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    d.remarks.push(format!(
        "{} is near to what acts, and not it: it leaves {} times the noise on records that were not fitted, a curve without a name {} times",
        names.join(", "),
        said(names_leave, 3),
        said(curve_leaves, 3)
    ));
    let share = d.fit.holdout.unwrap_or(d.fit.fit).explained_share.clamp(0.0, 1.0);
    d.verdict = Verdict::LocatedUnexplained;
    d.findings = vec![unexplained(data, selection, share)];
}

/// Whether these figures, of records in closed loop, leave several times the noise and much of what the given plant leaves.
fn loop_left(d: &Diagnosis, figures: FitFigures) -> bool {
    leaves(d, figures, LOOP_LEFT, LOOP_EXPLAINS)
}

/// Whether they leave twice the noise and more than half of what the given plant leaves.
fn less_than_half(d: &Diagnosis, figures: FitFigures) -> bool {
    leaves(d, figures, LOOP_LEFT_TWICE, LOOP_EXPLAINS_HALF)
}

fn leaves(d: &Diagnosis, figures: FitFigures, noise: f64, share: f64) -> bool {
    let far = figures.rms_after > noise * figures.noise_floor && figures.explained_share < share;
    d.fit.simulation == Simulation::ClosedLoop && far
}

/// Pushes and lines, which were found before the search.
fn take_lines(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection, shocks: Vec<Finding>) {
    let (lines, unsteady) = line_findings(data, selection);
    for f in shocks.into_iter().chain(lines) {
        if d.findings.is_empty() {
            d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        }
        if d.verdict != Verdict::LocatedUnexplained && !d.findings.iter().any(|g| same_line(g, &f)) {
            d.findings.push(f);
        }
    }
    if d.findings.is_empty() && !unsteady.is_empty() {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(super::line_finding::unsteady(data, &unsteady));
    }
}

/// What the fitted records do not show, or cannot.
fn beyond_the_fit(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection) {
    // Nothing missing on the records that were fitted, and yet one that was not used is far off.
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && let Some(f) = astray(data, &d.held_out).and_then(|h| unseen(data, selection, h))
    {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(f);
    }
    // Without repeats, what the refit leaves beyond the sensor's white noise may be noise of torque or missing physics.
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit) && coloured(d, data, data.levels.sensor_rms) {
        d.verdict = Verdict::Undecidable;
        d.remarks.push(
            "no record was repeated: the error that the refit leaves is coloured, and cannot be told from noise of torque".into(),
        );
    }
}

/// Whether the bootstrap, where there is one, believes the search: one that finds as much where nothing is has found nothing.
fn believed(d: &mut Diagnosis, selection: &Selection) -> bool {
    if let Some(b) = &selection.bootstrap {
        d.remarks.push(format!(
            "bootstrap of {} draws without physics: chance of a candidate as strong as on these records {:.3}; draws that would have been alarms {}",
            b.draws, b.p_value, b.alarms
        ));
    }
    selection.bootstrap.as_ref().is_none_or(|b| b.p_value <= BOOTSTRAP_CHANCE.max(1.0 / (b.draws + 1) as f64))
}

/// Findings of the noise beside those of the search. What is left without a name is theirs where the linear refit comes down to their noise:
/// a count of the encoder is no reason for what is a hundred times as large.
fn take_noise(d: &mut Diagnosis, data: &DiagnosisData, noise: Vec<Finding>) {
    let rounding = data.grid.map_or(0.0, |g| g.step / 12f64.sqrt());
    let beyond = coloured(d, data, data.levels.sensor_rms.hypot(rounding));
    let wind = noise.iter().any(|f| f.port == Port::Torque);
    let open = beyond && !wind;
    // A plant that was fitted under wind differs from that of records under other wind: as little as that has no name of its own.
    let h = d.fit.holdout.unwrap_or(d.fit.fit);
    let blown = wind && !data.coarse() && data.levels.from_repeats && h.rms_refit_linear < WIND_LEFT * h.noise_floor;
    if blown && d.verdict == Verdict::LocatedUnexplained {
        d.verdict = Verdict::Refit;
        d.findings.clear();
    }
    for f in noise {
        if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit) && !open {
            d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        }
        if matches!(d.verdict, Verdict::Named | Verdict::Family) {
            d.findings.push(f);
        }
    }
}

/// What the best rival of the first finding explains, as a share of what that finding does.
fn rival_share(selection: &Selection) -> f64 {
    let Some((step, taken)) = selection.steps.first().and_then(|s| s.taken.map(|t| (s, &s.tried[t]))) else {
        return 1.0;
    };
    let name = |i: usize| step.candidates[i].setting.facts().name;
    let gain = step.before - taken.1.evidence;
    let others = step.tried.iter().filter(|t| name(t.0) != name(taken.0) && !same_drag(name(t.0), name(taken.0)));
    others.map(|t| (step.before - t.1.evidence) / gain).fold(0.0, f64::max)
}

/// Whether a scan saw far more than noise shows, though no law explains enough of it.
fn unaccounted(selection: &Selection) -> bool {
    let best = selection.steps.first().and_then(|s| s.candidates.first());
    best.is_some_and(|c| c.log_p_value(library().len()) < SEEN_CHANCE.ln())
}
