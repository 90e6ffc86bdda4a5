//! Costs: what each action costs on a machine of each class, and the decision that costs least.
//!
//! In: calibrated probabilities. Out: the cheapest of the classes' own actions and of `inspect`. The table is in units of one
//! inspection. The dear error is to tune a broken machine. Spec: `specs/gate.md`.

use super::GateError;
use super::classes::{Action, Classes};
use crate::document::read_toml;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Cost of every decision on a machine of every class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Costs {
    /// `decide[truth][class]`: cost of doing what `class` needs to a machine of class `truth`.
    pub decide: Vec<Vec<f64>>,
    /// `inspect[truth]`: cost of letting a person look.
    pub inspect: Vec<f64>,
}

/// Cost of an action on a machine that needs another one.
fn default_cost(needs: Action, does: Action) -> f64 {
    use Action::{Inspect, None, Tune};
    match (needs, does) {
        (_, Inspect) => 1.0,
        (a, b) if a == b => 0.0,
        // A broken machine that is tuned runs on, with gains that hide the fault.
        (n, Tune) if n.repairs() => 50.0,
        // A broken machine that is left alone writes bad disks until the next test.
        (n, None) if n.repairs() => 20.0,
        (_, d) if d.repairs() => 10.0,
        (None, Tune) => 2.0,
        (Tune, None) => 5.0,
        _ => 10.0,
    }
}

impl Costs {
    /// The default table.
    pub fn default_of(classes: &Classes) -> Costs {
        let action = |i: usize| classes.actions[i];
        let cost = |t: usize, k: usize| match (t == k, action(t) == action(k)) {
            (true, _) => 0.0,
            // Another class with the same action: the machine is treated rightly under a wrong name.
            (false, true) if classes.machine => 0.0,
            (false, true) => 10.0,
            _ => default_cost(action(t), action(k)),
        };
        let n = classes.len();
        Costs { decide: (0..n).map(|t| (0..n).map(|k| cost(t, k)).collect()).collect(), inspect: vec![1.0; n] }
    }

    /// Reads a table: one TOML table a class (its name or label), one key for each action, in any unit.
    ///
    /// Where classes share an action, keys are class names instead of actions.
    pub fn read(file: &Path, classes: &Classes) -> Result<Costs, GateError> {
        let read: BTreeMap<String, BTreeMap<String, f64>> = read_toml(file)?;
        let n = classes.len();
        let mut words: Vec<&str> = classes.actions.iter().map(|a| a.word()).collect();
        let shared = (0..n).any(|i| words[..i].contains(&words[i]));
        if shared {
            words = classes.names.iter().map(String::as_str).collect();
        }
        let names = || words.iter().map(|w| (*w).to_owned()).chain(["inspect".to_owned()]).collect::<Vec<_>>();
        let mut rows: Vec<Option<(Vec<f64>, f64)>> = vec![None; n];
        for (table, costs) in read {
            let truth = classes.find(&table).ok_or_else(|| GateError::UnknownClass {
                file: file.into(),
                table: table.clone(),
                expected: classes.names.clone(),
            })?;
            for (key, &found) in &costs {
                if key != "inspect" && !words.contains(&key.as_str()) {
                    let (table, key) = (table.clone(), key.clone());
                    return Err(GateError::UnknownAction { file: file.into(), table, key, expected: names() });
                }
                if !(found.is_finite() && found >= 0.0) {
                    return Err(GateError::Cost { file: file.into(), table, key: key.clone(), found });
                }
            }
            let get = |key: &str| {
                costs.get(key).copied().ok_or_else(|| GateError::MissingCost {
                    file: file.into(),
                    table: table.clone(),
                    key: key.to_owned(),
                })
            };
            rows[truth] = Some((words.iter().map(|w| get(w)).collect::<Result<_, _>>()?, get("inspect")?));
        }
        let mut costs = Costs { decide: Vec::new(), inspect: Vec::new() };
        for (row, name) in rows.into_iter().zip(&classes.names) {
            let (decide, inspect) = row.ok_or_else(|| GateError::MissingCost {
                file: file.into(),
                table: name.clone(),
                key: "inspect".to_owned(),
            })?;
            costs.decide.push(decide);
            costs.inspect.push(inspect);
        }
        Ok(costs)
    }

    /// Expected cost of doing what each class needs, and of an inspection.
    pub fn expected(&self, p: &[f64]) -> (Vec<f64>, f64) {
        let decide = (0..p.len()).map(|k| p.iter().zip(&self.decide).map(|(p, row)| p * row[k]).sum()).collect();
        (decide, p.iter().zip(&self.inspect).map(|(p, c)| p * c).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::super::classes::Label;
    use super::*;

    #[test]
    fn a_fiftieth_of_doubt_forbids_tuning() {
        let classes = Classes {
            labels: (0..4).map(Label::Number).collect(),
            names: ["healthy", "sensor_fault", "loose_pushpin", "tunable"].map(str::to_owned).to_vec(),
            actions: vec![Action::None, Action::RepairSensor, Action::RepairPushpin, Action::Tune],
            machine: true,
        };
        let costs = Costs::default_of(&classes);
        // 50 times the probability of a broken machine against one inspection: the border is 2 %.
        let (decide, inspect) = costs.expected(&[0.0, 0.019, 0.0, 0.981]);
        assert!(decide[3] < inspect);
        let (decide, inspect) = costs.expected(&[0.0, 0.0, 0.021, 0.979]);
        assert!(decide[3] > inspect);
    }
}
