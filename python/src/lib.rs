//! The compiled half of the Python package `servotune`: values that hold the library's own types, and calls that give the interpreter free.
//!
//! In: texts of the contract's files, numpy arrays. Out: [`answer::Answer`], the document that the command line prints with `--json`. The other half,
//! `servotune/*.py`, says what a person may write. No number is made here: every call goes to the library.

mod answer;
mod batch;
mod controller;
mod diagnose;
mod document;
mod floor;
mod frf;
mod gate;
mod identify;
mod margins;
mod picture;
mod plain;
mod plant;
mod refusal;
mod rows;
mod settings;
mod simulate;
mod spec;
mod tune;
mod verify;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::answer::Answer;
    #[pymodule_export]
    use super::batch::{batch_diagnose, batch_identify, batch_margins, batch_tune, batch_verify};
    #[pymodule_export]
    use super::controller::Controller;
    #[pymodule_export]
    use super::diagnose::{diagnose_case, diagnose_records};
    #[pymodule_export]
    use super::document::write_text;
    #[pymodule_export]
    use super::floor::{Floor, FloorHand};
    #[pymodule_export]
    use super::frf::{Frf, read_frf};
    #[pymodule_export]
    use super::gate::{Gate, train};
    #[pymodule_export]
    use super::identify::identify;
    #[pymodule_export]
    use super::margins::{margins_of_model, margins_of_sweep};
    #[pymodule_export]
    use super::plant::Plant;
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    use super::spec::Spec;
    #[pymodule_export]
    use super::tune::{Tuned, tune};
    #[pymodule_export]
    use super::verify::verify;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        super::refusal::add_to(module)
    }
}
