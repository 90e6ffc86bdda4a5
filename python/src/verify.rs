//! A gain table proved again.

use crate::answer::Answer;
use crate::frf::Frf;
use crate::plant::Plant;
use crate::refusal::raise;
use crate::settings::uncertainty;
use crate::spec::Spec;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::frf::Sweep;
use servotune::verify::{Inputs, Source, SweepAssumption, VerifySettings, Word, certify};
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
    let plants: Vec<Source> = plants.iter().map(|p| Source { file: p.file.clone(), text: p.text.clone() }).collect();
    let sweeps: Vec<Sweep> = sweeps.iter().map(|f| f.sweep.as_ref().clone()).collect();
    let word = match (single, fixed_point) {
        (true, _) => Word::Single,
        (false, Some((bits, fraction))) => Word::Fixed { bits, fraction },
        (false, None) => Word::default(),
    };
    let gains = Source { file: name.into(), text: gains };
    let inputs = Inputs {
        gains: &gains,
        plants: &plants,
        sweeps: &sweeps,
        assumption: SweepAssumption { least_damping, hold_included },
        spec: &spec.source,
        profile: spec.profile.as_ref(),
        word,
        uncertainty: uncertainty(shares)?.unwrap_or_default(),
    };
    let certificate = py.detach(|| certify(&inputs, &VerifySettings::default())).map_err(raise)?;
    let words = certificate_text(&certificate).map_err(raise)?;
    Ok((Answer::of(&certificate, certificate.proved, Vec::new())?, words))
}
