//! How a gate was made and how good it is: what `train --json` prints.
//!
//! In: the steps of the training. Out: confusion matrices, curves, folds, calibration, decisions, each on rows of a stated part.
//! Spec: `specs/gate.md`.

use super::GateError;
use super::adam::{Epoch, Fitted};
use super::calibrate::{Calibration, calibration_error};
use super::classes::{Action, Classes, Label};
use super::clean::Removed;
use super::confusion::{Confusion, Confusions, accuracy};
use super::costs::Costs;
use super::crossfit::Fold;
use super::discriminant::discriminant;
use super::evidence::Evidence;
use super::job::Job;
use super::judge::Gate;
use super::member::Ensemble;
use super::network::NetworkWorkspace;
use super::prepare::{Prepared, Ranked};
use super::split::Split;
use serde::Serialize;
use std::collections::BTreeMap;

/// The discriminant on the network's own features (figure 39).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// Share of the test rows that it has right.
    pub accuracy: f64,
    /// Test rows.
    pub confusion: Confusion,
    /// Every part.
    pub parts: Confusions,
}

impl Baseline {
    pub(super) fn of(job: &Job<'_>, p: &Prepared<'_>) -> Result<Baseline, GateError> {
        let rows = |rows: &[usize]| -> Vec<f64> {
            let row = |&r: &usize| p.chosen.iter().enumerate().map(move |(j, c)| p.scale.imputed(j, c.values[r]));
            rows.iter().flat_map(row).collect()
        };
        let class: Vec<usize> = job.split.train.iter().map(|&r| job.class[r]).collect();
        let d = discriminant(&rows(&job.split.train), p.chosen.len(), &class, job.classes)?;
        let parts = Confusions::of(job.class, job.classes, job.split, |r| d.predict(&rows(r)));
        Ok(Baseline { accuracy: accuracy(&parts.test), confusion: parts.test.clone(), parts })
    }
}

/// The published network, beside the searched one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Published {
    /// Its features.
    pub features: Vec<String>,
    /// Its weights and biases.
    pub parameters: usize,
    /// Its confusion.
    pub confusion: Confusions,
    /// Its curve.
    pub history: Vec<Epoch>,
}

/// One size that the search tried (figure 37).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TriedSize {
    /// Hidden layers.
    pub hidden: Vec<usize>,
    /// Weights and biases.
    pub parameters: usize,
    /// At the best epoch.
    pub validation_loss: f64,
    /// At the best epoch.
    pub validation_accuracy: f64,
    /// The best epoch, counted from 1.
    pub epoch: usize,
}

/// Rows of each part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Training rows.
    pub train: usize,
    /// Validation rows.
    pub validate: usize,
    /// Test rows.
    pub test: usize,
    /// Rows without a label, which take no part.
    pub unlabelled: usize,
}

/// What the decisions on some rows came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decisions {
    /// Rows by truth (name) and action.
    pub actions: BTreeMap<String, BTreeMap<Action, usize>>,
    /// Rows left to a person.
    pub abstained: usize,
    /// Rows decided whose class is not the true one.
    pub wrong: usize,
    /// Broken machines among the rows.
    pub broken: usize,
    /// Broken machines sent to be tuned: the dear error.
    pub tuned_broken: usize,
    /// Broken machines left alone.
    pub passed_broken: usize,
    /// Mean cost a row.
    pub cost: f64,
}

/// Broken machines that the gate would not have stopped.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MissedBroken {
    /// Broken machines in the test part.
    pub broken: usize,
    /// Those sent to be tuned.
    pub tuned: usize,
    /// Those left alone.
    pub passed: usize,
}

/// Conformal sets in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConformalReport {
    /// Asked for.
    pub coverage: f64,
    /// Share of test rows whose set has the true class; the most probable class is always put in.
    pub test_coverage: f64,
    /// The same for the sets as the p-values have them, without that.
    pub test_coverage_bare: f64,
    /// Mean size of a test row's set.
    pub test_set_size: f64,
    /// Classes with a reference of their own.
    pub own_reference: Vec<bool>,
    /// Whether the rows are enough for the coverage.
    pub enough: bool,
}

