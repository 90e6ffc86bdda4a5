//! A circle outside the unit circle, and what the write puts on it: the law, the inputs and the window's bins.
//!
//! In: sections, profile, the radius e^{right T}. Out: values at the points of the upper half, z = e^{sT}, s = right + j w. The sum over the points is
//! the contour integral up to what has turned round once, which [`Contour::wrapped`] bounds (`specs/certificate.md`).

use super::moves::size;
use super::write::{draws, forward, reference};
use super::write_record::Clock;
use crate::controller::Controller;
use crate::lti::Section;
use crate::numeric::spectrum;
use crate::pes::Profile;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Values on the circle.
pub(super) struct Contour {
    /// Points of the whole circle.
    pub points: usize,
    /// Sample time (s).
    pub t: f64,
    /// Re s (rad/s).
    pub right: f64,
    /// From angle 0 to pi, both included.
    pub s: Vec<Complex<f64>>,
    /// C(z).
    pub law: Vec<Complex<f64>>,
    /// What enters at the plant's input with the loop open: C (reference - encoder noise) + feed-forward + windage.
    pub inputs: Vec<Complex<f64>>,
    /// Σ e^{∓2 pi i k n/N} e^{s t_n} over the window, for each bin asked for.
    pub kernels: Vec<[Vec<Complex<f64>>; 2]>,
    /// Sum of the sizes of both kernels of each bin.
    pub sizes: Vec<Vec<f64>>,
    /// Σ |e^{s t_n}|: no kernel is larger, at any alias.
    pub kernel_most: f64,
}

/// What enters a loop, a number a controller sample; the reference stays at its last.
pub(super) struct Entering<'a> {
    pub sections: &'a [Section],
    /// Sample time (s).
    pub t: f64,
    pub reference: Vec<f64>,
    pub encoder: Vec<f64>,
    /// Feed-forward and windage.
    pub added: Vec<f64>,
}

/// The write as numbers that the circle is laid through.
pub(super) struct Task<'a> {
    pub c: &'a Controller,
    pub profile: &'a Profile,
    pub clock: Clock,
    pub entering: Entering<'a>,
}

/// Instants of a window: its first (s), their number, their rate (Hz).
#[derive(Clone, Copy)]
pub(super) struct Window {
    first_s: f64,
    n: usize,
    rate: f64,
}

impl Window {
    /// No instant: for what is asked at the controller's samples only.
    pub const NONE: Window = Window { first_s: 0.0, n: 0, rate: 1.0 };

    /// The instants (s).
    pub fn instants(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.n).map(|j| self.first_s + j as f64 / self.rate)
    }

    /// Σ e^{-2 pi i k n/N} e^{s t_n}.
    pub fn kernel(&self, s: Complex<f64>, bin: f64) -> Complex<f64> {
        let step = s / self.rate - Complex::new(0.0, TAU * bin / self.n as f64);
        // A geometric sum; where the ratio is next to 1 the quotient loses digits and the sum is written out.
        let ratio = step.exp();
        let sum = if (ratio - 1.0).norm_sqr() > 1e-8 {
            ((step * self.n as f64).exp() - 1.0) / (ratio - 1.0)
        } else {
            (0..self.n).map(|i| (step * i as f64).exp()).sum()
        };
        sum * (s * self.first_s).exp()
    }
}

impl<'a> Task<'a> {
    pub fn of(c: &'a Controller, sections: &'a [Section], profile: &'a Profile) -> Task<'a> {
        let (clock, t) = (Clock::of(c, profile), c.sample_time_s);
        let (encoder, windage) = draws(profile, t, clock.ticks);
        // Until the reference rests; afterwards it is a constant.
        let s = &profile.spiral;
        let travel = s.distance / s.velocity.abs() + 2.0 * s.acceleration_time_s;
        let rests = ((s.start_s + travel) / t).ceil() as usize + 3;
        let all = rests.max(clock.ticks);
        let reference: Vec<f64> = (0..all).map(|k| reference(profile, k as f64 * t)).collect();
        let added = (0..all).map(|k| forward(c, profile, k) + windage.get(k).copied().unwrap_or_default()).collect();
        Task { c, profile, clock, entering: Entering { sections, t, reference, encoder, added } }
    }

    /// The window as its kernels see it.
    pub fn window(&self) -> Window {
        let ([first, last], rate) = (self.clock.window, self.profile.pes.sample_rate_hz);
        Window { first_s: first as f64 / rate, n: last - first, rate }
    }
}

impl Entering<'_> {
    /// Bound of the reference's transform anywhere on Re s = `right`.
    pub fn moved(&self, right: f64) -> f64 {
        self.reference.iter().fold(0.0f64, |m, x| m.max(x.abs())) / (1.0 - (-right * self.t).exp())
    }

