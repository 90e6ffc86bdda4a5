//! What the caller knows about a sweep file; everything left at `Auto` is decided from the file and noted.
//!
//! In: the caller's words. Out: [`ReadSettings`]. Spec: `specs/frf.md`.

use crate::document::size_limits;
use std::fmt;
use std::str::FromStr;

macro_rules! choice {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $word:literal),+ $(,)? } default $default:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vdoc])* $variant),+ }
        impl Default for $name {
            fn default() -> Self { $name::$default }
        }
        impl $name {
            /// The words that name the choices, in the order of declaration.
            pub const WORDS: &'static [&'static str] = &[$($word),+];
        }
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $($name::$variant => $word),+ })
            }
        }
        impl FromStr for $name {
            type Err = UnknownWord;
            fn from_str(word: &str) -> Result<Self, UnknownWord> {
                match word {
                    $($word => Ok($name::$variant),)+
                    _ => Err(UnknownWord { found: word.to_owned(), expected: $name::WORDS }),
                }
            }
        }
    };
}

/// A word that names no choice.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{found}`; expected one of: {}", expected.join(", "))]
pub struct UnknownWord {
    /// The word as given.
    pub found: String,
    /// The words that are known.
    pub expected: &'static [&'static str],
}

choice! {
    /// What the phase column shows (paper section 2.1, figures 4 and 5).
    PhaseConvention {
        /// Decide from the gain-phase relation, or refuse.
        Auto = "auto",
        /// Response phase + 180 deg, wrapped to +-180 deg: the display of the positioner's own software.
        Margin = "margin",
        /// The response phase itself.
        Response = "response",
    } default Auto
}
choice! {
    /// How the magnitude column is scaled.
    MagnitudeScale {
        /// Decide from the header, then from the data.
        Auto = "auto",
        /// 20 log10 of the ratio.
        Decibels = "decibels",
        /// The ratio itself.
        Linear = "linear",
    } default Auto
}
choice! {
    /// The unit of the phase column.
    AngleUnit {
        /// Decide from the header, then from the data.
        Auto = "auto",
        /// Degrees.
        Degrees = "degrees",
        /// Radians.
        Radians = "radians",
    } default Auto
}
choice! {
    /// The unit of the frequency column.
    FrequencyUnit {
        /// Decide from the header, then from round end points, then hertz as the file contract says.
        Auto = "auto",
        /// Hertz.
        Hertz = "hertz",
        /// Radians per second.
        RadPerSec = "rad_per_s",
    } default Auto
}
choice! {
    /// Whether the file holds the complex conjugate of the response.
    Conjugate {
        /// Test it; a file that is clearly conjugated is refused with the evidence.
        Auto = "auto",
        /// Take the file as it is, without a test.
        No = "no",
        /// The file is conjugated: undo it.
        Yes = "yes",
    } default Auto
}
choice! {
    /// What to do with a frequency that stands in the file more than once.
    Duplicates {
        /// Refuse, naming both lines.
        Refuse = "refuse",
        /// Take the mean of the complex values, with a note.
        Average = "average",
    } default Refuse
}
choice! {
    /// What to do with frequencies that neither rise nor fall throughout. A falling sweep is always turned round, with a note.
    Unsorted {
        /// Refuse, naming the line.
        Refuse = "refuse",
        /// Sort by frequency, with a note.
        Sort = "sort",
    } default Refuse
}
choice! {
    /// What to do with a row that holds NaN, an infinity or an empty field.
    BadPoints {
        /// Refuse, naming line and column.
        Refuse = "refuse",
        /// Leave the row out, with a note.
        Drop = "drop",
    } default Refuse
}
choice! {
    /// What was swept: the plant, or its loop closed by a known controller.
    Measured {
        /// P, position over command.
        Plant = "P",
        /// L = P C, with the sign that makes 1 + L the loop's denominator.
        Loop = "L",
        /// S = 1/(1 + L), error over reference.
        Sensitivity = "S",
        /// T = L/(1 + L), position over reference.
        Complementary = "T",
        /// P S, position over a disturbance at the plant's input.
        Process = "PS",
        /// C S, command over reference.
        Control = "CS",
    } default Plant
}
choice! {
    /// What to do with a single point that stands far off its neighbours (`specs/frf.md`, "Dead channels and single points").
    Outliers {
        /// Leave it out, with a note that names its frequency.
        Drop = "drop",
        /// Take it as it is: a resonance so sharp that it shows in one point only.
        Keep = "keep",
        /// Refuse, naming line and frequency.
        Refuse = "refuse",
    } default Drop
}
choice! {
    /// How a column of standard deviations is scaled.
    DeviationScale {
        /// From its header word (`rel`, `%`, `dB`); otherwise absolute, with a note.
        Auto = "auto",
        /// In the unit of the linear magnitude.
        Absolute = "absolute",
        /// Divided by the magnitude already.
        Relative = "relative",
    } default Auto
}

