//! What a loop must offer to be judged, and the loop of a model.

use super::frequency_grid;
use crate::lti::{DiscretePlant, Sections, chain_at_each};
use nalgebra::Complex;
use thiserror::Error;

/// A loop cut at the plant input.
pub trait OpenLoop {
    /// L(e^{j w T}) at `w_rad_s` (rad/s).
    fn at(&self, w_rad_s: f64) -> Complex<f64>;
    /// The same at each of some frequencies, for loops that have a faster way to many.
    fn at_each(&self, w_rad_s: &[f64]) -> Vec<Complex<f64>> {
        w_rad_s.iter().map(|&w| self.at(w)).collect()
    }
    /// Ascending frequencies (rad/s) that no mode slips through.
    fn grid(&self) -> Vec<f64>;
    /// The frequency (rad/s) at which the loop ends: half the sample rate, or the last point of the sweep.
    fn end_rad_s(&self) -> f64;
    /// Argument of 1 + L at the first point of the grid (rad), followed from z = 1, where 1 + L with its integrators taken
    /// out is real and positive or negative.
    fn start_angle(&self, w_rad_s: f64, value: Complex<f64>) -> f64;
    /// Poles of L outside the unit circle.
    fn unstable_poles(&self) -> usize;
    /// Whether [`OpenLoop::end_rad_s`] is half the sample rate, where L is real.
    fn ends_at_half_rate(&self) -> bool;
}

/// Why a loop cannot be closed.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum FeedbackError {
    /// Plant and controller do not share a clock.
    #[error("the plant is sampled at {plant_s} s and the controller runs at {controller_s} s: one clock is expected")]
    SampleTime { plant_s: f64, controller_s: f64 },
    /// The sweep was taken through a hold of another clock.
    #[error(
        "the sweep was taken through a hold of {found_s} s and the controller runs at {expected_s} s: take the controller of that clock, or a sweep without the hold"
    )]
    Hold { found_s: f64, expected_s: f64 },
    /// The eigenvalue iteration did not end.
    #[error("the poles of the closed loop, order {order}, were not found: the eigenvalue iteration did not end")]
    Poles { order: usize },
    /// The sweep and half the sample rate leave no band to judge.
    #[error("the sweep starts at {from_hz} Hz, at or above half the sample rate, {half_rate_hz} Hz")]
    Band { from_hz: f64, half_rate_hz: f64 },
    /// Noise and interpolation cannot be told from so few points.
    #[error(
        "{found} points of the sweep lie below half the sample rate, {half_rate_hz} Hz; expected at least {expected}: sweep more points there"
    )]
    FewPoints { found: usize, half_rate_hz: f64, expected: usize },
    /// Two algorithms that share no code disagree: no answer can be trusted.
    #[error(
        "stability: the Nyquist count finds {by_count} unstable poles and the eigenvalues {by_eigenvalues} (largest |z| = {largest:.4e}): no answer is given; check the units of the gains, and for filters or modes with next to no damping"
    )]
    Disagreement { by_count: i64, by_eigenvalues: i64, largest: f64 },
    /// The loop gain has not fallen below 1 where the sweep ends: what comes after it decides on stability.
    #[error(
        "the sweep ends at {end_hz:.2} Hz, where |L| = {gain:.4}; expected |L| below 1 there, or stability cannot be judged: sweep on to higher frequencies, or check the units of the gains"
    )]
    OpenEnd { end_hz: f64, gain: f64 },
}

/// The loop of a sampled plant and the firmware's sections.
#[derive(Clone, Debug)]
pub struct ModelLoop<'a> {
    plant: &'a DiscretePlant,
    sections: &'a Sections,
}

/// A pole this close to the unit circle at z = 1 is an integrator: the rounding of 1 + a1 + a2.
const ON_ONE: f64 = 1e-10;

impl<'a> ModelLoop<'a> {
    /// Closes nothing yet: L = P C.
    pub fn new(plant: &'a DiscretePlant, sections: &'a Sections) -> Result<Self, FeedbackError> {
        let (plant_s, controller_s) = (plant.sample_time_s(), sections.sample_time_s);
        if ((plant_s - controller_s) / controller_s).abs() > 1e-12 {
            return Err(FeedbackError::SampleTime { plant_s, controller_s });
        }
        Ok(ModelLoop { plant, sections })
    }

    /// The sampled plant.
    pub fn plant(&self) -> &DiscretePlant {
        self.plant
    }

    /// The firmware's sections.
    pub fn sections(&self) -> &Sections {
        self.sections
    }
}

/// Poles of the sections on z = 1 and outside the unit circle.
pub(super) fn section_poles(sections: &Sections) -> (usize, usize) {
    let mut counts = (0, 0);
    for pole in sections.chain.iter().flat_map(|s| s.poles()) {
        if (pole - 1.0).norm() < ON_ONE {
            counts.0 += 1;
        } else if pole.norm() > 1.0 {
            counts.1 += 1;
        }
    }
    counts
}

/// The argument of 1 + L near z = 1, `turn` = w T, where L has `integrators` poles on z = 1.
///
/// F = (1 + L)(1 - 1/z)^m is real at z = 1, so near it F has hardly left the nearer half of the real axis.
pub fn angle_from_rest(turn: f64, value: Complex<f64>, integrators: usize) -> f64 {
    let m = integrators as i32;
    let step = Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -turn);
    let f = (Complex::new(1.0, 0.0) + value) * step.powi(m);
    let snapped = if f.re >= 0.0 { f.arg() } else { (-f).arg() };
    snapped - f64::from(m) * step.arg()
}

impl OpenLoop for ModelLoop<'_> {
    fn at(&self, w: f64) -> Complex<f64> {
        let z = Complex::from_polar(1.0, w * self.sections.sample_time_s);
        self.plant.at_z(z) * self.sections.at_delay(z.conj())
    }

    fn at_each(&self, w: &[f64]) -> Vec<Complex<f64>> {
        let z: Vec<_> = w.iter().map(|w| Complex::from_polar(1.0, w * self.sections.sample_time_s)).collect();
        let back: Vec<_> = z.iter().map(|z| z.conj()).collect();
        let mut all = self.plant.at_each(&z);
        all.iter_mut().zip(chain_at_each(&self.sections.chain, &back)).for_each(|(p, c)| *p *= c);
        all
    }

    fn grid(&self) -> Vec<f64> {
        frequency_grid(self.plant.terms(), self.sections)
    }

    fn end_rad_s(&self) -> f64 {
        std::f64::consts::PI / self.sections.sample_time_s
    }

    fn start_angle(&self, w: f64, value: Complex<f64>) -> f64 {
        angle_from_rest(
            w * self.sections.sample_time_s,
            value,
            self.plant.integrators() + section_poles(self.sections).0,
        )
    }

    fn unstable_poles(&self) -> usize {
        self.plant.unstable_poles() + section_poles(self.sections).1
    }

    fn ends_at_half_rate(&self) -> bool {
        true
    }
}
