//! What the search comes to: laws by name, something without a name, or nothing.

use super::facts::Facts;
use super::finding::Finding;
use super::gain_modulation::gain_modulation;
use super::law_names::{Laws, rounding};
use super::naming::finding;
use crate::diagnose::rules::{
    Answer, BOOTSTRAP_CHANCE, CLEAN, Consulted, NAMED_SHARE, RESTLESS_RATIO, RESTLESS_SIGMA, SEEN_CHANCE, asked,
};
use crate::diagnose::search::selection::Selection;
use crate::physics::{AnyLaw, library};

/// What the search comes to.
#[derive(Default)]
pub(super) struct SearchFindings {
    /// What may be named.
    pub named: Vec<Finding>,
    /// Share that the nearest laws explain of what has no name, where there is such a thing.
    pub nameless: Option<f64>,
    pub remarks: Vec<String>,
    pub consulted: Vec<Consulted>,
}

impl SearchFindings {
    pub fn of(facts: &Facts) -> SearchFindings {
        let selection = facts.selection;
        let believed = believed(selection);
        let mut remarks: Vec<String> = said_bootstrap(selection).into_iter().collect();
        if selection.best().chosen.is_empty() {
            let found = if facts.log_checks.finding.is_none() { no_law(facts) } else { SearchFindings::default() };
            return SearchFindings { remarks, ..found };
        }
        if !believed.yes {
            remarks.push(
                "the bootstrap finds as much in records without physics: the findings of the search are withdrawn"
                    .into(),
            );
            return SearchFindings { remarks, consulted: believed.consulted, ..SearchFindings::default() };
        }
        let found = laws(facts);
        let consulted = [believed.consulted, found.consulted].concat();
        SearchFindings { remarks: [remarks, found.remarks].concat(), consulted, ..found }
    }
}

/// Where the search ended at a model with laws.
fn laws(facts: &Facts) -> SearchFindings {
    let (laws, selection) = (Laws::of(facts), facts.selection);
    let (named, against, consulted) = laws.named();
    let remarks: Vec<String> = facts.reported.withdrawn.clone().into_iter().chain(against).collect();
    if named {
        let left = (!laws.clean.yes && laws.explained < NAMED_SHARE).then(|| {
            format!(
                "no other law of the library comes near, but {:.1} % of the error in excess of noise stays unexplained",
                100.0 * (1.0 - laws.explained)
            )
        });
        let remarks = remarks.into_iter().chain(left).collect();
        return SearchFindings { named: by_name(facts), remarks, consulted, nameless: None };
    }
    let near = asked!(selection.baseline.excess_sigma(), < CLEAN) | rounding(facts);
    let consulted = [consulted, near.consulted].concat();
    if near.yes {
        // Nothing is there to be named, and nothing to be said of it.
        return SearchFindings { consulted, ..SearchFindings::default() };
    }
    let nothing = SearchFindings { remarks, consulted, ..SearchFindings::default() };
    if facts.log_checks.finding.is_some() {
        return nothing;
    }
    // A swing in one phase for all records may have taken the first step of one that has a phase in each.
    let of_the_gain = selection.best().chosen.iter().all(|c| matches!(c.setting.law, AnyLaw::ParametricGain(_)));
    match of_the_gain.then(|| gain_modulation(facts.data, selection)).flatten() {
        Some(f) => SearchFindings { named: vec![f], ..nothing },
        None => SearchFindings { nameless: Some(laws.explained), ..nothing },
    }
}

/// Where it ended without a law: a gain that swings in a phase of its own, much that no law explains, or nothing.
fn no_law(facts: &Facts) -> SearchFindings {
    if let Some(f) = gain_modulation(facts.data, facts.selection) {
        return SearchFindings { named: vec![f], ..SearchFindings::default() };
    }
    let something = restless(facts.selection) | unaccounted(facts.selection);
    let nameless = something.yes.then_some(0.0);
    SearchFindings { nameless, consulted: something.consulted, ..SearchFindings::default() }
}

/// The laws of the final model by name, each once.
fn by_name(facts: &Facts) -> Vec<Finding> {
    let all = (0..facts.selection.best().chosen.len()).filter_map(|at| finding(facts.data, facts.selection, at));
    all.fold(Vec::new(), |found: Vec<Finding>, f| {
        let known = found.iter().any(|g| g.effect == f.effect);
        found.into_iter().chain((!known).then_some(f)).collect()
    })
}

/// Whether the bootstrap, where there is one, believes the search: one that finds as much where nothing is has found nothing.
fn believed(selection: &Selection) -> Answer {
    let within = |p: f64, draws: usize| p <= BOOTSTRAP_CHANCE.max(1.0 / (draws + 1) as f64);
    let by = |p: f64, draws: usize| asked!(p, BOOTSTRAP_CHANCE: within(p, draws));
    selection.bootstrap.as_ref().map_or(true.into(), |b| by(b.p_value, b.draws))
}

fn said_bootstrap(selection: &Selection) -> Option<String> {
    selection.bootstrap.as_ref().map(|b| format!(
        "bootstrap of {} draws without physics: chance of a candidate as strong as on these records {:.3}; draws that would have been alarms {}",
        b.draws, b.p_value, b.alarms
    ))
}

/// Whether much is left where no law was found: noise may differ a little from what its repeats say.
fn restless(selection: &Selection) -> Answer {
    let model = selection.best();
    asked!(model.excess_sigma(), > RESTLESS_SIGMA) & asked!(model.cost / model.freedom, > RESTLESS_RATIO)
}

/// Whether a scan saw far more than noise shows, though no law explains enough of it.
fn unaccounted(selection: &Selection) -> Answer {
    let best = selection.steps.first().and_then(|s| s.candidates.first());
    best.map_or(false.into(), |c| {
        let log_p = c.log_p_value(library().len());
        asked!(log_p.exp(), SEEN_CHANCE: log_p < SEEN_CHANCE.ln())
    })
}
