//! How a search is run.

/// How the search is run; what it looks for stands in the spec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuneSettings {
    /// Sample time where neither a start controller nor the spec names one (s).
    pub sample_time_s: Option<f64>,
    /// Starts of the first round for each notch that the search sets (for one where it sets none), at least 1.
    pub starts: usize,
    /// Reflections of the simplex from each start.
    pub simplex_steps: u64,
    /// Linearisations of the polish from each start.
    pub polish_steps: usize,
    /// Rounds around the best ends at most; it ends before where the best repeats.
    pub rounds: usize,
    /// Whether the objective is the first machine's alone: further machines are members of a box around it, whose limits count.
    pub nominal_first: bool,
}

impl Default for TuneSettings {
    fn default() -> Self {
        TuneSettings {
            sample_time_s: None,
            starts: 12,
            simplex_steps: 25,
            polish_steps: 60,
            rounds: 60,
            nominal_first: false,
        }
    }
}
