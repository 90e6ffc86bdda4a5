//! What a channel that carries no response looks like, in words.
//!
//! In: findings of the check. Out: text for the error. Spec: `specs/frf.md`.

use std::fmt;

/// Which column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Magnitude.
    Magnitude,
    /// Phase.
    Phase,
    /// Real part.
    Real,
    /// Imaginary part.
    Imaginary,
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Channel::Magnitude => "magnitude",
            Channel::Phase => "phase",
            Channel::Real => "real part",
            Channel::Imaginary => "imaginary part",
        })
    }
}

/// What shows that a channel is dead.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum Dead {
    /// Every row has one value.
    Constant { found: f64, rows: usize },
    /// Rows one after another have one value where the channel moves on either side.
    Stuck { found: f64, rows: usize, lines: [u64; 2], hz: [f64; 2], expected_change: f64 },
    /// All rows share a few values.
    Steps { values: usize, rows: usize },
}

impl fmt::Display for Dead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Dead::Constant { found, rows } => write!(f, "is {found} in all {rows} rows; a measured response varies"),
            Dead::Stuck { found, rows, lines, hz, expected_change } => write!(
                f,
                "is stuck at {found} over {rows} rows, lines {} to {}, {:.6} to {:.6} Hz, where its neighbours say a change by about {expected_change:.3}",
                lines[0], lines[1], hz[0], hz[1]
            ),
            Dead::Steps { values, rows } => {
                write!(f, "has only {values} different values in {rows} rows; expected a finer resolution")
            }
        }
    }
}
