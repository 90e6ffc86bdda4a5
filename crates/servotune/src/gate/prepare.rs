//! From a table to what the network takes: cleaning, ranking, choosing, normalising.
//!
//! In: a table and the rows to learn from. Out: the chosen columns and their statistics; nothing of any other row is used.
//! Section 2.9. Spec: `specs/gate.md`.

use super::GateError;
use super::adam::{Fitted, Rows, fit};
use super::boost::importance;
use super::clean::{Removed, clean};
use super::conformal::top;
use super::evidence::EVIDENCE;
use super::network::NetworkWorkspace;
use super::scale::{Scale, median};
use super::settings::{FitSettings, TrainSettings};
use super::table::{Column, Table};
use crate::numeric::random::Random;
use serde::Serialize;

/// A feature and what it was worth to the trees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Its name.
    pub feature: String,
    /// Its share of the total gain.
    pub importance: f64,
}

/// What the network is given.
pub(super) struct Prepared<'a> {
    /// Columns of the identified plant, kept for their own vote.
    pub evidence: Vec<&'a Column>,
    /// Columns that cleaning left, the most important first.
    pub kept: Vec<&'a Column>,
    pub ranking: Vec<Ranked>,
    pub removed: Vec<Removed>,
    /// The first of `kept`.
    pub chosen: Vec<&'a Column>,
    pub scale: Scale,
}

/// The seed of one unit of work.
pub(super) fn seed_of(seed: u64, unit: u64) -> u64 {
    Random::stream(seed, unit).bits()
}

/// Prepares from `rows`; `features` is the number to choose.
pub(super) fn prepare<'a>(
    table: &'a Table,
    rows: &[usize],
    class: &[usize],
    classes: usize,
    features: usize,
    settings: &TrainSettings,
) -> Result<Prepared<'a>, GateError> {
    let is_evidence = |c: &&Column| EVIDENCE.iter().any(|(n, _)| *n == c.name);
    let (evidence, others): (Vec<&Column>, Vec<&Column>) = table.columns().iter().partition(is_evidence);
    let judge = |columns: &[&'a Column]| clean(columns, rows, settings.missing_limit, settings.correlation_limit);
    // The plant's columns vote on their own; they are the network's only where there is nothing else.
    let (mut kept, mut removed) = judge(&others);
    let mut evidence = evidence;
    if kept.is_empty() {
        (kept, removed) = judge(&table.columns().iter().collect::<Vec<_>>());
        evidence.clear();
    }
    if kept.is_empty() {
        let reasons = removed.iter().take(5).map(|r| format!("{}: {}", r.feature, r.reason)).collect::<Vec<_>>();
        return Err(GateError::NoFeatures {
            file: table.file.clone(),
            tried: removed.len(),
            reasons: reasons.join("; "),
        });
    }
    evidence.retain(|c| rows.iter().filter(|&&r| !c.values[r].is_nan()).count() * 2 > rows.len());
    let views: Vec<&[f64]> = kept.iter().map(|c| c.values.as_slice()).collect();
    let share = importance(&views, rows, class, classes, &settings.boost, settings.seed);
    let mut order: Vec<usize> = (0..kept.len()).collect();
    order.sort_by(|&a, &b| share[b].total_cmp(&share[a]).then(a.cmp(&b)));
    let ranking = order.iter().map(|&i| Ranked { feature: kept[i].name.clone(), importance: share[i] }).collect();
    let kept: Vec<&Column> = order.iter().map(|&i| kept[i]).collect();
    let chosen: Vec<&Column> = kept.iter().copied().take(features).collect();
    let scale = Scale::of(&chosen, rows);
    Ok(Prepared { evidence, kept, ranking, removed, chosen, scale })
}

/// Epochs without a better validation loss that a network of a fold or a search waits; the weights kept are those of the best epoch
/// anyway. The network of the gate goes on to the end, as published.
pub(super) const PATIENCE: usize = 40;

/// Times a network is started anew where it died.
const STARTS: u64 = 3;

/// Trains on the prepared columns. A network whose best epoch is no better than always saying the classes' shares has died (ReLU
/// nodes that are zero for every row learn no more); it is started again from other weights.
#[allow(clippy::too_many_arguments, reason = "rows, classes and choices come from three places")]
pub(super) fn learn(
    p: &Prepared<'_>,
    train: &[usize],
    validate: &[usize],
    class: &[usize],
    classes: usize,
    hidden: &[usize],
    settings: &TrainSettings,
    patience: Option<usize>,
    seed: u64,
) -> Result<Fitted, GateError> {
    let sizes: Vec<usize> = [&[p.chosen.len()], hidden, &[classes]].concat();
    let pick =
        |rows: &[usize]| (p.scale.inputs(&p.chosen, rows), rows.iter().map(|&r| class[r]).collect::<Vec<usize>>());
    let ((x, y), (xv, yv)) = (pick(train), pick(validate));
    let judged = if yv.is_empty() { &y } else { &yv };
    let mut blind = 0.0;
    for k in 0..classes {
        let share = judged.iter().filter(|&&c| c == k).count() as f64 / judged.len().max(1) as f64;
        if share > 0.0 {
            blind -= share * share.ln();
        }
    }
    let mut best: Option<Fitted> = None;
    for start in 0..STARTS {
        let of = |inputs, class| Rows { inputs, class };
        let f =
            fit(&sizes, of(&x, &y), of(&xv, &yv), &FitSettings { patience, ..settings.fit() }, seed_of(seed, start));
        let loss = |f: &Fitted| f.history[f.best].validation_loss;
        if best.as_ref().is_none_or(|b| loss(&f) < loss(b) || loss(b).is_nan()) {
            best = Some(f);
        }
        if best.as_ref().is_some_and(|b| loss(b) < 0.95 * blind) {
            break;
        }
    }
    best.filter(|b| b.history[b.best].validation_loss.is_finite())
        .ok_or(GateError::NotLearned { learning_rate: settings.learning_rate })
}

/// How far a network's logits typically reach: the median lead of the first class over the second, on rows that chose its epoch. Networks
/// of different folds differ in it by orders of magnitude; one temperature fits them all only in units of it.
pub(super) fn reach(p: &Prepared<'_>, f: &Fitted, rows: &[usize], classes: usize) -> f64 {
    let mut workspace = NetworkWorkspace::new(&f.network.sizes, 16);
    let z = f.network.logits(&p.scale.inputs(&p.chosen, rows), &mut workspace);
    let lead = |z: &[f64]| {
        let best = top(z);
        z[best] - z.iter().enumerate().filter(|(k, _)| *k != best).fold(f64::NEG_INFINITY, |m, (_, v)| m.max(*v))
    };
    median(z.chunks(classes).map(lead)).max(1e-3)
}
