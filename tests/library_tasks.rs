//! The library's examples run from top to bottom; each ends with an error where its own check fails.
#![allow(missing_docs)]

#[path = "../crates/servotune/examples/diagnose_records.rs"]
mod diagnose_records;
#[path = "../crates/servotune/examples/margins_of_many.rs"]
mod margins_of_many;
#[path = "../crates/servotune/examples/simulate_write.rs"]
mod simulate_write;
#[path = "../crates/servotune/examples/sweep_to_margins.rs"]
mod sweep_to_margins;
#[path = "../crates/servotune/examples/train_gate.rs"]
mod train_gate;
#[path = "../crates/servotune/examples/tune_and_verify.rs"]
mod tune_and_verify;

#[test]
fn a_sweep_to_margins() {
    sweep_to_margins::main().unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_table_tuned_and_verified() {
    tune_and_verify::main().unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn the_position_error_of_a_write() {
    simulate_write::main().unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn margins_of_many_files() {
    margins_of_many::main().unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn records_to_a_diagnosis() {
    diagnose_records::main().unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_gate_trained_and_asked() {
    train_gate::main().unwrap_or_else(|e| panic!("{e}"));
}
