//! Long runs of changed files through every reader: `cargo bench --bench fuzz -- --runs 100000 --seed 7`.
//!
//! Ends with 1 where a reader panicked, hung or accepted what is wrong; the trials named can be made again by their seed and number.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().collect();
    let number = |key: &str, default: u64| {
        words.iter().position(|w| w == key).and_then(|i| words.get(i + 1)?.parse().ok()).unwrap_or(default)
    };
    let scratch = std::env::temp_dir().join(format!("servotune-fuzz-{}", std::process::id()));
    let (runs, seed) = (number("--runs", 20_000) as usize, number("--seed", 1));
    let limit = Duration::from_secs(20);
    let tallies = servotune_lab::reader_mutations(runs, seed, &scratch, limit, &mut |words| println!("{words}"));
    let _ = std::fs::remove_dir_all(&scratch);
    match tallies {
        Ok(all) => {
            all.iter().flat_map(|t| t.panics.iter().chain(&t.hangs).chain(&t.wrong)).for_each(|w| println!("{w}"));
            if all.iter().all(servotune_lab::Tally::sound) { ExitCode::SUCCESS } else { ExitCode::from(1) }
        }
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(2)
        }
    }
}
