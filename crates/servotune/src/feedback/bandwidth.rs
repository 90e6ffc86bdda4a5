//! The closed-loop bandwidth: where |T| first falls below -3 dB.
//!
//! In: a loop, on a search's grid or as a function. Out: the frequency; on the grid with what its derivatives need.

use super::crossing::sign_changes;
use super::{Event, LoopOnGrid, OpenLoop, SampledPlant, Trace};
use crate::lti::Section;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// |T| at the bandwidth: -3 dB.
pub const BANDWIDTH_LEVEL: f64 = 0.707_945_784_384_137_9;

impl SampledPlant {
    /// The first crossing of |T| below -3 dB, going up in frequency, of the loop closed last; value: where (Hz), slope: d ln T / d ln w,
    /// whose real part is the slope of |T|. An event at the first point, without slope, where |T| is below already there; none where it
    /// never falls below.
    ///
    /// With d ln C the change of the sections at that frequency, ln|T| changes by Re(S d ln C), and the bandwidth by the factor
    /// exp(-Re(S d ln C)/Re(slope)).
    pub fn closed_loop_bandwidth(&self, chain: &[Section], on: &LoopOnGrid) -> Option<Event> {
        let level = BANDWIDTH_LEVEL * BANDWIDTH_LEVEL;
        let below = |i: usize| on.gain[i] < level * on.distance[i];
        let first = (0..self.points).find(|&i| below(i))?;
        Some(if first == 0 {
            self.fixed(on, 0, self.w[0] / TAU)
        } else {
            self.bandwidth_event(chain, on, first - 1, BANDWIDTH_LEVEL)
        })
    }
}

/// Where |T| first falls below -3 dB (Hz), refined on the function; the first frequency of the loop where it is below already there, none
/// where it never falls below.
pub fn closed_loop_bandwidth(l: &impl OpenLoop) -> Option<f64> {
    let trace = Trace::of(l);
    let one = Complex::new(1.0, 0.0);
    let level = |v: Complex<f64>| v.norm_sqr().ln() - (one + v).norm_sqr().ln() - 2.0 * BANDWIDTH_LEVEL.ln();
    let first = trace.value.first().map(|v| level(*v))?;
    if first < 0.0 {
        return trace.w_rad_s.first().map(|w| w / TAU);
    }
    // ln|T| changes by less than twice the trace's own stretch between two points.
    sign_changes(l, &trace, level, |_| 2.0).first().map(|w| w / TAU)
}
