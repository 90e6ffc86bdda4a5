//! The second opinion: proves a gain table again from the raw files, by algorithms that the search and the margins do not use.
//!
//! In: a gain table, plants or a sweep, a spec, what is uncertain. Out: a certificate of bounds that hold at every frequency, or
//! a refusal that says what to measure again. Shared with the rest are the readers of files and the seeded generator only.
//! Convention: L = P C, negative feedback; spec: `specs/certificate.md`.

mod assured;
mod blocks;
mod bounds;
mod cascade;
mod case;
mod case_proof;
mod certificate;
mod chain;
mod clusters;
mod contour;
mod core_moves;
mod curve;
mod cut;
mod error;
mod expansion;
mod family;
mod hidden;
mod model;
mod moves;
mod patch;
mod path;
mod plant;
mod prove;
mod proven_limits;
mod quadratic;
mod roots;
mod rounding;
mod settings;
mod size;
mod spectrum_box;
mod step;
mod step_box;
mod swept;
mod table;
mod uncertain;
mod word;
mod write;
mod write_box;
mod write_piece;
mod write_record;

pub use crate::numeric::interval::Interval;
pub use assured::{Assurance, Assured, ProvedOn, Watched, tune_assured};
pub use bounds::{BoundedFigure, LoopBounds, ProvenCrossing, Stability};
pub use case_proof::{CaseProof, LimitVerdict, ProvenLimit};
pub use certificate::{Certificate, Inputs, SCHEMA, SourceFile, certify, certify_watched, choices, table_clock_s};
pub use error::VerifyError;
pub use settings::VerifySettings;
pub use swept::{LEAST_DAMPING, SweepAgain, SweepAssumption};
pub use table::TableFinding;
pub use uncertain::Uncertainty;
pub use word::Word;
pub use write::{Bands, WriteFigures};
pub use write_box::{BoxFigure, BoxHarmonic, BoxSettings, BoxWatch, BoxedLoop, WriteBox, WriteOpen, bound_write};

use crate::frf::Frf;
use crate::lti::{Plant, Section};
use model::Sampled;
use patch::Patch;
use swept::Swept;

/// Proves the loop of a plant model under the firmware's sections, over a box of parameters.
pub fn prove_loop(
    plant: &Plant,
    sections: &[Section],
    sample_time_s: f64,
    uncertainty: &Uncertainty,
    settings: &VerifySettings,
) -> Result<LoopBounds, VerifyError> {
    prove::prove(&modelled(plant, sections, sample_time_s, uncertainty)?, settings)
}

/// The loop of a plant model that can be proved.
fn modelled(plant: &Plant, sections: &[Section], t: f64, u: &Uncertainty) -> Result<Sampled, VerifyError> {
    plant.check()?;
    size::fits(plant, t, u)?;
    Sampled::new(plant, sections, t, u)
}

/// Proves the loop of a sweep, as far as its points allow: bounds, and the bands to sweep again where what may hide between them
/// could bring L closer to -1 than `away`.
pub fn prove_sweep(
    frf: &Frf,
    sections: &[Section],
    sample_time_s: f64,
    least_damping: f64,
    uncertainty: &Uncertainty,
    away: f64,
    settings: &VerifySettings,
) -> Result<(LoopBounds, Vec<SweepAgain>), VerifyError> {
    let swept = taken(frf, sections, sample_time_s, least_damping, uncertainty)?;
    let bounds = prove::prove(&swept, settings)?;
    Ok((bounds, swept.again(away)))
}

/// The loop of a sweep whose modes have at least this damping.
fn taken(
    frf: &Frf,
    sections: &[Section],
    t: f64,
    least_damping: f64,
    uncertainty: &Uncertainty,
) -> Result<Swept, VerifyError> {
    if !(least_damping > 0.0 && least_damping < 1.0) {
        return Err(VerifyError::LeastDamping { found: least_damping });
    }
    for (key, x) in
        [("frequency", uncertainty.frequency), ("damping", uncertainty.damping), ("delay", uncertainty.delay)]
    {
        if x > 0.0 {
            return Err(VerifyError::SweepBox { key });
        }
    }
    Swept::new(frf, sections, t, least_damping, uncertainty)
}
