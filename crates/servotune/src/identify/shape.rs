//! Parameters of the joint fit, and the residual with its Jacobian.
//!
//! θ = [ln K, body, delay, then per pair: ln ωz, ζz, ln ωp, ln ζp]; body = [ln ω0, ln ζ0] or [viscous rate].
//! K is the acceleration gain (dc_gain ω0² resonance_gain), which the sweep's upper part fixes by itself.
//! Residual: ln(measured / model), real part (log magnitude) and imaginary part (phase), over the standard deviation.

use crate::lti::{Body, Mode, Plant};
use crate::numeric::levenberg::{Limit, Residuals};
use nalgebra::Complex;

/// Which rigid body the parameters describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyForm {
    /// None: the target is already divided by it.
    Without,
    SecondOrder,
    FreeInertia,
}

/// Layout of θ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub body: BodyForm,
    pub delay: bool,
    pub modes: usize,
}

impl Shape {
    pub fn body_parameters(self) -> usize {
        match self.body {
            BodyForm::Without => 0,
            BodyForm::SecondOrder => 2,
            BodyForm::FreeInertia => 1,
        }
    }

    /// Index of the delay, where there is one.
    pub fn delay_at(self) -> usize {
        1 + self.body_parameters()
    }

    /// Index of the first parameter of pair `m`.
    pub fn mode_at(self, m: usize) -> usize {
        1 + self.body_parameters() + usize::from(self.delay) + 4 * m
    }

    pub fn parameters(self) -> usize {
        self.mode_at(self.modes)
    }

    pub fn mode(self, x: &[f64], m: usize) -> Mode {
        let i = self.mode_at(m);
        Mode {
            zero_rad_s: x[i].exp(),
            zero_damping_ratio: x[i + 1],
            pole_rad_s: x[i + 2].exp(),
            pole_damping_ratio: x[i + 3].exp(),
        }
    }

    pub fn push_mode(&mut self, x: &mut Vec<f64>, mode: &Mode) {
        x.extend([mode.zero_rad_s.ln(), mode.zero_damping_ratio, mode.pole_rad_s.ln(), mode.pole_damping_ratio.ln()]);
        self.modes += 1;
    }

    /// θ of a plant; the resonance gain goes into K.
    pub fn of(plant: &Plant) -> (Shape, Vec<f64>) {
        let gain = (plant.body.acceleration_gain() * plant.resonance_gain).abs().ln();
        let mut x = vec![gain];
        let body = match plant.body {
            Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } => {
                x.extend([natural_frequency_rad_s.ln(), damping_ratio.ln()]);
                BodyForm::SecondOrder
            }
            Body::FreeInertia { viscous_rate_per_s, .. } => {
                x.push(viscous_rate_per_s);
                BodyForm::FreeInertia
            }
            // No fit has this form: what starts from neighbours leaves such plants out.
            Body::Rational(_) => BodyForm::Without,
        };
        x.push(plant.delay_s);
        let mut shape = Shape { body, delay: true, modes: 0 };
        for m in &plant.modes {
            shape.push_mode(&mut x, m);
        }
        (shape, x)
    }

    /// The plant of θ with the sign of its gain. The resonance gain is 1: only its product with the body's gain is seen.
    pub fn plant(self, x: &[f64], sign: f64, position_unit: &str, command_unit: &str) -> Plant {
        let gain = sign * x[0].exp();
        let body = match self.body {
            BodyForm::SecondOrder | BodyForm::Without => {
                let w0 = x[1].exp();
                Body::SecondOrder { dc_gain: gain / (w0 * w0), natural_frequency_rad_s: w0, damping_ratio: x[2].exp() }
                    .on_a_spring()
            }
            BodyForm::FreeInertia => Body::FreeInertia { acceleration_gain: gain, viscous_rate_per_s: x[1] },
        };
        Plant {
            position_unit: position_unit.into(),
            command_unit: command_unit.into(),
            body,
            delay_s: x[self.delay_at()],
            resonance_gain: 1.0,
            modes: (0..self.modes).map(|m| self.mode(x, m)).collect(),
            physics: vec![],
        }
    }
}

/// Ranges that keep a fit in the neighbourhood of its data.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ranges {
    /// ln of the lowest and highest frequency of a pole or zero.
    pub mode: (f64, f64),
    /// ln of the lowest and highest natural frequency of the body.
    pub body: (f64, f64),
    /// Longest delay (s).
    pub delay: f64,
    /// Smallest zero damping.
    pub zero_damping: f64,
}

/// Least pole damping: far below any mechanical one, and stable.
const LEAST_DAMPING: f64 = 1e-5;

