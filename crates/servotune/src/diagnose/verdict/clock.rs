//! A log whose clock runs fast or slow: every time of the machine comes out scaled alike.
//!
//! A refit takes the scale into all its parameters and says nothing; one number in their place that does as well says what it is.

use super::finding::{Estimate, Finding};
use super::naming::everywhere;
use crate::diagnose::data::linear_form::{FreeParameter, body_numbers, rate_of};
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::ONE_NUMBER;
use crate::numeric::golden::golden_section;
use crate::physics::{Facts, time_base_drift};
use std::collections::BTreeMap;

/// Largest scale that is looked for, and how finely.
const LARGEST: f64 = 0.1;
const FINEST: f64 = 1e-6;

/// A scale of all times.
pub(super) struct Clock {
    /// By how much the machine's frequencies come out higher, relative.
    relative: f64,
    /// Its standard error.
    sigma: f64,
    /// Sum of squares of the whitened error with it, all else of the plant as given.
    pub cost: f64,
    given: f64,
}

/// The linear parameters under a clock that makes all frequencies 1 + e times as high.
fn scaled(data: &DiagnosisData, e: f64) -> Vec<f64> {
    let form = &data.form;
    let (_, _, c) = body_numbers(&form.given.body);
    let free_parameter = |free_parameter: &FreeParameter| match free_parameter {
        FreeParameter::Gain => 2.0 * e.ln_1p(),
        FreeParameter::Stiffness => e * (2.0 + e),
        FreeParameter::Viscous => c * e / rate_of(&form.given.body),
        FreeParameter::Delay => -form.given.delay_s * e / (1.0 + e) / data.scene.sample_time_s,
        FreeParameter::Pole(_) | FreeParameter::Zero(_) => e.ln_1p(),
        FreeParameter::PoleDamping(_) | FreeParameter::ZeroDamping(_) => 0.0,
    };
    form.free_parameters.iter().map(free_parameter).collect()
}

impl Clock {
    /// The scale under which the given plant fits best.
    pub fn of(data: &DiagnosisData, given: f64) -> Clock {
        let fit = data.fit(vec![]);
        let cost = |e: f64| fit.cost(&scaled(data, e));
        // Farther off the error has more than one valley.
        let coarse = (-20..=20).map(|i| LARGEST * (f64::from(i) / 20.0).powi(3)).map(|e| (cost(e), e));
        let near = coarse.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |c| c.1);
        let width = (0.3 * near.abs()).max(LARGEST * 1e-3);
        let best = golden_section(cost, near - width, near + width, FINEST);
        let step = (0.02 * best.x.abs()).max(10.0 * FINEST);
        let curve = (cost(best.x + step) + cost(best.x - step) - 2.0 * best.value) / (step * step);
        // Half of chi-square's curvature is one over the variance.
        let sigma = if curve > 0.0 { (0.5 * curve).sqrt().recip() } else { f64::INFINITY };
        Clock { relative: best.x, sigma, cost: best.value, given }
    }

    /// Whether it takes enough to be told from a chance likeness among small changes of many numbers.
    pub fn sure(&self) -> bool {
        self.given - self.cost > ONE_NUMBER
    }

    /// The finding.
    pub fn finding(&self, data: &DiagnosisData) -> Finding {
        let &Facts { name: effect, says, port, .. } = &time_base_drift::FACTS;
        let runs: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
        let off = 1.96 * self.sigma;
        let (value, unit) = (self.relative, "1".to_owned());
        Finding {
            effect: effect.into(),
            family: vec![effect.into()],
            port,
            p_value: log_tail(self.given - self.cost, 1).min(0.0).exp().max(1e-300),
            says: format!(
                "In the log {says}: with every frequency of the model {:.4} % {} it fits as well as with all of its numbers fitted.",
                100.0 * value.abs(),
                if value > 0.0 { "higher" } else { "lower" }
            ),
            parameters: BTreeMap::from([(
                "relative".to_owned(),
                Estimate { value, low: value - off, high: value + off, unit },
            )]),
            place: everywhere(&runs),
        }
    }
}
