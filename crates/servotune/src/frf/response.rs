//! The measured response itself: frequencies, complex values, and how uncertain each one is.

use crate::document::size_limits::{SWEEP_POINTS, SWEEP_RAD_S, VALUE};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Whether the controller's zero-order hold is part of a response.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// The response is that of the continuous plant, as in the paper.
    #[default]
    NotIncluded,
    /// It was measured from the held command.
    Included {
        /// Sample time of the hold (s).
        sample_time_s: f64,
    },
}

impl Hold {
    /// A hold of this sample time (s); none where there is none.
    pub fn of(sample_time_s: Option<f64>) -> Hold {
        sample_time_s.map_or(Hold::NotIncluded, |sample_time_s| Hold::Included { sample_time_s })
    }
}

/// Difference of two sample times that are one clock (relative).
const SAME_CLOCK: f64 = 1e-3;

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
    hold: Hold,
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
        Ok(Frf { w_rad_s, value, relative_std, unstable_poles: 0, hold: Hold::NotIncluded })
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

    /// The same response, the controller's hold being part of it or not; without a word it is not. One made of two others does not inherit it.
    pub fn with_hold(self, hold: Hold) -> Frf {
        Frf { hold, ..self }
    }

    /// Whether the controller's hold is part of it.
    pub fn hold(&self) -> Hold {
        self.hold
    }

    /// Whether a hold of this sample time (s) is part of it; an error with the hold's own sample time where that is another one.
    pub fn holds(&self, sample_time_s: f64) -> Result<bool, f64> {
        match self.hold {
            Hold::NotIncluded => Ok(false),
            Hold::Included { sample_time_s: own } if (own / sample_time_s - 1.0).abs() < SAME_CLOCK => Ok(true),
            Hold::Included { sample_time_s: own } => Err(own),
        }
    }

    /// Another response that was taken like this one: stated poles and hold stay.
    pub fn alike(
        &self,
        w_rad_s: Vec<f64>,
        value: Vec<Complex<f64>>,
        relative_std: Option<Vec<f64>>,
    ) -> Result<Frf, FrfShapeError> {
        Ok(Frf { unstable_poles: self.unstable_poles, hold: self.hold, ..Frf::new(w_rad_s, value, relative_std)? })
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
