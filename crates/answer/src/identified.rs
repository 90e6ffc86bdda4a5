//! The document of `identify`.

use serde::Serialize;
use servotune::frf::Sweep;
use servotune::identify::{FitWork, Identified, Intervals, LadderRung, OrderScore, TrustedBand};
use servotune::lti::PlantFile;

/// A model with what is known of its quality.
#[derive(Serialize)]
pub struct IdentifiedDocument<'a> {
    #[serde(flatten)]
    plant: PlantFile,
    order: usize,
    ladder: &'a [LadderRung],
    intervals: &'a Intervals,
    rms_relative_error: f64,
    p95_relative_error: f64,
    trusted: &'a TrustedBand,
    held_out: &'a [OrderScore],
    at_bound: &'a [String],
    converged: bool,
    chi_square: f64,
    condition: f64,
    work: &'a FitWork,
    notes: Vec<String>,
    source_digest: &'a str,
}

impl<'a> IdentifiedDocument<'a> {
    /// Of a sweep and the model found in it.
    pub fn of(sweep: &'a Sweep, id: &'a Identified) -> Self {
        IdentifiedDocument {
            plant: PlantFile::from(&id.plant),
            order: id.plant.order(),
            ladder: &id.ladder,
            intervals: &id.intervals,
            rms_relative_error: id.rms_relative_error,
            p95_relative_error: id.p95_relative_error,
            trusted: &id.trusted,
            held_out: &id.held_out,
            at_bound: &id.at_bound,
            converged: id.converged,
            chi_square: id.chi_square,
            condition: id.condition,
            work: &id.work,
            notes: sweep.notes.iter().map(ToString::to_string).collect(),
            source_digest: &sweep.source_digest,
        }
    }

    /// The fit converged and some band of it is to be trusted.
    pub fn accepted(&self) -> bool {
        self.converged && self.trusted.high_hz > 0.0
    }
}
