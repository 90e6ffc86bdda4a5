//! Sealed blind cases for `diagnose`, made by an independent simulator (`specs/blind.md`). Shares no code with the product.
//!
//! `cargo bench --bench blind -- make --out DIR --seed N --set benchmark|power|p58 [--count N]`
//! `cargo bench --bench blind -- commit DIR`
//! `cargo bench --bench blind -- score DIR --diagnoses DDIR --out results/mismatch`
#![allow(
    missing_docs,
    clippy::print_stdout,
    clippy::print_stderr,
    clippy::too_many_arguments,
    clippy::many_single_char_names,
    clippy::type_complexity,
    clippy::needless_range_loop,
    clippy::collapsible_if
)]

mod commit;
mod complex;
mod controller;
mod drives;
mod effects;
mod family;
mod fit;
mod machine;
mod make;
mod outside;
mod physics;
mod random;
mod score;
mod set;
mod showcase;
mod statistics;
mod world;
mod write;

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let option = |name: &str| words.iter().position(|w| w == name).and_then(|i| words.get(i + 1)).cloned();
    let folder = words.get(1).filter(|w| !w.starts_with("--")).map(PathBuf::from);
    let done = match words.first().map(String::as_str) {
        Some("make") => {
            let seed = option("--seed").and_then(|s| s.parse().ok());
            match (option("--out"), seed) {
                (Some(out), Some(seed)) => set::make(
                    &PathBuf::from(out),
                    seed,
                    &option("--set").unwrap_or("benchmark".into()),
                    option("--count").and_then(|c| c.parse().ok()),
                ),
                _ => Err("make needs --out DIR and --seed N".into()),
            }
        }
        Some("commit") => folder.ok_or("commit needs DIR".into()).and_then(|d| commit::commit(&d)),
        Some("score") => match (folder, option("--diagnoses"), option("--out")) {
            (Some(d), Some(ddir), Some(out)) => score::score(&d, &PathBuf::from(ddir), &PathBuf::from(out)),
            _ => Err("score needs DIR, --diagnoses DDIR and --out OUT".into()),
        },
        // Run with nothing to do, as `cargo bench` does for all benches.
        _ => {
            eprintln!(
                "blind: make --out DIR --seed N --set benchmark|power|p58 [--count N] | commit DIR | score DIR --diagnoses DDIR --out OUT"
            );
            Ok(())
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("blind: {message}");
            ExitCode::from(2)
        }
    }
}
