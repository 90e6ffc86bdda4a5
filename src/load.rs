//! Files into values, with the file's name in every refusal.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use super::{Failure, Screen};
use servotune::controller::Controller;
use servotune::document::size_limits::SWEEP_BYTES;
use servotune::document::{parse_toml, read_text, sha256_hex};
use servotune::frf::{
    Conjugate, Ground, Measured, Note, PhaseConvention, ReadSettings, Sweep, open_loop, read_bytes, read_file,
};
use servotune::lti::{FrequencyResponse, Plant, PlantFile};
use servotune::pes::Profile;
use servotune::tune::GainTable;
use std::f64::consts::TAU;
use std::io::Read;
use std::path::Path;

/// A plant, its physics entries not looked at yet.
pub(super) fn plant(file: &Path) -> Result<Plant, Failure> {
    let read: PlantFile = parse_toml(file, &read_text(file)?).map_err(|e| e.expecting(PlantFile::EXPECTED))?;
    Plant::try_from(read).map_err(|source| Failure::Plant { file: file.into(), source })
}

/// A controller, from controller.toml or from the gain table that holds one.
pub(super) fn controller(file: &Path) -> Result<Controller, Failure> {
    let text = read_text(file)?;
    // Only a gain table carries the sections that the firmware runs.
    if text.lines().any(|l| l.trim_start().starts_with("[[section]]")) {
        return Ok(GainTable::parse(file, &text)?.controller());
    }
    let controller: Controller = parse_toml(file, &text)
        .map_err(|e| e.expecting("a controller with its [pid] and filters, or a gain table of `servotune tune`"))?;
    controller.check().map_err(|source| Failure::Controller { file: file.into(), source })?;
    Ok(controller)
}

/// A profile.
pub(super) fn profile(file: &Path) -> Result<Profile, Failure> {
    let profile: Profile = parse_toml(file, &read_text(file)?)
        .map_err(|e| e.expecting("a profile of the write: [spiral], [pes] and [noise]"))?;
    profile.check().map_err(|source| Failure::Profile { file: file.into(), source })?;
    Ok(profile)
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
            Note::PhaseMargin { ground: Ground::GainPhase(evidence) } if !shows_margin => {
                return Err(Failure::HalfTurn { file: file.into(), evidence: evidence.to_string() });
            }
            Note::Frequency { ground: Ground::Contract, .. } => {
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
    matches!(ground, Ground::Header(_) | Ground::Format)
}

/// The plant's sweep, opened out of its loop where it was taken in one; what was decided is said.
///
/// The digest of an opened sweep is of the file's, the word and the controller's together: none of the three can change unseen.
pub(super) fn sweep(
    file: &Path,
    reading: &ReadingArguments,
    taken: &Taken<'_>,
    screen: &mut Screen,
) -> Result<Sweep, Failure> {
    let measured = taken.how.measured;
    let mut settings = reading.settings();
    // A margin is displayed of P and L only; and an unstable plant is not minimum-phase, which the tests of the phase presume.
    if settings.phase == PhaseConvention::Auto && !matches!(measured, Measured::Plant | Measured::Loop) {
        settings.phase = PhaseConvention::Response;
    }
    if settings.conjugate == Conjugate::Auto && taken.unstable_poles > 0 {
        settings.conjugate = Conjugate::No;
    }
    let mut sweep = sweep_text(file, &settings)?;
    doubtful(file, &sweep, screen)?;
    for note in &sweep.notes {
        let said = format!("note: {}: {note}", file.display());
        if stated(note) { screen.detail(&said) } else { screen.say(&said) }
    }
    let mut say = |what: &str| screen.say(&format!("note: {}: {what}", file.display()));
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
    let law = controller(ran)?;
    let sections = law.sections().map_err(|source| Failure::Controller { file: ran.into(), source })?;
    let opened = open_loop(measured, &sweep.frf, sections.sample_time_s, |w| sections.at(w))?;
    let [low, high] = opened.band_hz;
    say(&format!(
        "{measured} was swept with {}: the plant is opened out of it from {low:.4} to {high:.4} Hz, deviations grow up to {:.1} times",
        ran.display(),
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
    let law_digest = sha256_hex(read_text(ran)?.as_bytes());
    sweep.source_digest = sha256_hex(format!("{} {measured} {law_digest}", sweep.source_digest).as_bytes());
    (sweep.frf, sweep.coherence) = (opened.frf, None);
    Ok(sweep)
}