/// Calibration in numbers: on the rows it was learned from, which no network had seen, and on the test part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationReport {
    /// On held-out rows.
    #[serde(flatten)]
    pub held: Calibration,
    /// How networks and discriminants are mixed.
    pub mix: Ensemble,
    /// Test part: the network by itself, with temperature 1.
    pub test_error_before: f64,
    /// Test part: the gate.
    pub test_error_after: f64,
    /// Share of test rows that the gate, judges together, has right.
    pub test_accuracy: f64,
}

/// How a gate was made.
#[derive(Clone, Debug, Serialize)]
pub struct TrainReport {
    /// Chosen features, the most important first.
    pub features: Vec<Ranked>,
    /// Columns removed, each with its reason.
    pub removed: Vec<Removed>,
    /// Every column that cleaning left, ranked (figure 24).
    pub ranking: Vec<Ranked>,
    /// The classes.
    pub classes: Vec<Label>,
    /// A word for each.
    pub class_names: Vec<String>,
    /// Nodes of each layer.
    pub layers: Vec<usize>,
    /// Weights and biases.
    pub parameters: usize,
    /// Rows of each part.
    pub split: Counts,
    /// The rows themselves, counted from 0.
    pub rows: Split,
    /// The network's confusion.
    pub confusion: Confusions,
    /// Share of test rows it has right.
    pub accuracy: f64,
    /// Loss of each epoch (figure 36).
    pub history: Vec<Epoch>,
    /// The epoch whose weights were kept, counted from 1.
    pub best_epoch: usize,
    /// Cross-validation over training and validation rows (Table 3).
    pub folds: Vec<Fold>,
    /// The baseline.
    pub lda: Baseline,
    /// The published network, where the search replaced it.
    pub published: Option<Published>,
    /// What the search tried.
    pub search: Vec<TriedSize>,
    /// Temperature and calibration error.
    pub calibration: CalibrationReport,
    /// Coverage.
    pub conformal: ConformalReport,
    /// Share of test rows taken for machines of no known class.
    pub novelty: NoveltyReport,
    /// Ranges of the identified plant, one a class.
    pub evidence: Option<Evidence>,
    /// The table of costs.
    pub costs: Costs,
    /// Decisions on the test part, by the whole gate.
    pub decisions: Decisions,
    /// The dear error, on the test part.
    pub missed_broken: MissedBroken,
    /// Seed of every draw.
    pub seed: u64,
    /// Digest of the training table.
    pub table_sha256: String,
}

/// Novelty in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoveltyReport {
    /// Share of known machines that may be taken for unknown ones.
    pub level: f64,
    /// Features looked at.
    pub features: usize,
    /// Share of the test part taken for unknown.
    pub test_alarms: f64,
}

/// What the steps of the training hand over.
pub(super) struct Parts<'a> {
    pub published: Option<Published>,
    pub candidates: Vec<TriedSize>,
    pub folds: Vec<Fold>,
    pub lda: Baseline,
    pub held: &'a [usize],
    pub held_p: &'a [Vec<f64>],
}

/// What decisions came to; `said` gives class, action and whether it abstained.
pub fn decisions(truth: &[usize], said: &[(usize, Action)], classes: &Classes, costs: &Costs) -> Decisions {
    let mut d = Decisions {
        actions: BTreeMap::new(),
        abstained: 0,
        wrong: 0,
        broken: 0,
        tuned_broken: 0,
        passed_broken: 0,
        cost: 0.0,
    };
    for (&t, &(class, action)) in truth.iter().zip(said) {
        *d.actions.entry(classes.names[t].clone()).or_default().entry(action).or_default() += 1;
        let broken = usize::from(classes.actions[t].repairs());
        d.broken += broken;
        match action {
            Action::Inspect => d.abstained += 1,
            _ => d.wrong += usize::from(class != t),
        }
        d.tuned_broken += if action == Action::Tune { broken } else { 0 };
        d.passed_broken += if action == Action::None { broken } else { 0 };
        d.cost += if action == Action::Inspect { costs.inspect[t] } else { costs.decide[t][class] };
    }
    d.cost /= truth.len().max(1) as f64;
    d
}

