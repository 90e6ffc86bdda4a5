//! Whether the laws of the search's model may be named: they may where no row of a table objects.
//!
//! In: what was found before the verdict. Out: yes or no, and what is said of the objections. Spec: `specs/mismatch.md`.

use super::confirmation::Confirmation;
use super::facts::Facts;
use super::finding::FitFigures;
use super::held_out::{HeldOut, contradicts};
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::simulation::Simulation;
use crate::diagnose::rules::{
    Answer, BELOW_NOISE, CLEAN, CLEAN_EXPLAINS, CLEAN_HELD_OUT, Consulted, DECISIVE_LEFT, DECISIVE_RIVAL,
    DECISIVE_SHARE, HELD_OUT_ABOVE, HELD_OUT_CLEAR, HELD_OUT_DOWN, HELD_OUT_FAR, HELD_OUT_HOLDS, HELD_OUT_NO_WORSE,
    LAW_SHORT, LEFTOVER, MIXTURE_LAWS, MIXTURE_LEFT, NAMED_SHARE, NAMED_SHARE_OF_SEVERAL, RESTLESS_RATIO, asked,
};
use crate::diagnose::search::residual_effect::ResidualEffect;
use crate::diagnose::search::selection::Selection;
use crate::diagnose::search::shortlist::same_drag;

/// What stands for and against the laws of the model.
pub(super) struct Laws<'a> {
    facts: &'a Facts<'a>,
    model: &'a Model,
    /// Share of the error in excess of noise that they explain.
    pub explained: f64,
    /// Whether they bring it down to the noise.
    pub clean: Answer,
    /// The record that was not used and contradicts them.
    against: Option<&'a HeldOut>,
    /// The law that the held-out records reject.
    rejected: Option<&'a Confirmation>,
    /// What is still seen beside them.
    beside: Option<&'a ResidualEffect>,
}

/// Something that speaks against names.
struct Objection {
    holds: fn(&Laws) -> Answer,
    /// What is said of it.
    says: fn(&Laws) -> Option<String>,
}

/// All objections. None hides another: each that holds is said.
const OBJECTIONS: [Objection; 10] = [
    // A held-out record contradicts the laws.
    Objection { holds: |l| contradicted(l), says: |l| l.against.map(said_against) },
    // The held-out records reject one of them.
    Objection { holds: |l| rejected(l), says: |l| l.rejected.map(said_rejected) },
    // Several laws share the work, and none leads.
    Objection { holds: |l| mixture(l), says: |l| Some(said_mixture(l.model)) },
    // Another law still sees something beside them.
    Objection { holds: |l| seen_beside(l), says: |l| l.beside.map(said_beside) },
    // They explain too little: less than a name needs, are not down to the noise, and lead no rival clearly.
    Objection { holds: |l| !(enough(l) | l.clean.clone() | decisive(l)), says: |_| None },
    // Of several laws together more is asked while yet another sees something: each further one is nearer to anything.
    Objection { holds: |l| too_many(l), says: |_| None },
    // What they were fitted to is the encoder's rounding.
    Objection { holds: |l| below_noise(l) | rounding(l.facts), says: |_| None },
    // They leave several times the noise of held-out records in closed loop, or twice the noise and the larger part.
    Objection { holds: |l| left_in_loop(l.facts), says: |_| None },
    // They hold neither along the motion nor simulated.
    Objection { holds: |l| !holds(l.facts), says: |_| None },
    // The reported simulation withdrew their model.
    Objection { holds: |l| l.facts.reported.withdrawn.is_some().into(), says: |_| None },
];

