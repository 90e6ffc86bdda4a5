//! Files into values, with the file's name in every refusal.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use super::{Failure, Screen};
use servotune::controller::Controller;
use servotune::document::read_text;
use servotune::frf::{Measured, Sweep, read_file};
use servotune::lti::Plant;
use servotune::pes::Profile;
use servotune_answer::{self as answer, Ran, adjusted, opened};
use std::path::Path;

/// A plant, its physics entries not looked at yet.
pub(super) fn plant(file: &Path) -> Result<Plant, Failure> {
    Ok(answer::plant(file, &read_text(file)?)?)
}

/// A controller, from controller.toml or from the gain table that holds one.
pub(super) fn controller(file: &Path) -> Result<Controller, Failure> {
    Ok(answer::controller(file, &read_text(file)?)?)
}

/// A profile.
pub(super) fn profile(file: &Path) -> Result<Profile, Failure> {
    Ok(answer::profile(file, &read_text(file)?)?)
}

/// How a sweep was taken, beside what stands in its file.
pub(super) struct Taken<'a> {
    /// The caller's words.
    pub how: &'a MeasuredArguments,
    /// Poles of the plant in the right half-plane.
    pub unstable_poles: usize,
    /// Whether the caller says that the hold is in the sweep.
    pub hold_included: bool,
    /// The controller that ran, where the caller's words name no other.
    pub controller: Option<&'a Path>,
}

/// The plant's sweep, opened out of its loop where it was taken in one; what was decided is said.
pub(super) fn sweep(
    file: &Path,
    reading: &ReadingArguments,
    taken: &Taken<'_>,
    screen: &mut Screen,
) -> Result<Sweep, Failure> {
    let measured = taken.how.measured;
    let mut sweep = read_file(file, &adjusted(reading.settings(), measured, taken.unstable_poles))?;
    sweep.notes.iter().for_each(|n| screen.say(&format!("note: {}: {n}", file.display())));
    sweep.frf = sweep.frf.with_unstable_poles(taken.unstable_poles);
    if measured == Measured::Plant {
        return match taken.how.measured_with {
            Some(_) => Err(Failure::MeasuredPlant),
            None => Ok(sweep),
        };
    }
    if taken.hold_included {
        return Err(Failure::HoldTwice { measured });
    }
    let ran = taken.how.measured_with.as_deref().or(taken.controller).ok_or(Failure::NoController { measured })?;
    let text = read_text(ran)?;
    let ran = Ran { file: ran, text: &text, controller: &answer::controller(ran, &text)? };
    Ok(opened(file, sweep, measured, ran, &mut |words| screen.say(words))?)
}
