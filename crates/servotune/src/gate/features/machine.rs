//! One machine as measured, before any feature.

use crate::frf::Frf;

/// What is known of one machine. A part that is missing or broken is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMachine {
    /// Name of the machine.
    pub id: String,
    /// Its swept sine.
    pub response: Option<Frf>,
    /// The PES of its spiral write.
    pub pes: Option<PesRecord>,
    /// The numbers of its log, in the order of their keys.
    pub log: Vec<LogEntry>,
    /// Its class, where the log has it.
    pub label: Option<String>,
}

/// One number of a log; keys of nested tables are joined by a dot.
#[derive(Clone, Debug, PartialEq)]
pub struct LogEntry {
    /// The key.
    pub key: String,
    /// The number.
    pub value: f64,
}

/// A PES at the servo clock.
#[derive(Clone, Debug, PartialEq)]
pub struct PesRecord {
    /// Time of each sample (s), rising; 0 is the start of the move.
    pub time_s: Vec<f64>,
    /// The PES (position_unit).
    pub pes: Vec<f64>,
}

impl PesRecord {
    /// The servo rate (Hz): one over the median step of the clock, so that a lost sample does not move it. NaN below two samples.
    pub fn rate_hz(&self) -> f64 {
        let mut step: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        if step.is_empty() {
            return f64::NAN;
        }
        let middle = step.len() / 2;
        1.0 / *step.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// The first sample of the move: the first at or after time 0, rounding of the file's clock allowed for.
    pub fn start(&self) -> usize {
        let slack = 0.25 / self.rate_hz();
        let slack = if slack.is_finite() { slack } else { 0.0 };
        self.time_s.partition_point(|t| *t < -slack)
    }

    /// The samples from the start of the move on.
    pub fn moving(&self) -> &[f64] {
        &self.pes[self.start().min(self.pes.len())..]
    }
}