/// ln(target / model) over the standard deviation, as a least-squares problem.
pub(super) struct LogFit<'a> {
    pub shape: Shape,
    pub w: &'a [f64],
    pub target: &'a [Complex<f64>],
    /// One over the standard deviation of each point.
    pub weight: &'a [f64],
    pub ranges: Ranges,
}

#[inline]
fn quadratic(w0: f64, damping: f64, w: f64) -> Complex<f64> {
    Complex::new((w0 - w) * (w0 + w), 2.0 * damping * w0 * w)
}

impl LogFit<'_> {
    /// target / model at every point.
    pub fn ratio(&self, x: &[f64], out: &mut Vec<Complex<f64>>) {
        let gain = (-x[0]).exp();
        out.clear();
        out.extend(self.target.iter().map(|t| t * gain));
        match self.shape.body {
            BodyForm::Without => {}
            BodyForm::SecondOrder => {
                let (w0, damping) = (x[1].exp(), x[2].exp());
                out.iter_mut().zip(self.w).for_each(|(o, &w)| *o *= quadratic(w0, damping, w));
            }
            BodyForm::FreeInertia => {
                let rate = x[1];
                out.iter_mut().zip(self.w).for_each(|(o, &w)| *o *= Complex::new(-w * w, rate * w));
            }
        }
        if self.shape.delay {
            let delay = x[self.shape.delay_at()];
            out.iter_mut().zip(self.w).for_each(|(o, &w)| *o *= Complex::from_polar(1.0, w * delay));
        }
        for m in 0..self.shape.modes {
            let mode = self.shape.mode(x, m);
            for (o, &w) in out.iter_mut().zip(self.w) {
                let top = quadratic(mode.pole_rad_s, mode.pole_damping_ratio, w);
                let bottom = quadratic(mode.zero_rad_s, mode.zero_damping_ratio, w);
                // o * top / bottom without the guarded complex division, which costs a third of the time.
                *o *= top * bottom.conj() * (1.0 / bottom.norm_sqr());
            }
        }
    }
}

/// The problem with its own memory for the ratio.
pub(super) struct LogProblem<'a> {
    pub fit: LogFit<'a>,
    pub ratio: Vec<Complex<f64>>,
}

impl<'a> LogProblem<'a> {
    pub fn new(fit: LogFit<'a>) -> Self {
        LogProblem { fit, ratio: Vec::new() }
    }
}

/// Writes one column: d residual = -weight * d ln(model), real parts first.
#[inline]
fn column(out: &mut [f64], weight: &[f64], mut derivative: impl FnMut(usize) -> Complex<f64>) {
    let (re, im) = out.split_at_mut(weight.len());
    for (k, wt) in weight.iter().enumerate() {
        let d = derivative(k);
        re[k] = -wt * d.re;
        im[k] = -wt * d.im;
    }
}

/// Two columns at once: d ln q / d ln ω0 and d ln q / d ζ of q = ω0² - w² + 2 j ζ ω0 w, times `sign` and `chain` on the second.
fn quadratic_columns(out: &mut [f64], weight: &[f64], w: &[f64], w0: f64, damping: f64, sign: f64, chain: f64) {
    let n = w.len();
    let (first, second) = out.split_at_mut(2 * n);
    let (first_re, first_im) = first.split_at_mut(n);
    let (second_re, second_im) = second.split_at_mut(n);
    for k in 0..n {
        let (a, b) = ((w0 - w[k]) * (w0 + w[k]), 2.0 * damping * w0 * w[k]);
        let scale = -sign * weight[k] / (a * a + b * b);
        let (top_re, top_im) = (2.0 * w0 * w0, b);
        first_re[k] = scale * (top_re * a + top_im * b);
        first_im[k] = scale * (top_im * a - top_re * b);
        let by_damping = 2.0 * w0 * w[k] * chain;
        second_re[k] = scale * by_damping * b;
        second_im[k] = scale * by_damping * a;
    }
}

