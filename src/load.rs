//! Files into values, with the file's name in every refusal.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use super::{Failure, Screen};
use servotune::controller::Controller;
use servotune::document::read_text;
use servotune::document::size_limits::SWEEP_BYTES;
use servotune::frf::{Basis, Hold, Measured, Note, ReadSettings, Sweep, read_bytes, read_file};
use servotune::lti::Plant;
use servotune::pes::Profile;
use servotune_answer::{self as answer, Ran, adjusted, opened};
use std::f64::consts::TAU;
use std::io::Read;
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
    /// Whether the controller's hold is in the sweep, as the caller says.
    pub hold: Hold,
    /// The controller that ran, where the caller's words name no other.
    pub controller: Option<&'a Path>,
}

/// The sweep in a file, or on stdin where the file is `-`.
fn sweep_text(file: &Path, settings: &ReadSettings) -> Result<Sweep, Failure> {
    if file.as_os_str() != "-" {
        return Ok(read_file(file, settings)?);
    }
    let mut bytes = Vec::new();
    // One byte more than the reader takes: it then refuses by its own limit.
    let most = SWEEP_BYTES as u64 + 1;
    std::io::stdin().lock().take(most).read_to_end(&mut bytes).map_err(|source| Failure::Stdin { source })?;
    if bytes.len() > SWEEP_BYTES {
        return Err(Failure::Unfit {
            said: format!("stdin: longer than {SWEEP_BYTES} bytes; expected a sweep of at most that length"),
        });
    }
    Ok(read_bytes("stdin", &bytes, settings)?)
}

/// Refuses what would put a sign on the machine that nobody stated, and says aloud a unit that nobody stated.
///
/// `.bod` is the format of software that shows the margin; of any other file half a turn may as well be an inverted sensor.
fn doubtful(file: &Path, sweep: &Sweep, screen: &mut Screen) -> Result<(), Failure> {
    let name = file.to_string_lossy().to_lowercase();
    let shows_margin = name.ends_with(".bod") || name.ends_with(".bod.gz");
    for note in &sweep.notes {
        match note {
            Note::PhaseMargin { ground: Basis::GainPhase(evidence) } if !shows_margin => {
                return Err(Failure::HalfTurn { file: file.into(), evidence: evidence.to_string() });
            }
            Note::Frequency { ground: Basis::Contract, .. } => {
                let w = sweep.frf.w_rad_s();
                let [low, high] = [w[0] / TAU, w[w.len() - 1] / TAU];
                if !(round(low) || round(high)) {
                    screen.warn(&format!(
                        "warning: {}: nothing says the unit of frequency; hertz is taken, from {low:.6} to {high:.6} Hz. In rad/s it would be {:.6} to {:.6} Hz, and every gain wrong by 2 pi: --frequency hertz or --frequency rad_per_s settles it",
                        file.display(),
                        low / TAU,
                        high / TAU
                    ));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Whether a person may have set this end of a sweep: three digits tell it.
fn round(hz: f64) -> bool {
    format!("{hz:.2e}").parse::<f64>().is_ok_and(|tidy| (tidy - hz).abs() <= 2e-5 * hz)
}

/// Whether the file itself states what the note says: nothing was decided.
fn stated(note: &Note) -> bool {
    let ground = match note {
        Note::Frequency { ground, .. } | Note::Magnitude { ground, .. } | Note::Angle { ground, .. } => ground,
        Note::PhaseMargin { ground } | Note::PhaseResponse { ground } => ground,
        _ => return false,
    };
    matches!(ground, Basis::Header(_) | Basis::Format)
}

/// The plant's sweep, opened out of its loop where it was taken in one; what was decided is said.
pub(super) fn sweep(
    file: &Path,
    reading: &ReadingArguments,
    taken: &Taken<'_>,
    screen: &mut Screen,
) -> Result<Sweep, Failure> {
    let measured = taken.how.measured;
    let mut sweep = sweep_text(file, &adjusted(reading.settings(), measured, taken.unstable_poles))?;
    doubtful(file, &sweep, screen)?;
    for note in &sweep.notes {
        let said = format!("note: {}: {note}", file.display());
        if stated(note) { screen.detail(&said) } else { screen.say(&said) }
    }
    sweep.frf = sweep.frf.with_unstable_poles(taken.unstable_poles).with_hold(taken.hold);
    if measured == Measured::Plant {
        return match taken.how.measured_with {
            Some(_) => Err(Failure::MeasuredPlant),
            None => Ok(sweep),
        };
    }
    if taken.hold != Hold::NotIncluded {
        return Err(Failure::HoldTwice { measured });
    }
    let ran = taken.how.measured_with.as_deref().or(taken.controller).ok_or(Failure::NoController { measured })?;
    let text = read_text(ran)?;
    let ran = Ran { file: ran, text: &text, controller: &answer::controller(ran, &text)? };
    Ok(opened(file, sweep, measured, ran, &mut |words| screen.say(words))?)
}