/// Which columns to read, by header name (case does not matter) or by number as text, counted from 1.
///
/// Either `magnitude` and `phase` or `real` and `imaginary` go with `frequency`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnChoice {
    /// The frequency column.
    pub frequency: String,
    /// The magnitude column.
    pub magnitude: Option<String>,
    /// The phase column.
    pub phase: Option<String>,
    /// The column of real parts.
    pub real: Option<String>,
    /// The column of imaginary parts.
    pub imaginary: Option<String>,
    /// The column of standard deviations.
    pub std: Option<String>,
    /// The column of coherence.
    pub coherence: Option<String>,
}

/// What the caller knows about the file. The default knows nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadSettings {
    /// What the phase column shows.
    pub phase: PhaseConvention,
    /// How the magnitude column is scaled.
    pub magnitude: MagnitudeScale,
    /// The unit of the phase column.
    pub angle: AngleUnit,
    /// The unit of the frequency column.
    pub frequency: FrequencyUnit,
    /// Whether the file is conjugated.
    pub conjugate: Conjugate,
    /// What to do with repeated frequencies.
    pub duplicates: Duplicates,
    /// What to do with frequencies out of order.
    pub unsorted: Unsorted,
    /// What to do with unusable rows.
    pub bad_points: BadPoints,
    /// What to do with single points far off their neighbours.
    pub outliers: Outliers,
    /// How a column of standard deviations is scaled.
    pub deviation: DeviationScale,
    /// Which columns to read; `None` finds them from the header or the contract's order.
    pub columns: Option<ColumnChoice>,
    /// Which response of a universal, MATLAB or Touchstone file to read, counted from 1; `None` demands that there is only one response.
    pub dataset: Option<usize>,
    /// Lowest and highest frequency that the sweep was meant to cover (Hz); an early stop is then an error.
    pub expected_hz: Option<(f64, f64)>,
    /// Largest accepted file (bytes).
    pub file_limit_bytes: usize,
    /// Largest accepted text after decompression (bytes).
    pub inflated_limit_bytes: usize,
}

impl Default for ReadSettings {
    fn default() -> Self {
        ReadSettings {
            phase: PhaseConvention::Auto,
            magnitude: MagnitudeScale::Auto,
            angle: AngleUnit::Auto,
            frequency: FrequencyUnit::Auto,
            conjugate: Conjugate::Auto,
            duplicates: Duplicates::Refuse,
            unsorted: Unsorted::Refuse,
            bad_points: BadPoints::Refuse,
            outliers: Outliers::Drop,
            deviation: DeviationScale::Auto,
            columns: None,
            dataset: None,
            expected_hz: None,
            file_limit_bytes: size_limits::SWEEP_BYTES,
            inflated_limit_bytes: size_limits::SWEEP_BYTES_UNPACKED,
        }
    }
}
