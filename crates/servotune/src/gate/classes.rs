//! Classes of machines and what to do with each.
//!
//! In: the labels of a table. Out: classes in a fixed order, each with a name and an action. The paper's four classes are known by
//! number and by word; any other label is a class of its own whose action is `none` unless a mapping says more. Spec: `specs/gate.md`.

use super::{GateError, Table};
use crate::document::read_toml;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

/// What to do with a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Nothing: it works.
    None,
    /// Repair its encoder sensor.
    RepairSensor,
    /// Repair its pushpin.
    RepairPushpin,
    /// Tune its gains.
    Tune,
    /// Let a person look at it: the gate does not decide.
    Inspect,
}

impl Action {
    /// The action's word in files.
    pub fn word(self) -> &'static str {
        match self {
            Action::None => "none",
            Action::RepairSensor => "repair_sensor",
            Action::RepairPushpin => "repair_pushpin",
            Action::Tune => "tune",
            Action::Inspect => "inspect",
        }
    }

    /// Whether the action is a repair.
    pub fn repairs(self) -> bool {
        matches!(self, Action::RepairSensor | Action::RepairPushpin)
    }
}

/// A label as the table writes it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Label {
    /// A whole number.
    Number(i64),
    /// A word.
    Word(String),
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Label::Number(n) => write!(f, "{n}"),
            Label::Word(w) => f.write_str(w),
        }
    }
}

/// The paper's classes: number, word, action (section 2.7, Table 2).
const KNOWN: [(&str, Action); 4] = [
    ("healthy", Action::None),
    ("sensor_fault", Action::RepairSensor),
    ("loose_pushpin", Action::RepairPushpin),
    ("tunable", Action::Tune),
];

/// More classes than this is taken for a measurement.
const MOST: usize = 64;

/// The classes, in the order of every vector of probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Classes {
    /// As the table writes them.
    pub labels: Vec<Label>,
    /// A word for each.
    pub names: Vec<String>,
    /// What to do with each.
    pub actions: Vec<Action>,
    /// Whether these are the paper's classes.
    pub machine: bool,
}

/// Classes of a table, and the class of each row that has one.
#[derive(Clone, Debug)]
pub struct Labelled {
    /// The classes.
    pub classes: Classes,
    /// Rows with a label, ascending.
    pub rows: Vec<usize>,
    /// Class of every row of the table; of a row without a label 0, which `rows` leaves out.
    pub class: Vec<usize>,
}

impl Classes {
    /// Number of classes.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The class whose label or name is `word`.
    pub fn find(&self, word: &str) -> Option<usize> {
        let label = parse(word, true);
        self.labels
            .iter()
            .position(|l| *l == label || l.to_string() == word)
            .or_else(|| self.names.iter().position(|n| n == word))
    }

    /// Gives each class the action of a TOML mapping (`class = "action"`).
    pub fn map(&mut self, file: &Path) -> Result<(), GateError> {
        let map: BTreeMap<String, Action> = read_toml(file)?;
        let mut given = vec![None; self.len()];
        for (word, action) in map {
            match self.find(&word) {
                Some(i) => given[i] = Some(action),
                None => {
                    let expected = self.names.clone();
                    return Err(GateError::UnknownClass { file: file.into(), table: word, expected });
                }
            }
        }
        for (i, action) in given.into_iter().enumerate() {
            let class = || self.names[i].clone();
            self.actions[i] = action.ok_or_else(|| GateError::NoAction { file: file.into(), class: class() })?;
        }
        Ok(())
    }
}

fn parse(text: &str, numbers: bool) -> Label {
    match text.parse::<f64>() {
        Ok(x) if numbers && x.fract() == 0.0 && x.abs() < 1e15 => Label::Number(x as i64),
        _ => Label::Word(text.to_owned()),
    }
}

/// The classes of a table and the class of each labelled row; `label` names the column in a refusal.
pub fn labelled(table: &Table, label: &str) -> Result<Labelled, GateError> {
    let file = || table.file.clone();
    let texts = table.labels().ok_or_else(|| GateError::Column {
        file: file(),
        column: label.to_owned(),
        found: table.columns().iter().map(|c| c.name.clone()).collect(),
    })?;
    let rows: Vec<usize> = (0..texts.len()).filter(|&i| !texts[i].is_empty()).collect();
    if rows.is_empty() {
        return Err(GateError::NoLabels { file: file(), label: label.to_owned(), rows: texts.len() });
    }
    // Whole numbers are numbers only where all are: `1` beside `loose` is a word.
    let numbers = rows.iter().all(|&i| matches!(parse(&texts[i], true), Label::Number(_)));
    let set: BTreeSet<Label> = rows.iter().map(|&i| parse(&texts[i], numbers)).collect();
    if set.len() > MOST {
        return Err(GateError::ManyClasses { file: file(), label: label.to_owned(), found: set.len(), limit: MOST });
    }
    let code = |l: &Label| match l {
        Label::Number(n) => usize::try_from(*n).ok().filter(|&n| n < KNOWN.len()),
        Label::Word(w) => KNOWN.iter().position(|(name, _)| name == w),
    };
    let machine = set.iter().all(|l| code(l).is_some());
    let mut labels: Vec<Label> = set.into_iter().collect();
    if machine {
        labels.sort_by_key(code);
    }
    if let [class] = labels.as_slice() {
        return Err(GateError::OneClass { file: file(), label: label.to_owned(), class: class.to_string() });
    }
    let known = |l: &Label| code(l).filter(|_| machine).map(|i| KNOWN[i]);
    let classes = Classes {
        names: labels.iter().map(|l| known(l).map_or_else(|| l.to_string(), |k| k.0.to_owned())).collect(),
        actions: labels.iter().map(|l| known(l).map_or(Action::None, |k| k.1)).collect(),
        machine,
        labels,
    };
    let mut class = vec![0; texts.len()];
    for &i in &rows {
        let l = parse(&texts[i], numbers);
        class[i] = classes.labels.iter().position(|x| *x == l).unwrap_or(0);
    }
    Ok(Labelled { classes, rows, class })
}
