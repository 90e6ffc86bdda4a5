//! A gate before the tuning: `cargo run --release -p servotune --example train_gate`.
//!
//! Machines of a made-up production line, half of them to train with, the others to be told apart. Machine folders of your own come
//! with `gate::features::read_machines`.

use servotune::gate::features::{RawMachine, features};
use servotune::gate::{Action, Table};
use servotune::twin::line::{LineSettings, line};
use servotune::{TrainSettings, train};
use std::error::Error;
use std::path::Path;

/// Trains a gate and prints how many of the machines that it has not seen are told right.
pub fn main() -> Result<(), Box<dyn Error>> {
    let machines: Vec<RawMachine> = line(&LineSettings::of_total(1, 240))?.into_iter().map(|m| m.record).collect();
    let (known, new) = machines.split_at(120);
    let table = Table::parse(Path::new("known.csv"), &features(known).csv(), Some("label"))?;
    let settings = TrainSettings { label: "label".into(), epochs: Some(60), folds: 3, ..TrainSettings::default() };
    let gate = train(&table, &settings)?.gate;

    let unseen = Table::parse(Path::new("new.csv"), &features(new).csv(), Some("label"))?;
    let verdicts = gate.classify(&unseen)?;
    let truth = unseen.labels().ok_or("no labels")?;
    let decided = verdicts.iter().zip(truth).filter(|(v, _)| !v.abstained);
    let right = decided.clone().filter(|(v, label)| v.class.to_string() == **label).count();
    let count = decided.count();
    let worth_tuning = verdicts.iter().filter(|v| v.action == Action::Tune).count();
    let text = format!(
        "{} machines: decided {count}, right {right}, worth tuning {worth_tuning}\nfirst: {}\n",
        verdicts.len(),
        verdicts[0].why
    );
    std::io::Write::write_all(&mut std::io::stdout(), text.as_bytes())?;
    if count * 2 > verdicts.len() && right * 10 >= count * 9 { Ok(()) } else { Err("the gate tells too few".into()) }
}
