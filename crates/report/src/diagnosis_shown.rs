//! What every section of a diagnosis page draws from: the diagnosis, its units, and how its names and numbers are written.

use super::number::NumberFormat;
use servotune::diagnose::{Diagnosed, FitFigures, Verdict};

/// What all parts of the page share.
pub(super) struct Shown<'a> {
    /// The diagnosis with its ground.
    pub made: &'a Diagnosed,
    /// position_unit.
    pub position: &'a str,
    /// command_unit.
    pub command: &'a str,
    /// Index of the run that is drawn before and after.
    pub run: usize,
}

impl Shown<'_> {
    /// Noise floor of one record (position_unit rms): of the hold-out records where there are any.
    pub fn floor(&self) -> f64 {
        figures(self.made).noise_floor
    }

    /// Sample time (s).
    pub fn sample_time_s(&self) -> f64 {
        self.made.data.scene.sample_time_s
    }

    /// Whether the laws in the model are findings; otherwise they are only the nearest ones.
    pub fn named(&self) -> bool {
        self.made.diagnosis.verdict != Verdict::LocatedUnexplained
    }

    /// Names of the three models: as given, refitted, with the findings.
    pub fn models(&self) -> [&'static str; 3] {
        let last = match (self.named(), &self.made.diagnosis.free_form) {
            (true, _) => "with findings",
            (false, Some(_)) => "with the curve",
            (false, None) => "best model tried",
        };
        ["model as given", "linear refit", last]
    }
}

/// The figures that count: of the hold-out records, else of the fit records.
pub(super) fn figures(made: &Diagnosed) -> &FitFigures {
    made.diagnosis.fit.holdout.as_ref().unwrap_or(&made.diagnosis.fit.fit)
}

/// A name from the list of effects, as words.
pub(super) fn words(effect: &str) -> String {
    effect.replace('_', " ")
}

/// Three digits, for sentences.
pub(super) fn short(value: f64) -> String {
    NumberFormat::Significant(3).page(value)
}
