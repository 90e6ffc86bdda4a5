//! A sweep that was taken in closed loop, opened out of it.

use super::{AnswerError, Say};
use servotune::controller::Controller;
use servotune::document::sha256_hex;
use servotune::frf::{Conjugate, Measured, PhaseConvention, ReadSettings, Sweep, open_loop};
use servotune::lti::FrequencyResponse;
use std::path::Path;

/// The controller that ran while a loop was swept.
#[derive(Clone, Copy, Debug)]
pub struct Ran<'a> {
    /// Its file.
    pub file: &'a Path,
    /// The text of it.
    pub text: &'a str,
    /// The controller.
    pub controller: &'a Controller,
}

/// How a file is read, knowing what was swept.
///
/// A margin is displayed of P and L only; and an unstable plant is not minimum-phase, which the tests of the phase presume.
pub fn adjusted(mut settings: ReadSettings, measured: Measured, unstable_poles: usize) -> ReadSettings {
    if settings.phase == PhaseConvention::Auto && !matches!(measured, Measured::Plant | Measured::Loop) {
        settings.phase = PhaseConvention::Response;
    }
    if settings.conjugate == Conjugate::Auto && unstable_poles > 0 {
        settings.conjugate = Conjugate::No;
    }
    settings
}

/// The plant's sweep out of a sweep of its loop; what was decided is said.
///
/// The digest of an opened sweep is of the file's, the word and the controller's together: none of the three can change unseen.
pub fn opened(
    file: &Path,
    mut sweep: Sweep,
    measured: Measured,
    ran: Ran<'_>,
    say: Say<'_>,
) -> Result<Sweep, AnswerError> {
    let mut say = |what: &str| say(&format!("note: {}: {what}", file.display()));
    let sections = ran.controller.sections();
    let sections = sections.map_err(|source| AnswerError::Controller { file: ran.file.into(), source })?;
    let opened = open_loop(measured, &sweep.frf, sections.sample_time_s, |w| sections.at(w))?;
    let [low, high] = opened.band_hz;
    say(&format!(
        "{measured} was swept with {}: the plant is opened out of it from {low:.4} to {high:.4} Hz, deviations grow up to {:.1} times",
        ran.file.display(),
        opened.growth
    ));
    if let Some(std) = opened.assumed {
        say(&format!("the file has no deviations: {std:.2e} of each value is taken, from the scatter of neighbours"));
    }
    if opened.unknown > 0 {
        say(&format!(
            "{} points are left out: the loop hides the plant there, |1 - {measured}| lying in the noise",
            opened.unknown
        ));
    }
    if opened.beyond > 0 {
        say(&format!("{} points at or above half the sample rate are left out", opened.beyond));
    }
    let law_digest = sha256_hex(ran.text.as_bytes());
    sweep.source_digest = sha256_hex(format!("{} {measured} {law_digest}", sweep.source_digest).as_bytes());
    (sweep.frf, sweep.coherence) = (opened.frf, None);
    Ok(sweep)
}
