//! The whole training of a gate (sections 2.7 to 2.9 and 3.2).
//!
//! In: a table with a label column. Out: a gate and the report of its making. Order: split, cleaning, ranking, normalising, network (its
//! middle layer searched where asked), cross-validation, calibration, sets, novelty, evidence, costs, baseline. The test part is used
//! by nobody before the end. Spec: `specs/gate.md`.

use super::GateError;
use super::adam::Epoch;
use super::classes::labelled;
use super::clean::Cause;
use super::conformal::Conformal;
use super::costs::Costs;
use super::crossfit::crossfit;
use super::drift::DriftReference;
use super::evidence::Evidence;
use super::job::Job;
use super::judge::Gate;
use super::member::{Ensemble, Member};
use super::network::NetworkWorkspace;
use super::novelty::{MOST_FEATURES, MOST_LOOKED_AT, Novelty};
use super::parallel::each;
use super::prepare::{PATIENCE, Prepared, prepare, reach};
use super::report::{Baseline, Parts, Published, TrainReport, TriedSize};
use super::settings::TrainSettings;
use super::split::{folds, split};
use super::table::{Column, Table};

/// A gate and how it was made.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The gate.
    pub gate: Gate,
    /// How it was made, and how good it is.
    pub report: TrainReport,
}

/// Rows that a class needs: one in each part of the split.
const LEAST: usize = 3;

/// Trains a gate.
pub fn train(table: &Table, settings: &TrainSettings) -> Result<Trained, GateError> {
    settings.check()?;
    if settings.label == super::table::ID {
        return Err(GateError::LabelIsId { file: table.file.clone(), label: settings.label.clone() });
    }
    let known = labelled(table, &settings.label)?;
    table.all_numbers()?;
    let mut classes = known.classes;
    if let Some(file) = &settings.actions {
        classes.map(file)?;
    }
    let k = classes.len();
    for (c, label) in classes.labels.iter().enumerate() {
        let rows = known.rows.iter().filter(|&&r| known.class[r] == c).count();
        if rows < LEAST {
            let (file, label, class) = (table.file.clone(), settings.label.clone(), label.to_string());
            return Err(GateError::SmallClass { file, label, class, rows, needed: LEAST });
        }
    }
    let costs = match &settings.costs {
        Some(file) => Costs::read(file, &classes)?,
        None => Costs::default_of(&classes),
    };
    let split = split(&known.rows, &known.class, k, settings.seed);
    let mut taught = [split.train.as_slice(), &split.validate].concat();
    taught.sort_unstable();
    if taught.len() < settings.folds {
        return Err(GateError::Folds { file: table.file.clone(), rows: taught.len(), folds: settings.folds });
    }
    let job = Job { table, class: &known.class, classes: k, split: &split, settings };
    let p = prepare(table, &split.train, &known.class, k, settings.feature_count(), settings)?;
    let (published, candidates, hidden) =
        if settings.search { search(&job)? } else { (None, Vec::new(), settings.hidden.clone()) };
    // The winner's seed: the same network, trained to the end.
    let unit = candidates.iter().position(|c| c.hidden == hidden).map_or(100, |i| 400 + i as u64);
    let fitted = job.learn(&p, &hidden, settings, None, unit)?;
    let unit = reach(&p, &fitted, &split.validate, k);
    // Deals for the sets, the novelty and the vote, even where no network is cross-validated.
    let deal = folds(&taught, &known.class, k, if settings.folds == 0 { 5 } else { settings.folds }, settings.seed);
    let main = Member::of(p.scale.clone(), fitted.network.clone(), unit, &p.chosen, &taught, &known.class, k)?;
    let (fold_list, members, held, said) = if settings.folds > 0 {
        let (list, members, said) = crossfit(table, &taught, &known.class, k, &deal, &hidden, settings)?;
        (list, members, taught.clone(), said)
    } else {
        // The discriminant may have learned from the training part only: the validation part is to judge it.
        let blind =
            Member::of(p.scale.clone(), fitted.network.clone(), unit, &p.chosen, &split.train, &known.class, k)?;
        let mut workspace = NetworkWorkspace::new(&fitted.network.sizes, settings.batch);
        let said = blind.say(&p.scale.inputs(&p.chosen, &split.validate), &mut workspace);
        (Vec::new(), Vec::new(), split.validate.clone(), said)
    };
    let of_held: Vec<usize> = held.iter().map(|&r| known.class[r]).collect();
    let fold_of_held = if settings.folds > 0 { deal.clone() } else { vec![0; held.len()] };
    let (mix, calibration) = Ensemble::of(&said, &of_held);
    let held_p: Vec<Vec<f64>> = said.iter().map(|s| mix.probabilities(s)).collect();

    let (watched, roots) = watched(table, &p);
    let gate = Gate {
        program: env!("CARGO_PKG_VERSION").to_owned(),
        seed: settings.seed,
        table_sha256: table.sha256().to_owned(),
        label: settings.label.clone(),
        conformal: Conformal::of(&held_p, &of_held, &fold_of_held, k, settings.coverage),
        novelty: Novelty::of(&watched, roots, &taught, &known.class, k, &deal, settings.novelty_level),
        evidence: Evidence::of(&p.evidence, &taught, &known.class, k, &deal),
        drift: drift(&watched[..roots], &p, &taught),
        main,
        members,
        mix,
        classes,
        calibration,
        costs,
    };
    let lda = Baseline::of(&job, &p)?;
    let parts = Parts { published, candidates, folds: fold_list, lda, held: &held, held_p: &held_p };
    let report = TrainReport::of(&job, &p, &fitted, job.confusions(&p, &fitted), &gate, parts)?;
    Ok(Trained { gate, report })
}

