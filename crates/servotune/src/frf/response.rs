//! The measured response itself: frequencies, complex values, and how uncertain each one is.

use crate::document::size_limits::{SWEEP_POINTS, SWEEP_RAD_S, VALUE};
use nalgebra::Complex;
use thiserror::Error;

/// A frequency response on an ascending grid.
///
/// * `w_rad_s`: angular frequencies, strictly ascending, from 1e-6 to 1e10 rad/s, a million at most
/// * `value`: position over command at each frequency (position_unit / command_unit), of a size from 1e-30 to 1e30
/// * `relative_std`: standard deviation of each value divided by its magnitude, where the file carries it
///
/// The fields are private so that the promise of the first two lines holds for every `Frf`.
#[derive(Clone, Debug, PartialEq)]
pub struct Frf {
    w_rad_s: Vec<f64>,
    value: Vec<Complex<f64>>,
    relative_std: Option<Vec<f64>>,
    unstable_poles: usize,
}

/// Why numbers do not make a frequency response.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum FrfShapeError {
    /// The columns differ in length.
    #[error("a response needs columns of one length: {frequencies} frequencies, {values} values")]
    Length { frequencies: usize, values: usize },
    /// There is nothing in it.
    #[error("a response needs at least one point")]
    Empty,
    /// A frequency is not positive and finite, or not above the one before it.
    #[error("point {index}: frequency {found_hz} Hz; expected one between 2e-7 and 1.6e9 Hz, above the point before")]
    Frequency { index: usize, found_hz: f64 },
    /// A value is zero, not finite, or of a size that cannot be computed with.
    #[error("point {index} at {at_hz} Hz: the response is zero, not finite, or beyond 1e-30 to 1e30")]
    Value { index: usize, at_hz: f64 },
    /// More points than any sweep has.
    #[error("{found} points; expected at most {limit}")]
    Points { found: usize, limit: usize },
    /// A standard deviation is negative or not finite.
    #[error("point {index} at {at_hz} Hz: the standard deviation is negative or not finite")]
    Deviation { index: usize, at_hz: f64 },
}

impl Frf {
    /// A response from its columns; see the struct for shapes and units.
    pub fn new(
        w_rad_s: Vec<f64>,
        value: Vec<Complex<f64>>,
        relative_std: Option<Vec<f64>>,
    ) -> Result<Self, FrfShapeError> {
        let deviations = relative_std.as_ref().map_or(value.len(), Vec::len);
        if w_rad_s.len() != value.len() || deviations != value.len() {
            return Err(FrfShapeError::Length { frequencies: w_rad_s.len(), values: value.len().min(deviations) });
        }
        if w_rad_s.is_empty() {
            return Err(FrfShapeError::Empty);
        }
        if value.len() > SWEEP_POINTS {
            return Err(FrfShapeError::Points { found: value.len(), limit: SWEEP_POINTS });
        }
        let mut before = 0.0;
        for (index, (&w, v)) in w_rad_s.iter().zip(&value).enumerate() {
            let at_hz = w / std::f64::consts::TAU;
            if !(SWEEP_RAD_S[0]..=SWEEP_RAD_S[1]).contains(&w) || w <= before {
                return Err(FrfShapeError::Frequency { index, found_hz: at_hz });
            }
            let size = v.norm();
            if !(VALUE[0]..=VALUE[1]).contains(&size) {
                return Err(FrfShapeError::Value { index, at_hz });
            }
            if let Some(s) = relative_std.as_ref().map(|s| s[index])
                && !(0.0..=VALUE[1]).contains(&s)
            {
                return Err(FrfShapeError::Deviation { index, at_hz });
            }
            before = w;
        }
        Ok(Frf { w_rad_s, value, relative_std, unstable_poles: 0 })
    }

    /// The same response of a plant that has so many poles in the right half-plane: no sweep shows them, its owner states them.
    ///
    /// They count in every Nyquist count on this response. One made of two others does not inherit them.
    pub fn with_unstable_poles(self, poles: usize) -> Frf {
        Frf { unstable_poles: poles, ..self }
    }

    /// Poles of the plant in the right half-plane, as stated; 0 where nobody said so.
    pub fn unstable_poles(&self) -> usize {
        self.unstable_poles
    }

    /// Angular frequencies, ascending (rad/s).
    pub fn w_rad_s(&self) -> &[f64] {
        &self.w_rad_s
    }

    /// Complex response at each frequency.
    pub fn value(&self) -> &[Complex<f64>] {
        &self.value
    }

    /// Relative standard deviation of each value, where known.
    pub fn relative_std(&self) -> Option<&[f64]> {
        self.relative_std.as_deref()
    }

    /// Number of points, at least one.
    #[allow(clippy::len_without_is_empty, reason = "a response is never empty")]
    pub fn len(&self) -> usize {
        self.value.len()
    }
}
