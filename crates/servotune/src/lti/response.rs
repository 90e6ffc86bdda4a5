//! What everything with a frequency response has in common.

use nalgebra::Complex;

/// A system whose response can be asked for at any frequency.
pub trait FrequencyResponse {
    /// The complex response at `w_rad_s` (rad/s). For a sampled system z = exp(j w T).
    fn at(&self, w_rad_s: f64) -> Complex<f64>;
}
