//! A loop as the pages draw it: responses on a grid with its margins.

use super::move_end::MoveRecord;
use super::steps::StepResponses;
use nalgebra::Complex;
use servotune::feedback::Margins;
use servotune::pes::{ClosedLoop, PesFigures};
use servotune::tune::Judged;

/// One controller on one machine, with all that is drawn of it.
#[derive(Clone, Debug)]
pub struct LoopView {
    /// "before", "after", or a name.
    pub name: String,
    /// Frequencies of the curves (Hz).
    pub hz: Vec<f64>,
    /// L at them.
    pub open_loop: Vec<Complex<f64>>,
    /// The sampled plant at them.
    pub plant: Vec<Complex<f64>>,
    /// The controller's sample time (s).
    pub sample_time_s: f64,
    /// Its margins.
    pub margins: Margins,
    /// The write; none where the loop is unstable.
    pub write: Option<(ClosedLoop, PesFigures)>,
    /// Its steps; none where the loop is unstable.
    pub steps: Option<StepResponses>,
    /// The end of the profile's move; none where nothing is asked of it.
    pub move_end: Option<MoveRecord>,
    /// The limits, judged; none where there is no spec.
    pub judged: Option<Judged>,
}
