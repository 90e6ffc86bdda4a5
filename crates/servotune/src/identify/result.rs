//! What identification hands back.

use super::interval::Intervals;
use super::spread::Spread;
use super::trust::TrustedBand;
use crate::lti::Plant;
use crate::numeric::golden::IntervalEnd;
use nalgebra::Complex;
use serde::Serialize;

/// One model form with its errors: a row of the paper's Table 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LadderRung {
    /// What the model holds.
    pub model: &'static str,
    /// Order of its rational part.
    pub order: usize,
    /// Norm error of eq. (19) over all points used (position_unit per command_unit).
    pub norm_error: f64,
    /// Root mean square of |model / measured - 1|. Eq. (19) sees the lowest frequencies only, where the gain is largest.
    pub relative_rms: f64,
}

/// What the data say about the form of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyEvidence {
    /// The form was chosen by the data, or asked for and supported by them.
    Supported,
    /// The body's natural frequency lies below the sweep, and the data do not fix it; sweep from lower frequencies to see it.
    BelowSweep {
        /// Lowest frequency of the sweep (Hz).
        lowest_hz: f64,
    },
}

/// Held-out score of one order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OrderScore {
    /// Resonance pairs.
    pub modes: usize,
    /// Order of the rational part.
    pub order: usize,
    /// Root mean square error (log magnitude and phase, ratio) at frequencies left out of the fit, each point's error
    /// bounded near ten noise deviations.
    pub score: f64,
    /// How much the sum of squares behind the score exceeds the best order's, in standard errors of that difference.
    pub above_best: f64,
}

/// Counts of work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FitWork {
    /// Small linear fits and golden-section evaluations of the paper's way.
    pub linear_fits: usize,
    /// Places tried for a further pair.
    pub candidates: usize,
    /// Jacobians of all nonlinear fits.
    pub jacobians: usize,
    /// Residual vectors of all nonlinear fits.
    pub evaluations: usize,
}

/// A plant model with everything that says how far to believe it.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The jointly refined model. Stable by construction.
    pub plant: Plant,
    /// The model of the paper's steps alone; `None` where no second-order body was stable.
    pub stepwise: Option<Plant>,
    /// Errors of the model forms, the jointly refined one last.
    pub ladder: Vec<LadderRung>,
    /// 95 % intervals.
    pub intervals: Intervals,
    /// What the data say about the body's form.
    pub body: BodyEvidence,
    /// Whether the joint fit's dead time sits on an end of its range.
    pub delay_bound: IntervalEnd,
    /// The same for the golden-section steps of the paper's way: dead time and resonance gain.
    pub stepwise_bounds: Option<(IntervalEnd, IntervalEnd)>,
    /// Names of parameters on an end of their range, as in the plant file.
    pub at_bound: Vec<String>,
    /// Points of the sweep where the fit saw means of neighbouring ones; none where it saw every point.
    pub gathered_from: Option<usize>,
    /// Angular frequencies used, those of the means for a gathered sweep (rad/s).
    pub w_rad_s: Vec<f64>,
    /// model / measured - 1 at each of them.
    pub residual: Vec<Complex<f64>>,
    /// Root mean square of |residual|.
    pub rms_relative_error: f64,
    /// 95th percentile of |residual|.
    pub p95_relative_error: f64,
    /// Relative noise deviation used for each point, both parts together.
    pub noise_relative_std: Vec<f64>,
    /// Reduced chi square of the fit under that noise; 1 when model and noise account for everything.
    pub chi_square: f64,
    /// Factor on the variances for neighbouring residuals that agree; 1 for independent ones.
    pub correlation_inflation: f64,
    /// Held-out score of every order tried; empty for a fixed order.
    pub held_out: Vec<OrderScore>,
    /// Where the model may be trusted.
    pub trusted: TrustedBand,
    /// Condition number of the scaled Jacobian at the solution.
    pub condition: f64,
    /// Whether the joint fit met its tolerance.
    pub converged: bool,
    /// Counts of work.
    pub work: FitWork,
    pub(super) spread: Spread,
}

impl Identified {
    /// `n` plants drawn from the estimate's normal distribution; the same seed gives the same plants.
    ///
    /// Logarithms of gains, frequencies and pole dampings are drawn, so that every plant is stable. Dead times below 0
    /// and viscous rates below 0 become 0.
    pub fn sample_plants(&self, n: usize, seed: u64) -> Vec<Plant> {
        self.spread.sample(n, seed)
    }
}
