//! The certificate that `tune` writes beside a gain table.
//!
//! In: the table as it lies on disk, the files it was made from. Out: `gains.certificate.json` and what it says, or why there can be none.
//! Spec: `specs/certificate.md`.

use super::{Failure, Screen, verify};
use crate::document::write_text;
use crate::frf::Sweep;
use crate::report::certificate::certificate_sentence;
use crate::tune::Spec;
use crate::verify::{
    Inputs, LEAST_DAMPING, Source, SweepAssumption, Uncertainty, VerifyError, VerifySettings, Word, certify,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What the proof of a table came to.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Proof {
    /// The certificate; absent where nothing could be proved or refused.
    pub file: Option<PathBuf>,
    /// Every limit is proved on every machine given.
    pub proved: bool,
    /// The same in a sentence: what is not proved, and by how much.
    pub says: String,
}

/// What a table was tuned on.
pub(super) enum On<'a> {
    Plant(&'a Path),
    Sweep { sweep: &'a Sweep, hold_included: bool },
}

/// Proves the table at `gains` over the box `u` and writes the certificate beside it. That a plant is beyond the proof, or a sweep ends too early, stops no
/// tuning: it is said.
pub(super) fn beside(
    gains: &Path,
    on: &On<'_>,
    spec: &Path,
    u: Uncertainty,
    screen: &mut Screen,
) -> Result<Proof, Failure> {
    let file = verify::beside(gains);
    Ok(match prove(gains, on, spec, u) {
        Ok(c) => {
            write_text(&file, &c.text()?)?;
            screen.say(&format!("wrote {}", file.display()));
            Proof { file: Some(file), proved: c.proved, says: certificate_sentence(&c) }
        }
        Err(e) => {
            // One of an earlier table would speak of this one.
            if file.exists() {
                std::fs::remove_file(&file).map_err(|source| Failure::Remove { file, source })?;
            }
            Proof { file: None, proved: false, says: format!("No certificate: {e}.") }
        }
    })
}

fn prove(
    gains: &Path,
    on: &On<'_>,
    spec: &Path,
    uncertainty: Uncertainty,
) -> Result<crate::verify::Certificate, VerifyError> {
    let (mut plants, mut sweeps, mut hold) = (Vec::new(), Vec::new(), false);
    match on {
        On::Plant(file) => plants.push(Source::read(file)?),
        On::Sweep { sweep, hold_included } => {
            sweeps.push((*sweep).clone());
            hold = *hold_included;
        }
    }
    let inputs = Inputs {
        gains: &Source::read(gains)?,
        plants: &plants,
        sweeps: &sweeps,
        assumption: SweepAssumption { least_damping: LEAST_DAMPING, hold_included: hold },
        spec: &Source::read(spec)?,
        profile: &Source::read(&Spec::profile_path(spec)?)?,
        word: Word::Double,
        uncertainty,
    };
    certify(&inputs, &VerifySettings::default())
}
