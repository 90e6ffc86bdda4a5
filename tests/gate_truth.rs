//! The gate against what is known beforehand: gradients, counts, coverage, alarms, threads.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::gate_common::{World, known};
use servotune::gate::{Action, Gate, Table, TrainSettings, parameter_count, train};
use std::path::Path;

fn table(text: &str) -> Table {
    Table::parse(Path::new("t.csv"), text, Some("label")).unwrap()
}

/// A small network, so that the tests are short; what is tested does not depend on its size.
fn quick() -> TrainSettings {
    TrainSettings { hidden: vec![24, 16], epochs: Some(40), learning_rate: 0.003, ..TrainSettings::default() }
}

const PAPER: [usize; 4] = [198, 106, 78, 104];

#[test]
fn the_published_counts() {
    assert_eq!(parameter_count(&[10, 200, 500, 200, 4]), 203_704);
    assert_eq!(parameter_count(&[5, 200, 384, 200, 4]), 156_188);
    let world = World::new(1, 40, 4, 2.0);
    let trained = train(&table(&world.csv(&known(&PAPER), |c| c.to_string(), true, 2)), &quick()).unwrap();
    let s = &trained.report.split;
    assert_eq!((s.train, s.validate, s.test), (291, 97, 98));
    assert_eq!(trained.report.folds.len(), 5);
    assert_eq!(trained.report.features.len(), 10);
    assert_eq!(trained.report.folds.iter().map(|f| f.rows).sum::<usize>(), 388);
    // The plant's columns vote on their own and are not the network's.
    assert!(trained.report.ranking.iter().all(|r| !r.feature.starts_with("plant_")));
    assert_eq!(trained.gate.evidence.as_ref().unwrap().columns.len(), 3);
}

#[test]
fn known_machines_pass_and_unknown_kinds_are_stopped() {
    let world = World::new(3, 80, 4, 2.5);
    let trained = train(&table(&world.csv(&known(&PAPER), |c| c.to_string(), true, 4)), &quick()).unwrap();
    let fresh = table(&world.csv(&known(&PAPER), |c| c.to_string(), true, 5));
    let verdicts = trained.gate.classify(&fresh).unwrap();
    let labels = fresh.labels().unwrap();
    let abstained = verdicts.iter().filter(|v| v.abstained).count();
    // Two in a hundred are allowed; three standard errors of a count of 486 more.
    assert!(abstained as f64 <= 0.02 * 486.0 + 3.0 * (0.02 * 486.0f64).sqrt(), "{abstained}");
    for (v, l) in verdicts.iter().zip(labels) {
        let broken = l == "1" || l == "2";
        assert!(!(broken && v.action == Action::Tune), "{v:?}");
    }
    for kind in 0..5 {
        let rows: Vec<_> = (0..60).map(|i| (i % 4, Some(kind))).collect();
        let v = trained.gate.classify(&table(&world.csv(&rows, |c| c.to_string(), true, 6 + kind as u64))).unwrap();
        let stopped = v.iter().filter(|v| v.action == Action::Inspect).count();
        assert!(stopped >= 57, "kind {kind}: {stopped} of 60");
    }
}

#[test]
fn same_bytes_for_any_number_of_threads_and_through_a_file() {
    let world = World::new(7, 20, 3, 2.0);
    let t = table(&world.csv(&known(&[20, 20, 20]), |c| ["a", "b", "c"][c].to_owned(), false, 1));
    let text = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(&t, &quick()).unwrap().gate.to_json().unwrap())
    };
    let one = text(1);
    assert_eq!(one, text(3));
    let back = Gate::parse(Path::new("gate.json"), &one).unwrap();
    assert_eq!(back.to_json().unwrap(), one);
    // Labels outside the paper's four: no action of their own.
    assert!(back.classify(&t).unwrap().iter().all(|v| matches!(v.action, Action::None | Action::Inspect)));
}

#[test]
fn two_dozen_rows_and_words() {
    let world = World::new(9, 12, 4, 4.0);
    let names = ["healthy", "sensor_fault", "loose_pushpin", "tunable"];
    let t = table(&world.csv(&known(&[6, 6, 6, 6]), |c| names[c].to_owned(), false, 1));
    let trained = train(&t, &quick()).unwrap();
    assert_eq!(trained.report.class_names, names);
    let s = &trained.report.split;
    assert_eq!(s.train + s.validate + s.test, 24);
    let verdicts = trained.gate.classify(&t).unwrap();
    assert_eq!(verdicts.len(), 24);
    assert!(
        verdicts.iter().all(|v| (v.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-12 && v.plant.says == "absent")
    );
}

#[test]
fn a_missing_value_and_a_disagreeing_plant_are_said() {
    let world = World::new(11, 20, 4, 3.0);
    let rows = known(&[40, 30, 30, 40]);
    let text = world.csv(&rows, |c| c.to_string(), true, 2);
    let trained = train(&table(&text), &quick()).unwrap();
    // The first machine is healthy; its resonance is put where a loose pushpin has it.
    let mut lines: Vec<Vec<String>> = text.lines().map(|l| l.split(',').map(str::to_owned).collect()).collect();
    let at = |name: &str| lines[0].iter().position(|h| h == name).unwrap();
    let (resonance, first) = (at("plant_first_resonance_hz"), at(&trained.gate.main.scale.features[0]));
    lines[1][resonance] = "665".to_owned();
    lines[2][first] = String::new();
    let changed: String = lines.iter().map(|l| l.join(",") + "\n").collect();
    let v = trained.gate.classify(&table(&changed)).unwrap();
    assert_eq!((v[0].plant.says, v[0].action), ("disagrees", Action::Inspect));
    assert_eq!(v[1].imputed, [trained.gate.main.scale.features[0].clone()]);
    assert!(v[1].why.contains("training median"));
}

#[test]
fn drift_is_found_and_not_invented() {
    let world = World::new(13, 30, 2, 2.0);
    let trained = train(&table(&world.csv(&known(&[100, 100]), |c| c.to_string(), false, 2)), &quick()).unwrap();
    let same = table(&world.csv(&known(&[60, 60]), |c| c.to_string(), false, 3));
    assert!(!trained.gate.drift(&same).unwrap().drifted);
    let mixed: Vec<_> = (0..120).map(|i| (i % 2, Some(1))).collect();
    assert!(trained.gate.drift(&table(&world.csv(&mixed, |c| c.to_string(), false, 3))).unwrap().drifted);
}
