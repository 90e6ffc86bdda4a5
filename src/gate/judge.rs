//! A trained gate, and its judgement of rows.
//!
//! In: a table with the gate's columns, in any order, among any others. Out: a verdict a row. The decision is the one of least expected
//! cost; four guards turn it into `inspect`: more than one class possible, a machine of no known class, a plant that disagrees, too
//! many features missing. Spec: `specs/gate.md`.

use super::GateError;
use super::attribution::{Decided, Direction, shares};
use super::calibrate::{Calibration, probabilities};
use super::classes::{Action, Classes};
use super::conformal::{Conformal, top};
use super::costs::Costs;
use super::drift::{Drift, DriftReference, drift};
use super::evidence::Evidence;
use super::network::{Desk, Network};
use super::novelty::{Novelty, row_of};
use super::parallel::each;
use super::scale::Scale;
use super::table::{Column, Table};
use super::verdict::{Doubt, PlantEvidence, Verdict};

/// A trained gate.
#[derive(Clone, Debug)]
pub struct Gate {
    /// Program version that trained it.
    pub program: String,
    /// Seed of the training.
    pub seed: u64,
    /// Digest of the training table.
    pub table_sha256: String,
    /// Column of the classes in the training table.
    pub label: String,
    /// The classes.
    pub classes: Classes,
    /// Statistics of the network's features.
    pub scale: Scale,
    /// The network.
    pub network: Network,
    /// Its temperature.
    pub calibration: Calibration,
    /// Its sets.
    pub conformal: Conformal,
    /// Cost of each decision.
    pub costs: Costs,
    /// What known machines look like.
    pub novelty: Novelty,
    /// What plants of each class look like; none where the training table had no such column.
    pub evidence: Option<Evidence>,
    /// What the training rows looked like.
    pub drift: Vec<DriftReference>,
}

/// A row judged, before anybody asks which features decided.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    pub class: usize,
    pub action: Action,
    pub probabilities: Vec<f64>,
    pub set: Vec<usize>,
    pub doubts: Vec<Doubt>,
    runner_up: usize,
    expected: Vec<f64>,
    plant: PlantEvidence,
    novelty: super::novelty::Strangeness,
}

/// The columns that a gate needs, found in a table.
struct Found<'a> {
    chosen: Vec<&'a Column>,
    novelty: Vec<&'a Column>,
    /// The plant's columns that the table has, and where they stand among the gate's.
    evidence: Vec<Option<&'a Column>>,
}

/// Features shown with a verdict.
const SHOWN: usize = 3;
const DESK_ROWS: usize = 16;

impl Gate {
    /// A verdict for each row of a table.
    pub fn classify(&self, table: &Table) -> Result<Vec<Verdict>, GateError> {
        let found = self.find(table)?;
        let verdict = |row: usize| {
            let mut desk = Desk::new(&self.network.sizes, DESK_ROWS);
            let x = self.scale.inputs(&found.chosen, &[row]);
            let judged = self.judge(&found, row, &x, &mut desk);
            let decided = self.decided(&found, row, &x, &judged, &mut desk);
            self.tell(table, &found, row, judged, decided)
        };
        Ok(each(table.rows(), verdict))
    }

    /// Rows judged without the features that decided.
    pub(super) fn judge_rows(&self, table: &Table, rows: &[usize]) -> Result<Vec<Judged>, GateError> {
        let found = self.find(table)?;
        let mut desk = Desk::new(&self.network.sizes, 1);
        Ok(rows.iter().map(|&r| self.judge(&found, r, &self.scale.inputs(&found.chosen, &[r]), &mut desk)).collect())
    }

    /// Compares a table with the rows that the gate learned from.
    pub fn drift(&self, table: &Table) -> Result<Drift, GateError> {
        drift(&self.drift, table)
    }