impl ConformalReport {
    fn of(gate: &Gate, judged: &[super::judge::Judged], truth: &[usize]) -> ConformalReport {
        let n = truth.len().max(1) as f64;
        let share = |count: usize| count as f64 / n;
        ConformalReport {
            coverage: gate.conformal.coverage,
            test_coverage: share(judged.iter().zip(truth).filter(|(j, t)| j.set.contains(t)).count()),
            test_coverage_bare: share(
                judged.iter().zip(truth).filter(|(j, t)| j.set.contains(t) && (j.class != **t || j.conforms)).count(),
            ),
            test_set_size: judged.iter().map(|j| j.set.len()).sum::<usize>() as f64 / n,
            own_reference: gate.conformal.own_reference.clone(),
            enough: gate.conformal.enough,
        }
    }
}

impl TrainReport {
    pub(super) fn of(
        job: &Job<'_>,
        p: &Prepared<'_>,
        f: &Fitted,
        confusion: Confusions,
        gate: &Gate,
        parts: Parts<'_>,
    ) -> Result<TrainReport, GateError> {
        let split = job.split;
        let judged = gate.judge_rows(job.table, &split.test)?;
        let truth: Vec<usize> = split.test.iter().map(|&r| job.class[r]).collect();
        let n = truth.len().max(1) as f64;
        let share = |count: usize| count as f64 / n;
        let after: Vec<Vec<f64>> = judged.iter().map(|j| j.probabilities.clone()).collect();
        let mut workspace = NetworkWorkspace::new(&f.network.sizes, 16);
        let raw = f.network.logits(&p.scale.inputs(&p.chosen, &split.test), &mut workspace);
        let before: Vec<Vec<f64>> = raw.chunks(job.classes).map(|z| super::calibrate::probabilities(z, 1.0)).collect();
        let said: Vec<(usize, Action)> = judged.iter().map(|j| (j.class, j.action)).collect();
        let decisions = decisions(&truth, &said, &gate.classes, &gate.costs);
        let unknown =
            |j: &&super::judge::Judged| j.doubts.iter().any(|d| matches!(d, super::verdict::Doubt::Unknown { .. }));
        let labelled = split.train.len() + split.validate.len() + split.test.len();
        debug_assert_eq!(parts.held.len(), parts.held_p.len());
        Ok(TrainReport {
            features: p.ranking.iter().take(p.chosen.len()).cloned().collect(),
            removed: p.removed.clone(),
            ranking: p.ranking.clone(),
            classes: gate.classes.labels.clone(),
            class_names: gate.classes.names.clone(),
            layers: f.network.sizes.clone(),
            parameters: f.network.parameters(),
            split: Counts {
                train: split.train.len(),
                validate: split.validate.len(),
                test: split.test.len(),
                unlabelled: job.table.rows() - labelled,
            },
            rows: split.clone(),
            accuracy: accuracy(&confusion.test),
            confusion,
            history: f.history.clone(),
            best_epoch: f.best + 1,
            folds: parts.folds,
            lda: parts.lda,
            published: parts.published,
            search: parts.candidates,
            calibration: CalibrationReport {
                held: gate.calibration.clone(),
                mix: gate.mix.clone(),
                test_accuracy: share(judged.iter().zip(&truth).filter(|(j, t)| j.class == **t).count()),
                test_error_before: calibration_error(&before, &truth),
                test_error_after: calibration_error(&after, &truth),
            },
            conformal: ConformalReport::of(gate, &judged, &truth),
            novelty: NoveltyReport {
                level: gate.novelty.level,
                features: gate.novelty.features.len(),
                test_alarms: share(judged.iter().filter(unknown).count()),
            },
            evidence: gate.evidence.clone(),
            costs: gate.costs.clone(),
            missed_broken: MissedBroken {
                broken: decisions.broken,
                tuned: decisions.tuned_broken,
                passed: decisions.passed_broken,
            },
            decisions,
            seed: gate.seed,
            table_sha256: gate.table_sha256.clone(),
        })
    }
}
