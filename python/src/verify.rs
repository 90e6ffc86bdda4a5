//! A gain table proved again.

use crate::answer::Answer;
use crate::frf::Frf;
use crate::plant::Plant;
use crate::refusal::raise;
use crate::settings::uncertainty;
use crate::spec::Spec;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::frf::{Hold, Sweep};
use servotune::verify::{Inputs, SourceFile, VerifySettings, Word, certify, table_clock_s};
use servotune_report::certificate::certificate_text;

/// The certificate of the gain table in a text, on plants and sweeps that must all pass, and what it says in words.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "Python names every one of them")]
pub fn verify(
    py: Python<'_>,
    gains: String,
    name: &str,
    plants: Vec<PyRef<'_, Plant>>,
    sweeps: Vec<PyRef<'_, Frf>>,
    spec: &Spec,
    shares: Option<&Bound<'_, PyDict>>,
    least_damping: f64,
    hold_included: bool,
    fixed_point: Option<(u32, u32)>,
    single: bool,
) -> PyResult<(Answer, String)> {
    let plants: Vec<SourceFile> = plants.iter().map(|p| SourceFile { file: p.file.clone(), text: p.text.clone() }).collect();
    let word = match (single, fixed_point) {
        (true, _) => Word::Single,
        (false, Some((bits, fraction))) => Word::Fixed { bits, fraction },
        (false, None) => Word::default(),
    };
    let gains = SourceFile { file: name.into(), text: gains };
    let clock_s = if hold_included { Some(table_clock_s(&gains).map_err(raise)?) } else { None };
    let taken = |f: &PyRef<'_, Frf>| {
        let mut sweep = f.sweep.as_ref().clone();
        sweep.frf = sweep.frf.with_hold(Hold::of(clock_s));
        sweep
    };
    let sweeps: Vec<Sweep> = sweeps.iter().map(taken).collect();
    let inputs = Inputs {
        gains: &gains,
        plants: &plants,
        sweeps: &sweeps,
        least_damping,
        spec: &spec.source,
        profile: spec.profile.as_ref(),
        word,
        uncertainty: uncertainty(shares)?.unwrap_or_default(),
    };
    let certificate = py.detach(|| certify(&inputs, &VerifySettings::default())).map_err(raise)?;
    let words = certificate_text(&certificate).map_err(raise)?;
    Ok((Answer::of(&certificate, certificate.proved, Vec::new())?, words))
}
