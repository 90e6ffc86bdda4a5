//! The exact judgement of one controller on one machine, independent of the search's shortcuts.

use super::machine::{curve, measured_loop};
use super::requirements::{Found, Judged, Requirement};
use super::{Machine, Spec, TuneError};
use crate::controller::Controller;
use crate::feedback::{Margins, ModelLoop, OpenLoop, confirmed_margins, margins};
use crate::lti::DiscretePlant;
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, SpectralPes, SpectralWork, figures, simulate};
use serde::Serialize;

/// One controller on one machine: all margins, and every requirement judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proof {
    /// Margins, refined on the function itself.
    pub margins: Margins,
    /// Requirements with what was found.
    pub judged: Judged,
}

/// Judges a controller: [`margins`] on the loop, and the whole write simulated, or read off the spectrum of a response.
pub fn judge(machine: &Machine<'_>, controller: &Controller, spec: &Spec) -> Result<Proof, TuneError> {
    let wanted = Requirement::list(&spec.margins, &spec.limits);
    let sections = controller.sections()?;
    let mut found = Found::default();
    let mut end_gain = None;
    let margins = match machine {
        Machine::Model(plant) => {
            let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
            let write = simulate(plant, controller, &spec.profile)?;
            let f = figures(&write.pes, &spec.profile);
            // A limit on a band without a bin is refused with the spec; without a limit the norm of nothing weighs nothing.
            (found.dft_low, found.dft_high) = (f.dft_low.unwrap_or(0.0), f.dft_high.unwrap_or(0.0));
            let of = |k: usize| f.harmonics.iter().find(|h| h.k == k).map_or(0.0, |h| h.amplitude);
            found.harmonics = spec.limits.harmonics.iter().map(|h| of(h.k)).collect();
            found.command_peak = write.command.iter().fold(0.0, |a, u| u.abs().max(a));
            confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?
        }
        Machine::Response { frf, hold, continuation } => {
            let loop_ = measured_loop(frf, *hold, &sections)?;
            let bins =
                super::machine::bins(&spec.profile, &spec.limits.harmonics.iter().map(|h| h.k).collect::<Vec<_>>());
            let plant = curve(frf, *hold, *continuation, controller.sample_time_s)?;
            let s = SpectralPes::new(&spec.profile, &plant, controller, bins, true)?;
            let mut amplitude = Vec::new();
            found.command_peak = s.write(&sections.chain, &mut SpectralWork::default(), &mut amplitude);
            found.dft_low = s.dft().band(&amplitude, LOW_BAND_HZ);
            found.dft_high = s.dft().band(&amplitude, HIGH_BAND_HZ);
            let of = |k: usize| s.dft().bins().iter().position(|b| *b == k).map_or(0.0, |i| amplitude[i]);
            found.harmonics = spec.limits.harmonics.iter().map(|h| of(h.k)).collect();
            end_gain = Some(loop_.at(loop_.end_rad_s()).norm());
            margins(&loop_)
        }
    };
    found.unstable_poles = margins.unstable_poles;
    found.phase_margin_deg = margins.phase_margin_deg;
    // A sweep that ends before L turns negative has its last point to speak of; beyond it |L| is taken to stay below that.
    found.within_sweep = end_gain.is_some();
    found.gain_margin_db = margins.gain_margin_db.or(end_gain.map(|size| -20.0 * size.log10()));
    found.max_sensitivity = margins.max_sensitivity;
    found.gain_crossover_hz = margins.gain_crossover_hz;
    Ok(Proof { margins, judged: Judged::of(&wanted, found) })
}

/// How many times later the way back comes where a loop may be slow.
const LASTING: f64 = 16.0;

/// The weighted sum of both DFT norms on a measured response with the way back much later; none for a model, whose write is simulated.
///
/// A loop that forgets slowly still sees the move before, which the ordinary period takes for part of the write.
pub(super) fn lasting_objective(
    m: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
) -> Result<Option<f64>, TuneError> {
    let Machine::Response { frf, hold, continuation } = m else { return Ok(None) };
    let plant = curve(frf, *hold, *continuation, controller.sample_time_s)?;
    let bins = super::machine::bins(&spec.profile, &[]);
    let s = SpectralPes::lasting(&spec.profile, &plant, controller, bins, false, LASTING)?;
    let mut amplitude = Vec::new();
    s.write(&controller.sections()?.chain, &mut SpectralWork::default(), &mut amplitude);
    let [low, high] = super::bench::weights(&spec.limits);
    Ok(Some(low * s.dft().band(&amplitude, LOW_BAND_HZ) + high * s.dft().band(&amplitude, HIGH_BAND_HZ)))
}