    fn find<'a>(&self, table: &'a Table) -> Result<Found<'a>, GateError> {
        let all = |names: &[String]| names.iter().map(|n| table.column(n)).collect::<Result<Vec<_>, _>>();
        let optional = |n: &String| if table.has(n) { table.column(n).map(Some) } else { Ok(None) };
        let columns = self.evidence.as_ref().map_or(&[][..], |e| &e.columns);
        Ok(Found {
            chosen: all(&self.scale.features)?,
            novelty: all(&self.novelty.features)?,
            evidence: columns.iter().map(optional).collect::<Result<_, _>>()?,
        })
    }

    fn judge(&self, found: &Found<'_>, row: usize, x: &[f32], desk: &mut Desk) -> Judged {
        let p = probabilities(&self.network.logits(x, desk), self.calibration.temperature);
        let class = top(&p);
        let runner_up =
            (0..p.len()).filter(|&k| k != class).fold(usize::from(class == 0), |b, k| if p[k] > p[b] { k } else { b });
        let name = |k: usize| self.classes.names[k].clone();
        let mut doubts = Vec::new();
        let missing: Vec<String> =
            found.chosen.iter().filter(|c| c.values[row].is_nan()).map(|c| c.name.clone()).collect();
        if 2 * missing.len() > found.chosen.len() {
            doubts.push(Doubt::Missing { features: missing });
        }
        let novelty = self.novelty.strangeness(&row_of(&found.novelty, row), class);
        if novelty.p_value < self.novelty.level {
            let s = novelty.clone();
            doubts.push(Doubt::Unknown { p_value: s.p_value, feature: s.feature, deviations: s.deviations });
        }
        let set = self.conformal.set(&p);
        if set.len() > 1 {
            let possible = set.iter().map(|&k| name(k)).collect();
            doubts.push(Doubt::SeveralClasses { possible, coverage: self.conformal.coverage });
        }
        let (plant, doubt) = self.ask_plant(found, row, class);
        doubts.extend(doubt);
        let (expected, inspection) = self.costs.expected(&p);
        let cheapest = (0..p.len()).fold(class, |b, k| if expected[k] < expected[b] { k } else { b });
        if inspection < expected[class] {
            doubts.push(Doubt::Cost { expected: expected[class], inspection });
        } else if self.classes.actions[cheapest] != self.classes.actions[class] {
            doubts.push(Doubt::OtherAction { class: name(cheapest) });
        }
        let action = if doubts.is_empty() { self.classes.actions[class] } else { Action::Inspect };
        Judged { class, action, probabilities: p, set, doubts, runner_up, expected, plant, novelty }
    }

    fn ask_plant(&self, found: &Found<'_>, row: usize, class: usize) -> (PlantEvidence, Option<Doubt>) {
        let values: Vec<f64> = found.evidence.iter().map(|c| c.map_or(f64::NAN, |c| c.values[row])).collect();
        let Some((e, vote)) = self.evidence.as_ref().and_then(|e| e.vote(&values).map(|v| (e, v))) else {
            return (PlantEvidence { says: "absent", class: None, probabilities: Vec::new() }, None);
        };
        let doubt = e.contradicts(&vote, class).then(|| Doubt::PlantDisagrees {
            class: self.classes.names[vote.class].clone(),
            probability: vote.probabilities[class],
        });
        let says = match (&doubt, vote.class == class) {
            (Some(_), _) => "disagrees",
            (None, true) => "agrees",
            (None, false) => "undecided",
        };
        let class = Some(self.classes.labels[vote.class].clone());
        (PlantEvidence { says, class, probabilities: vote.probabilities }, doubt)
    }

    fn decided(&self, found: &Found<'_>, row: usize, x: &[f32], judged: &Judged, desk: &mut Desk) -> Vec<Decided> {
        let from: Vec<f32> = self.scale.median.iter().enumerate().map(|(j, m)| self.scale.input(j, *m)).collect();
        let share = shares(&self.network, &from, x, judged.class, judged.runner_up, desk);
        let mut order: Vec<usize> = (0..share.len()).collect();
        order.sort_by(|&a, &b| share[b].abs().total_cmp(&share[a].abs()).then(a.cmp(&b)));
        let tell = |&j: &usize| {
            let (value, median) = (found.chosen[j].values[row], self.scale.median[j]);
            let direction = match self.scale.imputed(j, value).total_cmp(&median) {
                std::cmp::Ordering::Greater => Direction::Above,
                std::cmp::Ordering::Less => Direction::Below,
                std::cmp::Ordering::Equal => Direction::Equal,
            };
            Decided {
                feature: self.scale.features[j].clone(),
                value: (!value.is_nan()).then_some(value),
                training_median: median,
                direction,
                share: share[j],
            }
        };
        order.iter().take(SHOWN).map(tell).collect()
    }

    fn tell(&self, table: &Table, found: &Found<'_>, row: usize, j: Judged, decided: Vec<Decided>) -> Verdict {
        let mut why = if j.doubts.is_empty() {
            format!("{} with probability {:.4}", self.classes.names[j.class], j.probabilities[j.class])
        } else {
            j.doubts.iter().map(Doubt::words).collect::<Vec<_>>().join("; ")
        };
        let features: Vec<String> = decided
            .iter()
            .map(|d| {
                let side = match d.direction {
                    Direction::Above => "above",
                    Direction::Below => "below",
                    Direction::Equal => "at",
                };
                let value = d.value.map_or("missing".to_owned(), |v| format!("{v:.4e}"));
                format!("{} = {value} ({side} the median {:.4e})", d.feature, d.training_median)
            })
            .collect();
        why += &format!("; decided by {}; plant evidence: {}", features.join(", "), j.plant.says);
        let imputed: Vec<String> =
            found.chosen.iter().filter(|c| c.values[row].is_nan()).map(|c| c.name.clone()).collect();
        if !imputed.is_empty() {
            why += &format!("; missing, taken as the training median: {}", imputed.join(", "));
        }
        Verdict {
            id: table.id(row).map(str::to_owned),
            line: table.line(row),
            class: self.classes.labels[j.class].clone(),
            class_name: self.classes.names[j.class].clone(),
            probability: j.probabilities[j.class],
            abstained: !j.doubts.is_empty(),
            action: j.action,
            why,
            set: j.set.iter().map(|&k| self.classes.labels[k].clone()).collect(),
            probabilities: j.probabilities,
            doubts: j.doubts,
            decided,
            plant: j.plant,
            novelty: Some(j.novelty),
            expected_cost: j.expected,
            imputed,
        }
    }
}
