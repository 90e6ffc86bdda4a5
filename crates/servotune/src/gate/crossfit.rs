//! Cross-validation: every row judged by a network that has not seen it (section 3.2, Table 3).
//!
//! In: a table and the rows to deal into folds. Out: loss and accuracy of each fold, its judge, and what that says of every row. Each fold is cleaned, ranked,
//! normalised and trained anew on the other folds; a fifth of those, not the fold itself, chooses the epoch. Spec: `specs/gate.md`.

use super::GateError;
use super::adam::{Rows, loss_and_accuracy};
use super::calibrate::Logits;
use super::member::{Member, Said};
use super::network::NetworkWorkspace;
use super::parallel::each;
use super::prepare::{PATIENCE, learn, prepare, reach, seed_of};
use super::settings::TrainSettings;
use super::split::hold_out;
use super::table::Table;
use crate::numeric::random::Random;
use serde::Serialize;

/// One fold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fold {
    /// Mean cross-entropy of its rows (nat).
    pub loss: f64,
    /// Share of its rows whose class was the most probable one.
    pub accuracy: f64,
    /// Its rows.
    pub rows: usize,
}

/// Share of the rows outside a fold that choose its epoch.
const CHOOSE: f64 = 0.2;

/// Folds, their judges, and the words on each row.
type Crossfitted = (Vec<Fold>, Vec<Member>, Vec<Said>);

/// Folds, their judges, and what the judge of a row's fold says of it, in the order of `rows`.
pub(super) fn crossfit(
    table: &Table,
    rows: &[usize],
    class: &[usize],
    classes: usize,
    fold: &[usize],
    hidden: &[usize],
    settings: &TrainSettings,
) -> Result<Crossfitted, GateError> {
    let one = |f: usize| -> Result<(Fold, Member, Vec<Said>), GateError> {
        let pick = |inside: bool| {
            rows.iter().zip(fold).filter(|(_, k)| (**k == f) == inside).map(|(r, _)| *r).collect::<Vec<usize>>()
        };
        let (held, others) = (pick(true), pick(false));
        let mut random = Random::stream(settings.seed, 300 + f as u64);
        let (train, choose) = hold_out(&others, class, classes, CHOOSE, &mut random);
        let p = prepare(table, &train, class, classes, settings.feature_count(), settings)?;
        let seed = seed_of(settings.seed, 200 + f as u64);
        let fitted = learn(&p, &train, &choose, class, classes, hidden, settings, Some(PATIENCE), seed)?;
        let unit = reach(&p, &fitted, if choose.is_empty() { &train } else { &choose }, classes);
        let mut workspace = NetworkWorkspace::new(&fitted.network.sizes, settings.batch);
        let inputs = p.scale.inputs(&p.chosen, &held);
        let of_held: Vec<usize> = held.iter().map(|&r| class[r]).collect();
        let (loss, accuracy) =
            loss_and_accuracy(&fitted.network, Rows { inputs: &inputs, class: &of_held }, &mut workspace);
        let member = Member::of(p.scale, fitted.network, unit, &p.chosen, &others, class, classes)?;
        let said = member.say(&inputs, &mut workspace);
        Ok((Fold { loss, accuracy, rows: held.len() }, member, said))
    };
    let (mut found, mut members) = (Vec::new(), Vec::new());
    let nothing = Said { network: Logits { raw: Vec::new(), unit: 1.0 }, linear: Vec::new() };
    let mut all = vec![nothing; rows.len()];
    for (f, result) in each(settings.folds, one).into_iter().enumerate() {
        let (judged, member, said) = result?;
        let places = fold.iter().enumerate().filter(|(_, k)| **k == f).map(|(i, _)| i);
        places.zip(said).for_each(|(i, s)| all[i] = s);
        found.push(judged);
        members.push(member);
    }
    Ok((found, members, all))
}
