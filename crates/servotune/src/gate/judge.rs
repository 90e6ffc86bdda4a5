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
use super::member::{Ensemble, Member, mean};
use super::network::NetworkWorkspace;
use super::novelty::Novelty;
use super::parallel::each;
use super::table::{Column, Table};
use super::verdict::{Doubt, GateVerdict, PlantEvidence};
use crate::numeric::digits::said;

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
    /// The published training's network, with its features and a discriminant on them.
    pub main: Member,
    /// The judge of each fold; none where there was no cross-validation.
    pub members: Vec<Member>,
    /// How networks and discriminants are mixed.
    pub mix: Ensemble,
    /// What calibration did.
    pub calibration: Calibration,
    /// The sets.
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
    /// Whether the most probable class would be in the set by itself.
    pub conforms: bool,
    pub doubts: Vec<Doubt>,
    runner_up: usize,
    expected: Vec<f64>,
    plant: PlantEvidence,
    novelty: super::novelty::NoveltyScore,
}

/// The columns that a gate needs, found in a table.
struct Found<'a> {
    chosen: Vec<&'a Column>,
    /// The features of each fold's judge.
    members: Vec<Vec<&'a Column>>,
    novelty: Vec<Option<&'a Column>>,
    /// The plant's columns that the table has, and where they stand among the gate's.
    evidence: Vec<Option<&'a Column>>,
}

/// Features shown with a verdict.
const SHOWN: usize = 3;
const DESK_ROWS: usize = 16;
/// How many times likelier than said a possible class is thought to be where the set is disputed.
const CAUTION: f64 = 5.0;
/// Share of the columns that strangers are known by which a table may lack.
const ABSENT: f64 = 0.1;

impl Gate {
    /// A verdict for each row of a table.
    pub fn classify(&self, table: &Table) -> Result<Vec<GateVerdict>, GateError> {
        let found = self.find(table)?;
        let verdict = |row: usize| {
            let judged = self.judge(&found, row);
            let decided = self.decided(&found, row, &judged);
            self.tell(table, &found, row, judged, decided)
        };
        Ok(each(table.rows(), verdict))
    }

    /// Rows judged without the features that decided.
    pub(super) fn judge_rows(&self, table: &Table, rows: &[usize]) -> Result<Vec<Judged>, GateError> {
        let found = self.find(table)?;
        Ok(each(rows.len(), |i| self.judge(&found, rows[i])))
    }

    /// Compares a table with the rows that the gate learned from.
    pub fn drift(&self, table: &Table) -> Result<Drift, GateError> {
        drift(&self.drift, table)
    }

