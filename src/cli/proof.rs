//! The certificate that `tune` writes beside a gain table.
//!
//! In: the table as it lies on disk, the files it was made from. Out: `gains.certificate.json` and what it says, or why there can be none.
//! Spec: `specs/certificate.md`.

use super::{Failure, Screen, verify};
use crate::document::FileSet;
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

/// Proves `table`, which is to stand at `gains`, over the box `u` and adds the certificate to the files to be written. That a plant is beyond the proof, or a sweep
/// ends too early, stops no tuning: it is said.
pub(super) fn beside(
    gains: &Path,
    table: &str,
    on: &On<'_>,
    spec: &Path,
    u: Uncertainty,
    files: &mut FileSet,
) -> Result<Proof, Failure> {
    let file = verify::beside(gains);
    let gains = Source { file: gains.into(), text: table.into() };
    Ok(match prove(&gains, on, spec, u) {
        Ok(c) => {
            files.write(&file, c.text()?);
            Proof { file: Some(file), proved: c.proved, says: certificate_sentence(&c) }
        }
        Err(e) => {
            // One of an earlier table would speak of this one.
            files.remove(&file);
            Proof { file: None, proved: false, says: format!("No certificate: {e}.") }
        }
    })
}

/// Writes all files of one result, or none, and says which.
pub(super) fn commit(files: FileSet, screen: &mut Screen) -> Result<(), Failure> {
    let names: Vec<String> = files.files().map(|f| f.display().to_string()).collect();
    files.commit()?;
    names.iter().for_each(|name| screen.say(&format!("wrote {name}")));
    Ok(())
}

fn prove(
    gains: &Source,
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
        gains,
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
