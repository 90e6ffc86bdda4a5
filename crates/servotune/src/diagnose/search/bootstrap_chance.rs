//! What a search on records without physics says of the chance of an alarm.

use serde::Serialize;

/// What draws without any physics beyond the linear gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bootstrap {
    /// Draws.
    pub draws: usize,
    /// Logarithm of the closed-form bound of the strongest candidate on the records themselves.
    pub observed_log_p: f64,
    /// The same of each draw, smallest first.
    pub null_log_p: Vec<f64>,
    /// Chance of a candidate as strong as the observed one under noise alone: (1 + draws as strong) / (1 + draws).
    pub p_value: f64,
    /// Draws in which the search would have gone on to a finding, by the closed-form bound.
    pub alarms: usize,
}