/// The columns whose distribution the gate watches, and how many of them it watches in combination.
fn watched<'a>(table: &'a Table, p: &Prepared<'a>) -> (Vec<&'a Column>, usize) {
    // Chosen features are always looked at, then the plant's, then the rest by importance: the most in combination, others one by one.
    let rest = p.kept.iter().skip(p.chosen.len());
    let mut watched: Vec<&Column> = p.chosen.iter().chain(&p.evidence).chain(rest).copied().collect();
    let roots = watched.len().min(MOST_FEATURES.max(p.chosen.len()));
    let looked_at = |cause: &Cause| match cause {
        Cause::Missing { .. } => false,
        Cause::SingleValue { value } => value.is_some(),
        Cause::Correlated { .. } => true,
    };
    for r in p.removed.iter().filter(|r| looked_at(&r.cause)) {
        watched.extend(table.columns().iter().find(|c| c.name == r.feature));
    }
    watched.truncate(MOST_LOOKED_AT.max(p.chosen.len()));
    (watched, roots)
}

/// What drift is measured against. The plant's columns may be absent in another table, and a single value has no distribution.
fn drift(watched: &[&Column], p: &Prepared<'_>, taught: &[usize]) -> Vec<DriftReference> {
    let moved = watched.iter().filter(|c| !p.evidence.iter().any(|e| e.name == c.name));
    moved.map(|c| DriftReference::of(c, taught)).collect()
}

/// The published network, what was tried, and the hidden layers that won.
type Searched = (Option<Published>, Vec<TriedSize>, Vec<usize>);

/// The published network first, then its middle layer over the candidates; the one with the least validation loss wins.
fn search(job: &Job<'_>) -> Result<Searched, GateError> {
    let settings = job.settings;
    let ten = TrainSettings { search: false, ..settings.clone() };
    let wide = prepare(job.table, &job.split.train, job.class, job.classes, ten.feature_count(), &ten)?;
    let f = job.learn(&wide, &settings.hidden, &ten, None, 100)?;
    let published = Published {
        features: wide.scale.features.clone(),
        parameters: f.network.parameters(),
        confusion: job.confusions(&wide, &f),
        history: f.history,
    };
    let p = prepare(job.table, &job.split.train, job.class, job.classes, settings.feature_count(), settings)?;
    let tried = each(settings.candidates.len(), |i| {
        let mut hidden = settings.hidden.clone();
        let middle = hidden.len() / 2;
        hidden[middle] = settings.candidates[i];
        let f = job.learn(&p, &hidden, settings, Some(PATIENCE), 400 + i as u64)?;
        let e: Epoch = f.history[f.best];
        Ok(TriedSize {
            hidden,
            parameters: f.network.parameters(),
            validation_loss: e.validation_loss,
            validation_accuracy: e.validation_accuracy,
            epoch: f.best + 1,
        })
    });
    let tried = tried.into_iter().collect::<Result<Vec<TriedSize>, GateError>>()?;
    let better = |a: &TriedSize, b: &TriedSize| {
        a.validation_loss.total_cmp(&b.validation_loss).then(a.parameters.cmp(&b.parameters))
    };
    let hidden = tried.iter().min_by(|a, b| better(a, b)).map_or(settings.hidden.clone(), |c| c.hidden.clone());
    Ok((Some(published), tried, hidden))
}
