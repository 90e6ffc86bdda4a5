//! The exact judgement of one controller on one machine, independent of the search's shortcuts.

use super::machine::{curve, measured_loop};
use super::requirements::{Found, Judged, Requirement};
use super::{Machine, Spec, TuneError};
use crate::controller::Controller;
use crate::feedback::{Margins, ModelLoop, margins};
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
    let margins = match machine {
        Machine::Model(plant) => {
            let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
            let write = simulate(plant, controller, &spec.profile)?;
            let f = figures(&write.pes, &spec.profile);
            (found.dft_low, found.dft_high) = (f.dft_low, f.dft_high);
            let of = |k: usize| f.harmonics.iter().find(|h| h.k == k).map_or(0.0, |h| h.amplitude);
            found.harmonics = spec.limits.harmonics.iter().map(|h| of(h.k)).collect();
            found.command_peak = write.command.iter().fold(0.0, |a, u| u.abs().max(a));
            margins(&ModelLoop::new(&sampled, &sections)?)
        }
        Machine::Response { frf, hold } => {
            let loop_ = measured_loop(frf, *hold, &sections)?;
            let bins =
                super::machine::bins(&spec.profile, &spec.limits.harmonics.iter().map(|h| h.k).collect::<Vec<_>>());
            let plant = curve(frf, *hold, controller.sample_time_s)?;
            let s = SpectralPes::new(&spec.profile, &plant, controller, bins, true)?;
            let mut amplitude = Vec::new();
            found.command_peak = s.write(&sections.chain, &mut SpectralWork::default(), &mut amplitude);
            found.dft_low = s.dft().band(&amplitude, LOW_BAND_HZ);
            found.dft_high = s.dft().band(&amplitude, HIGH_BAND_HZ);
            let of = |k: usize| s.dft().bins().iter().position(|b| *b == k).map_or(0.0, |i| amplitude[i]);
            found.harmonics = spec.limits.harmonics.iter().map(|h| of(h.k)).collect();
            margins(&loop_)
        }
    };
    found.unstable_poles = margins.unstable_poles;
    found.phase_margin_deg = margins.phase_margin_deg;
    found.gain_margin_db = margins.gain_margin_db;
    found.max_sensitivity = margins.max_sensitivity;
    found.gain_crossover_hz = margins.gain_crossover_hz;
    Ok(Proof { margins, judged: Judged::of(&wanted, found) })
}
