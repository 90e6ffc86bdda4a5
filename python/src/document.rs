//! Files as the program writes them.

use crate::refusal::raise;
use pyo3::prelude::*;
use servotune::document;
use std::path::PathBuf;

/// Writes a text whole: under a name of its own, then renamed, so that what was there stays where this fails.
#[pyfunction]
pub fn write_text(py: Python<'_>, path: PathBuf, text: &str) -> PyResult<()> {
    py.detach(|| document::write_text(&path, text)).map_err(raise)
}