impl<'a> Laws<'a> {
    pub fn of(facts: &'a Facts<'a>) -> Laws<'a> {
        let model = facts.selection.best();
        let baseline = &facts.selection.baseline;
        let explained = if baseline.excess() > 0.0 { 1.0 - model.excess().max(0.0) / baseline.excess() } else { 1.0 };
        // A law that is asked where it hardly acts errs by its form; alone it has answered where hold-out records come down to their noise by it.
        let answered = model.chosen.len() < 2 && down(facts).yes;
        Laws {
            facts,
            model,
            explained,
            clean: clean(facts, explained),
            against: contradicts(facts.data, facts.held_out, &facts.selection.model),
            rejected: facts.confirmed.iter().find(|c| c.rejected() && !answered),
            beside: facts.selection.leftover.as_ref(),
        }
    }

    /// Whether they may be named, what is said against it, and the rules that were consulted.
    pub fn named(&self) -> (bool, Vec<String>, Vec<Consulted>) {
        let all = OBJECTIONS.iter().map(|o| ((o.holds)(self), o.says));
        let (mut named, mut remarks, mut consulted) = (true, Vec::new(), Vec::new());
        for (objects, says) in all {
            consulted.extend(objects.consulted);
            if objects.yes {
                named = false;
                remarks.extend(says(self));
            }
        }
        (named, remarks, consulted)
    }
}

/// Whether the hold-out records are simulated down to their noise by the laws, and only by them.
fn down(facts: &Facts) -> Answer {
    facts.fit.holdout.map_or(false.into(), |h: FitFigures| {
        asked!(h.rms_after / h.noise_floor, < HELD_OUT_DOWN)
            & asked!(h.rms_refit_linear / h.rms_after, > HELD_OUT_ABOVE)
    })
}

/// Down to the noise, and not only because there was little above it; or as near as its level may err, no law seeing anything more.
fn clean(facts: &Facts, explained: f64) -> Answer {
    let (model, baseline) = (facts.selection.best(), &facts.selection.baseline);
    let near = |m: &Model| asked!(m.excess_sigma(), < CLEAN);
    let spent = Answer::from(facts.selection.leftover.is_none()) & asked!(model.cost / model.freedom, < RESTLESS_RATIO);
    // The level of the noise errs in the records that it is taken from; those that were held out tell on their own how much is explained.
    let held = facts.whitened.map_or(false.into(), |[refit, after]| {
        asked!((after - 1.0) / (refit - 1.0), CLEAN_HELD_OUT: after - 1.0 < CLEAN_HELD_OUT * (refit - 1.0))
    });
    let explains = asked!(explained, >= CLEAN_EXPLAINS);
    let explains_half = asked!(explained, CLEAN_EXPLAINS: explained >= CLEAN_HELD_OUT * CLEAN_EXPLAINS);
    (near(model) & near(baseline)) | (explains & (near(model) | spent.clone())) | (explains_half & spent & held)
}

fn contradicted(l: &Laws) -> Answer {
    asked!(None, HELD_OUT_FAR: l.against.is_some())
}

fn said_against(h: &HeldOut) -> String {
    format!(
        "the nearest law holds on the records that it was fitted to, but not on {}, which {}: whitened error {:.3} after {:.3} under the linear refit, 1 being noise",
        h.record,
        if h.inside { "stays within their range" } else { "goes beyond their range" },
        h.whitened[1],
        h.whitened[0]
    )
}

fn rejected(l: &Laws) -> Answer {
    let kept = l.facts.confirmed.iter().map(|c| c.gains / c.says).reduce(f64::min);
    let kept = l.rejected.map(|c| c.gains / c.says).or(kept);
    asked!(kept, LAW_SHORT: l.rejected.is_some())
}

fn said_rejected(c: &Confirmation) -> String {
    format!(
        "{} is rejected on held-out records: it should lower their whitened squared error by {:.0}, and lowers it by {:.0}",
        c.effect, c.says, c.gains
    )
}

fn mixture(l: &Laws) -> Answer {
    let laws = l.model.chosen.len() as f64;
    Answer::from(l.facts.data.noise_known) & asked!(laws, MIXTURE_LAWS: l.facts.selection.mixture()) & stand_in(l)
}

/// Whether several laws may only stand in for one: those that bring records which were held out down to the noise do not, where the linear refit
/// leaves so much that an error of the noise's level cannot feign it.
fn stand_in(l: &Laws) -> Answer {
    l.facts.whitened.map_or(true.into(), |[refit, after]| {
        let left = (after - 1.0) / (refit - 1.0);
        asked!(left, MIXTURE_LEFT: !(MIXTURE_LEFT * (refit - 1.0) > HELD_OUT_CLEAR && left < MIXTURE_LEFT))
    })
}