    /// Bound of what is added to the command.
    pub fn pushed(&self) -> f64 {
        self.added.iter().map(|x| x.abs()).sum()
    }

    /// Bound of |what enters| anywhere on Re s = `right`.
    pub fn most(&self, right: f64) -> f64 {
        let back = (-right * self.t).exp();
        let law: f64 = self
            .sections
            .iter()
            .map(|s| {
                let below: f64 = s.poles().iter().map(|p| 1.0 - p.norm().min(1.0) * back).product();
                (s.b0.abs() + s.b1.abs() * back + s.b2.abs() * back * back) / below
            })
            .product();
        law * (self.moved(right) + self.encoder.iter().map(|x| x.abs()).sum::<f64>()) + self.pushed()
    }
}

impl Contour {
    pub fn of(e: &Entering<'_>, window: &Window, points: usize, right: f64, bins: &[usize]) -> Contour {
        let t = e.t;
        let s: Vec<Complex<f64>> =
            (0..=points / 2).map(|i| Complex::new(right, TAU * i as f64 / points as f64 / t)).collect();
        let back: Vec<Complex<f64>> = s.iter().map(|s| (s * -t).exp()).collect();
        // Longer than the circle, a record wraps: at its points z^points is one number.
        let on = |x: &[f64], rest: f64| {
            let mut folded = vec![0.0; points];
            for (k, x) in x.iter().enumerate() {
                folded[k % points] += x * (-right * t * k as f64).exp();
            }
            let mut z = spectrum::forward(&folded);
            z.truncate(points / 2 + 1);
            for (z, back) in z.iter_mut().zip(&back) {
                *z += rest * back.powu(x.len() as u32) / (1.0 - back);
            }
            z
        };
        let law: Vec<Complex<f64>> = back.iter().map(|b| e.sections.iter().map(|s| s.at_delay(*b)).product()).collect();
        let reference = on(&e.reference, e.reference.last().copied().unwrap_or_default());
        let (encoder, added) = (on(&e.encoder, 0.0), on(&e.added, 0.0));
        let inputs = (0..s.len()).map(|i| law[i] * (reference[i] - encoder[i]) + added[i]).collect();
        let kernel = |bin: f64| -> Vec<Complex<f64>> { s.iter().map(|s| window.kernel(*s, bin)).collect() };
        let kernels: Vec<[Vec<Complex<f64>>; 2]> =
            bins.iter().map(|k| [kernel(*k as f64), kernel(-(*k as f64))]).collect();
        let sizes = kernels.iter().map(|[a, b]| a.iter().zip(b).map(|(a, b)| size(*a) + size(*b)).collect()).collect();
        let kernel_most = window.instants().map(|at| (right * at).exp()).sum();
        Contour { points, t, right, s, law, inputs, kernels, sizes, kernel_most }
    }

    /// The first `n` samples of what has these values on the upper half, its ends halved.
    pub fn samples(&self, half: &[Complex<f64>], n: usize) -> Vec<f64> {
        let mut whole = vec![Complex::new(0.0, 0.0); self.points];
        for (i, x) in half.iter().enumerate() {
            // Both halves of the circle; the ends, halved before, meet themselves.
            whole[i] += x;
            whole[(self.points - i) % self.points] += x.conj();
        }
        spectrum::backward(&mut whole);
        (0..n).map(|k| whole[k % self.points].re * (self.right * self.t * k as f64).exp()).collect()
    }

    /// Points and Re s of a circle on which a sum is worth an integral: what has turned round is below `enough` (window, command)
    /// where `rough` bounds both on a line of given Re s. None where no circle of bearable size does.
    ///
    /// `t`: sample time; `end`: the last instant asked for (s).
    pub fn wrapped(t: f64, end: f64, rough: &dyn Fn(f64) -> [f64; 2], enough: [f64; 2]) -> Option<(usize, f64)> {
        let fits = |points: usize| {
            (4..100).map(|i| 2.0 * f64::from(i) / (t * points as f64)).find(|right| {
                let turned = (-0.875 * right * t * points as f64).exp();
                rough(right / 8.0).iter().zip(enough).all(|(r, e)| r * turned / (1.0 - turned) <= e)
            })
        };
        let all: Vec<(usize, f64)> = (12..18).filter_map(|k| fits(1 << k).map(|right| (1 << k, right))).collect();
        all.iter().find(|(_, right)| right * end <= SWELL).or(all.last()).copied()
    }
}

/// Most that the circle may favour the end of the record over its beginning: ln.
const SWELL: f64 = 1.2;
