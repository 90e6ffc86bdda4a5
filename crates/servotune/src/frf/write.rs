//! Sweep files as the positioner's own software writes them.
//!
//! In: a response. Out: tab-separated text, one header line. Convention: hertz, decibels, degrees; spec: `specs/frf.md`.

use super::error::FrfError;
use super::response::Frf;
use std::f64::consts::{PI, TAU};
use std::io::Write;

/// What the phase column of a written file shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhaseDisplay {
    /// Response phase, wrapped to +-180 deg.
    #[default]
    Response,
    /// Phase margin: response phase + 180 deg, wrapped to +-180 deg (paper section 2.1, figure 4).
    Margin,
}

/// Writes the response phase; see [`write_bod_as`].
pub fn write_bod(frf: &Frf, out: &mut impl Write) -> Result<(), FrfError> {
    write_bod_as(frf, PhaseDisplay::Response, out)
}

/// Writes rows of frequency (Hz), magnitude (dB) and phase (deg), and the relative standard deviation where the response has it.
///
/// Numbers carry as many digits as they need to be read back to the same double; a phase display names itself in the header only
/// as far as files of this kind do, so the reader must still be told or decide.
pub fn write_bod_as(frf: &Frf, phase: PhaseDisplay, out: &mut impl Write) -> Result<(), FrfError> {
    let failed = |source| FrfError::Write { source };
    let extra = if frf.relative_std().is_some() { "\tStd (relative)" } else { "" };
    writeln!(out, "Frequency (Hz)\tMagnitude (dB)\tPhase (deg){extra}").map_err(failed)?;
    for (i, (w, value)) in frf.w_rad_s().iter().zip(frf.value()).enumerate() {
        let response = value.arg() * 180.0 / PI;
        let shown = match phase {
            PhaseDisplay::Response => response,
            PhaseDisplay::Margin if response > 0.0 => response - 180.0,
            PhaseDisplay::Margin => response + 180.0,
        };
        let magnitude = 20.0 * value.norm().log10();
        write!(out, "{}\t{magnitude}\t{shown}", hertz(*w)).map_err(failed)?;
        if let Some(std) = frf.relative_std() {
            write!(out, "\t{}", std[i]).map_err(failed)?;
        }
        writeln!(out).map_err(failed)?;
    }
    Ok(())
}

/// The hertz that, times 2 pi, give back this very angular frequency; the plain quotient where none of its neighbours does.
fn hertz(w: f64) -> f64 {
    let plain = w / TAU;
    let near = [plain, plain.next_up(), plain.next_down()];
    near.into_iter().find(|f| f * TAU == w).unwrap_or(plain)
}