impl Residuals for LogProblem<'_> {
    fn rows(&self) -> usize {
        2 * self.fit.w.len()
    }

    fn cols(&self) -> usize {
        self.fit.shape.parameters()
    }

    fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
        self.fit.ratio(x, &mut self.ratio);
        let (re, im) = r.split_at_mut(self.fit.w.len());
        for (k, z) in self.ratio.iter().enumerate() {
            let weight = self.fit.weight[k];
            re[k] = weight * 0.5 * z.norm_sqr().ln();
            im[k] = weight * z.im.atan2(z.re);
        }
    }

    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
        let LogFit { shape, w, weight, .. } = self.fit;
        let rows = 2 * w.len();
        let at = |i: usize| i * rows;
        column(&mut j[..rows], weight, |_| Complex::new(1.0, 0.0));
        match shape.body {
            BodyForm::Without => {}
            BodyForm::SecondOrder => {
                let (w0, damping) = (x[1].exp(), x[2].exp());
                quadratic_columns(&mut j[at(1)..at(3)], weight, w, w0, damping, -1.0, damping);
            }
            BodyForm::FreeInertia => {
                let rate = x[1];
                column(&mut j[at(1)..at(2)], weight, |k| -Complex::new(0.0, 1.0) / Complex::new(-w[k], rate));
            }
        }
        if shape.delay {
            let i = shape.delay_at();
            column(&mut j[at(i)..at(i + 1)], weight, |k| Complex::new(0.0, -w[k]));
        }
        for m in 0..shape.modes {
            let i = shape.mode_at(m);
            let mode = shape.mode(x, m);
            let zero = &mut j[at(i)..at(i + 2)];
            quadratic_columns(zero, weight, w, mode.zero_rad_s, mode.zero_damping_ratio, 1.0, 1.0);
            let (w0, damping) = (mode.pole_rad_s, mode.pole_damping_ratio);
            quadratic_columns(&mut j[at(i + 2)..at(i + 4)], weight, w, w0, damping, -1.0, damping);
        }
    }

    fn limit(&self, i: usize) -> Limit {
        let Ranges { mode, body, delay, zero_damping } = self.fit.ranges;
        let shape = self.fit.shape;
        if i == 0 {
            return Limit { low: -1e3, high: 1e3, step: 1.0 };
        }
        if i < shape.delay_at() {
            return match (shape.body, i) {
                (BodyForm::FreeInertia, _) => Limit { low: 0.0, high: body.1.exp(), step: f64::INFINITY },
                (_, 1) => Limit { low: body.0, high: body.1, step: 0.3 },
                _ => Limit { low: LEAST_DAMPING.ln(), high: 20f64.ln(), step: 1.0 },
            };
        }
        if shape.delay && i == shape.delay_at() {
            return Limit { low: 0.0, high: delay, step: f64::INFINITY };
        }
        match (i - shape.mode_at(0)) % 4 {
            0 | 2 => Limit { low: mode.0, high: mode.1, step: 0.05 },
            1 => Limit { low: zero_damping, high: 2.0, step: 0.1 },
            _ => Limit { low: LEAST_DAMPING.ln(), high: 2f64.ln(), step: 1.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jacobian_agrees_with_central_differences() {
        let w: Vec<f64> = (0..40).map(|i| 200.0 * 1.12f64.powi(i)).collect();
        let target = vec![Complex::new(1.0, 0.5); w.len()];
        let weight: Vec<f64> = (0..w.len()).map(|i| 1.0 + 0.1 * i as f64).collect();
        let ranges = Ranges { mode: (0.0, 20.0), body: (0.0, 20.0), delay: 1.0, zero_damping: -1.0 };
        for (body, start) in [
            (BodyForm::SecondOrder, vec![16.0, 6.0, -1.5, 65e-6]),
            (BodyForm::FreeInertia, vec![16.0, 40.0, 65e-6]),
            (BodyForm::Without, vec![0.3, 65e-6]),
        ] {
            let mut shape = Shape { body, delay: true, modes: 0 };
            let mut x = start;
            for z in [0.03, -0.02] {
                let mode =
                    Mode { zero_rad_s: 7400.0, zero_damping_ratio: z, pole_rad_s: 7600.0, pole_damping_ratio: 0.04 };
                shape.push_mode(&mut x, &mode);
            }
            let fit = LogFit { shape, w: &w, target: &target, weight: &weight, ranges };
            let mut problem = LogProblem::new(fit);
            let (rows, cols) = (problem.rows(), problem.cols());
            let mut j = vec![0.0; rows * cols];
            problem.jacobian(&x, &mut j);
            let (mut up, mut down) = (vec![0.0; rows], vec![0.0; rows]);
            for c in 0..cols {
                let h = 1e-6 * x[c].abs().max(1e-3);
                let keep = x[c];
                x[c] = keep + h;
                problem.evaluate(&x, &mut up);
                x[c] = keep - h;
                problem.evaluate(&x, &mut down);
                x[c] = keep;
                let size = j[c * rows..(c + 1) * rows].iter().fold(0.0f64, |m, v| m.max(v.abs()));
                for r in 0..rows {
                    let slope = (up[r] - down[r]) / (2.0 * h);
                    // Truncation h² third derivatives plus rounding 1e-16 / h: six digits at the narrowest zero.
                    assert!((slope - j[c * rows + r]).abs() < 2e-5 * size, "{body:?} {c} {r}");
                }
            }
        }
    }
}