fn said_mixture(model: &Model) -> String {
    let laws: Vec<&str> = model.chosen.iter().map(|c| c.setting.facts().name).collect();
    format!(
        "it takes {} together to explain the records and none leads: likelier one thing that the library lacks; the corrected plant carries the mixture as a stand-in",
        laws.join(", ")
    )
}

fn seen_beside(l: &Laws) -> Answer {
    l.beside.map_or(false.into(), |b| asked!(b.share, > LEFTOVER))
}

fn said_beside(l: &ResidualEffect) -> String {
    format!(
        "beside the nearest laws {} can still be seen, with {:.1} % of what they explain: they are near to what acts here, and not it",
        l.effect,
        100.0 * l.share
    )
}

fn enough(l: &Laws) -> Answer {
    asked!(l.explained, >= NAMED_SHARE)
}

/// Whether they lead every rival clearly.
fn decisive(l: &Laws) -> Answer {
    // In open loop a free body drifts, and how far from the noise it ends says little of the law.
    let shown = l.facts.fit.holdout.filter(|_| l.facts.fit.simulation == Simulation::ClosedLoop);
    let near = shown.map_or(
        true.into(),
        |h| asked!(h.rms_after / h.noise_floor, DECISIVE_LEFT: h.rms_after <= DECISIVE_LEFT * h.noise_floor),
    );
    near & asked!(l.explained, >= DECISIVE_SHARE) & asked!(rival_share(l.facts.selection), < DECISIVE_RIVAL)
}

fn too_many(l: &Laws) -> Answer {
    let laws = l.model.chosen.len();
    // What is seen beside two that simulate the hold-out records down to their noise is the roughness of their form.
    let two = Answer::from(laws > 1) & !l.clean.clone() & asked!(l.explained, < NAMED_SHARE_OF_SEVERAL);
    let two = if laws == 2 { two & !down(l.facts) } else { two };
    let many = Answer::from(laws > 2) & stand_in(l);
    Answer::from(l.beside.is_some()) & (many | two)
}

/// Where all noise is the encoder's rounding, it is no draw of chance, and what fits it takes nothing of other records.
fn below_noise(l: &Laws) -> Answer {
    let baseline = &l.facts.selection.baseline;
    let below = baseline.cost < BELOW_NOISE * baseline.freedom;
    asked!(baseline.cost / baseline.freedom, BELOW_NOISE: below)
        & l.facts.whitened.is_some_and(|[refit, after]| after >= refit).into()
}

/// Whether the encoder's rounding is what the laws were fitted to: they take nothing of records that were not used.
pub(super) fn rounding(facts: &Facts) -> Answer {
    let shown = facts.fit.holdout.filter(|_| facts.data.coarse());
    shown.map_or(false.into(), |h| {
        let near = h.rms_refit_linear < HELD_OUT_HOLDS * h.noise_floor;
        asked!(h.rms_refit_linear / h.noise_floor, HELD_OUT_HOLDS: near) & (h.rms_after >= h.rms_refit_linear).into()
    })
}

fn left_in_loop(facts: &Facts) -> Answer {
    facts.fit.holdout.map_or(false.into(), |h| facts.loop_left(h) | facts.less_than_half(h))
}

/// Along the recorded motion, and simulated: in closed loop limits and noise play into each other, in open loop a free body drifts away; a model
/// must hold in one of them.
fn holds(facts: &Facts) -> Answer {
    let along = facts.whitened.map_or(true.into(), |[refit, after]| {
        asked!(after / refit, HELD_OUT_NO_WORSE: after <= HELD_OUT_NO_WORSE * refit)
            | asked!(after, HELD_OUT_HOLDS: after <= HELD_OUT_HOLDS)
    });
    let simulated = |h: FitFigures| {
        let no_worse = h.rms_after <= HELD_OUT_NO_WORSE * h.rms_refit_linear;
        let near = h.rms_after <= HELD_OUT_HOLDS * h.noise_floor;
        asked!(h.rms_after / h.rms_refit_linear, HELD_OUT_NO_WORSE: no_worse)
            | asked!(h.rms_after / h.noise_floor, HELD_OUT_HOLDS: near)
    };
    let simulations = facts.fit.holdout.into_iter().chain(facts.fit.open_loop).map(simulated);
    along & simulations.reduce(|a, b| a | b).unwrap_or(true.into())
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
