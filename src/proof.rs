//! The certificate that `tune` writes beside a gain table.
//!
//! In: a tuned table with its certificate, or a sweep to tune on. Out: `gains.toml`, `gains.certificate.json`, and what it says, or why there can be none.
//! Spec: `specs/certificate.md`.

use super::{Failure, Screen, verify};
use servotune::controller::Controller;
use servotune::document::FileSet;
use servotune::frf::Sweep;
use servotune::lti::Plant;
use servotune::tune::{GainTable, InputDigest, Machine, SearchStep, Spec, TuneError, TuneSettings};
use servotune::verify::{Assurance, Assured, Certificate, ProvedOn, SourceFile, Uncertainty, Watched, tune_assured};
use servotune_answer::Proof;
use std::path::Path;

/// Adds a table and its certificate to the files of one result; what is proved, none without a certificate asked for.
pub(super) fn add(
    gains: &Path,
    table: &GainTable,
    certificate: Option<&Result<Certificate, String>>,
    files: &mut FileSet,
) -> Result<Option<Proof>, Failure> {
    files.write(gains, table.text()?);
    let file = verify::beside(gains);
    let mut proof = certificate.map(Proof::of);
    match certificate {
        Some(Ok(c)) => {
            files.write(&file, c.text()?);
            proof.iter_mut().for_each(|p| p.file = Some(file.clone()));
        }
        // One of an earlier table would speak of this one.
        _ => files.remove(&file),
    }
    Ok(proof)
}

/// Writes all files of one result, or none, and says which.
pub(super) fn commit(files: FileSet, screen: &mut Screen) -> Result<(), Failure> {
    let names: Vec<String> = files.files().map(|f| f.display().to_string()).collect();
    files.commit()?;
    names.iter().for_each(|name| screen.say(&format!("wrote {name}")));
    Ok(())
}

/// A sweep that is tuned on, with the files that a certificate names.
pub(super) struct OnSweep<'a> {
    pub sweep: &'a Sweep,
    /// The model that continues it.
    pub plant: &'a Plant,
    pub spec: &'a Spec,
    pub spec_file: &'a Path,
    pub start: Option<&'a Controller>,
    pub inputs: &'a [InputDigest],
    pub gains: &'a Path,
}

impl OnSweep<'_> {
    /// Tunes on the sweep, with as much room as its intervals ask for.
    pub fn tune(&self, settings: &TuneSettings, screen: &mut Screen) -> Result<Assured, Failure> {
        let spec_source = SourceFile::read(self.spec_file)?;
        let profile = Spec::profile_path(self.spec_file).map_err(TuneError::from)?;
        let profile = profile.map(|p| SourceFile::read(&p)).transpose()?;
        let machine = Machine::Response { frf: &self.sweep.frf, continuation: Some(self.plant) };
        let job = Assurance {
            ground: ProvedOn::Sweep { sweep: self.sweep, machine },
            spec: self.spec,
            spec_source: &spec_source,
            profile: profile.as_ref(),
            uncertainty: Uncertainty::default(),
            start: self.start,
            units: (&self.plant.position_unit, &self.plant.command_unit),
            inputs: self.inputs,
            gains: self.gains,
        };
        Ok({
            let pace = screen.pace();
            let (search, proof) =
                (|s: &SearchStep| pace.search(s), |done, of| pace.part("proof of the write, boxes", done, of));
            let watch = Watched { search: &search, proof: &proof };
            tune_assured(&job, settings, &mut |words| screen.say(words), &watch)?
        })
    }
}
