//! The figures of one PES: harmonics, bands, range and standard deviation of the window.

use super::{Harmonic, Profile, WindowDft};
use crate::numeric::statistics::{deviation, range};
use serde::Serialize;

/// The lower band of the DFT (Hz), eq. (42).
pub const LOW_BAND_HZ: [f64; 2] = [600.0, 1500.0];
/// The upper band of the DFT (Hz), eq. (43).
pub const HIGH_BAND_HZ: [f64; 2] = [1500.0, 3000.0];

/// What is read from the window, in the position's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PesFigures {
    /// Harmonics 1 to N/2.
    pub harmonics: Vec<Harmonic>,
    /// Euclidean norm over 600 to 1500 Hz, eq. (42); none where the window has no bin there.
    pub dft_low: Option<f64>,
    /// Euclidean norm over 1500 to 3000 Hz, eq. (43); none where the window has no bin there.
    pub dft_high: Option<f64>,
    /// Largest less smallest PES of the window.
    pub pes_range: f64,
    /// Standard deviation of the window, eq. (44) (divided by N).
    pub pes_std: f64,
}

/// The figures of a record of PES at the servo clock, whose sample 0 lies at time 0; the profile has been checked.
pub fn figures(pes: &[f64], profile: &Profile) -> PesFigures {
    let start = profile.first_servo_sample();
    let [first, last] = profile.pes.window;
    window_figures(&pes[start + first..start + last], profile.pes.sample_rate_hz)
}

/// The figures of the window itself.
pub fn window_figures(window: &[f64], rate_hz: f64) -> PesFigures {
    let dft = WindowDft::whole(window.len(), rate_hz);
    let mut amplitude = Vec::with_capacity(dft.bins().len());
    dft.amplitudes(window, &mut amplitude);
    let harmonics =
        dft.bins().iter().zip(&amplitude).map(|(&k, &amplitude)| Harmonic { k, hz: dft.hz(k), amplitude }).collect();
    // Without a bin there is no figure: a norm of nothing would be 0, the best of all.
    let band = |hz| dft.inside(hz).next().map(|_| dft.band(&amplitude, hz));
    PesFigures {
        harmonics,
        dft_low: band(LOW_BAND_HZ),
        dft_high: band(HIGH_BAND_HZ),
        pes_range: range(window),
        pes_std: deviation(window),
    }
}