    fn find<'a>(&self, table: &'a Table) -> Result<Found<'a>, GateError> {
        let all = |names: &[String]| names.iter().map(|n| table.column(n)).collect::<Result<Vec<_>, _>>();
        let optional = |n: &String| if table.has(n) { table.column(n).map(Some) } else { Ok(None) };
        let columns = self.evidence.as_ref().map_or(&[][..], |e| &e.columns);
        let chosen = all(&self.main.scale.features)?;
        let members = self.members.iter().map(|m| all(&m.scale.features)).collect::<Result<_, _>>()?;
        let novelty = self.novelty.features.iter().map(optional).collect::<Result<Vec<_>, _>>()?;
        let missing = || self.novelty.features.iter().filter(|n| !table.has(n) && !columns.contains(n));
        let (count, of) = (missing().count(), self.novelty.features.len());
        if count as f64 > ABSENT * of as f64 {
            let missing = missing().take(10).cloned().collect();
            return Err(GateError::FewColumns { file: table.file.clone(), count, of, missing });
        }
        Ok(Found { chosen, members, novelty, evidence: columns.iter().map(optional).collect::<Result<_, _>>()? })
    }

    /// Logits by the published training's judge, and by that of each fold.
    fn ask(&self, found: &Found<'_>, row: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
        let one = |m: &Member, columns: &[&Column]| {
            let mut workspace = NetworkWorkspace::new(&m.network.sizes, 1);
            let said = m.say(&m.scale.inputs(columns, &[row]), &mut workspace);
            said.first().map_or_else(Vec::new, |s| self.mix.logits(s))
        };
        let folds = self.members.iter().zip(&found.members).map(|(m, c)| one(m, c)).collect();
        (one(&self.main, &found.chosen), folds)
    }

    fn judge(&self, found: &Found<'_>, row: usize) -> Judged {
        let (main, mut all) = self.ask(found, row);
        let judges = if all.is_empty() { std::slice::from_ref(&main) } else { &all };
        let each: Vec<Vec<f64>> = judges.iter().map(|z| probabilities(z, 1.0)).collect();
        let mut set = self.conformal.set(&each);
        all.push(main);
        let p = probabilities(&mean(&all), 1.0);
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
        let looked: Vec<f64> = found.novelty.iter().map(|c| c.map_or(f64::NAN, |c| c.values[row])).collect();
        let novelty = self.novelty.novelty_score(&looked, class);
        if novelty.p_value < self.novelty.level {
            let s = novelty.clone();
            doubts.push(Doubt::Unknown { p_value: s.p_value, feature: s.feature, deviations: s.deviations });
        }
        let conforms = set.contains(&class);
        if !conforms {
            set.push(class);
            set.sort_unstable();
        }
        // A dispute matters where the other class could make the action dear, were it likelier than said. Sets of too few rows keep
        // no promise; they are told and left to the costs.
        let dear = |&k: &usize| CAUTION * p[k] * self.costs.decide[k][class] > self.costs.inspect[k];
        if self.conformal.enough && set.iter().any(dear) {
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
        Judged { class, action, probabilities: p, set, conforms, doubts, runner_up, expected, plant, novelty }
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

    /// By the published training's judge: integrated gradients of its network and the terms of its discriminant, each in its share.
    fn decided(&self, found: &Found<'_>, row: usize, judged: &Judged) -> Vec<Decided> {
        let (m, scale) = (&self.main, &self.main.scale);
        let mut workspace = NetworkWorkspace::new(&m.network.sizes, DESK_ROWS);
        let x = scale.inputs(&found.chosen, &[row]);
        let from: Vec<f32> = scale.median.iter().enumerate().map(|(j, v)| scale.input(j, *v)).collect();
        let wide = |x: &[f32]| x.iter().copied().map(f64::from).collect::<Vec<f64>>();
        let network = shares(&m.network, &from, &x, judged.class, judged.runner_up, &mut workspace);
        let linear = m.linear.shares(&wide(&from), &wide(&x), judged.class, judged.runner_up);
        let w = self.mix.network_share;
        let t = self.mix.temperature;
        let (n, l) = (w / (t * m.unit), (1.0 - w) / (t * self.mix.linear_unit));
        let share: Vec<f64> = network.iter().zip(&linear).map(|(a, b)| n * a + l * b).collect();
        let mut order: Vec<usize> = (0..share.len()).collect();
        order.sort_by(|&a, &b| share[b].abs().total_cmp(&share[a].abs()).then(a.cmp(&b)));
        let tell = |&j: &usize| {
            let (value, median) = (found.chosen[j].values[row], scale.median[j]);
            let direction = match scale.imputed(j, value).total_cmp(&median) {
                std::cmp::Ordering::Greater => Direction::Above,
                std::cmp::Ordering::Less => Direction::Below,
                std::cmp::Ordering::Equal => Direction::Equal,
            };
            Decided {
                feature: scale.features[j].clone(),
                value: (!value.is_nan()).then_some(value),
                training_median: median,
                direction,
                share: share[j],
            }
        };
        order.iter().take(SHOWN).map(tell).collect()
    }

    fn tell(&self, table: &Table, found: &Found<'_>, row: usize, j: Judged, decided: Vec<Decided>) -> GateVerdict {
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
                let value = d.value.map_or("missing".to_owned(), |v| said(v, 4));
                format!("{} = {value} ({side} the median {})", d.feature, said(d.training_median, 4))
            })
            .collect();
        why += &format!("; decided by {}; plant evidence: {}", features.join(", "), j.plant.says);
        let imputed: Vec<String> =
            found.chosen.iter().filter(|c| c.values[row].is_nan()).map(|c| c.name.clone()).collect();
        if !imputed.is_empty() {
            why += &format!("; missing, taken as the training median: {}", imputed.join(", "));
        }
        GateVerdict {
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
