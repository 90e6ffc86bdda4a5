//! Where a further resonance pair belongs: the largest structure in the residual, and a first fit of it.
//!
//! In: the ratio measured / model. Out: a pair that explains its neighbourhood.
//! Search: for each centre and damping the residual is projected on the two responses of one pole pair,
//! ln ratio ≈ (a ω² + b j w ω)/(ω² - w² + 2 j ζ w ω), the small-signal form of eq. (2). First fit: a local rational fit
//! of order 2 with relative weights and pole relocation (Sanathanan & Koerner, IEEE Trans. AC 8, 1963), then four
//! parameters and a local gain by nonlinear least squares.

use super::shape::{BodyForm, LogFit, LogProblem, Ranges, Shape};
use crate::lti::Mode;
use crate::numeric::least_squares::Qr;
use crate::numeric::levenberg::{LevenbergSettings, Workspace, minimise};
use nalgebra::Complex;

/// Pole dampings of the search; their widths overlap.
pub(super) const DAMPINGS: [f64; 4] = [0.004, 0.012, 0.035, 0.1];
/// Fewest points on each side of a centre.
const LEAST_SIDE: usize = 4;

/// A centre with what a pair there would explain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Centre {
    pub w: f64,
    pub damping: f64,
    /// Coefficients a and b.
    pub part: [f64; 2],
    /// Fall of the weighted sum of squares.
    pub gain: f64,
}

/// The best damping at one centre.
fn project(w: &[f64], log: &[Complex<f64>], weight: &[f64], centre: f64, damping: f64) -> Centre {
    let reach = (8.0 * damping).min(0.4);
    let middle = w.partition_point(|v| *v < centre);
    let from = w.partition_point(|v| *v < centre * (1.0 - reach)).min(middle.saturating_sub(LEAST_SIDE));
    let to = w.partition_point(|v| *v < centre * (1.0 + reach)).max((middle + LEAST_SIDE).min(w.len()));
    let (mut a11, mut a12, mut a22, mut b1, mut b2) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for k in from..to {
        let (re, im) = ((centre - w[k]) * (centre + w[k]), 2.0 * damping * centre * w[k]);
        let scale = centre * weight[k] / (re * re + im * im);
        // centre²/q and j w centre/q, times the weight.
        let (p_re, p_im) = (scale * centre * re, -scale * centre * im);
        let (q_re, q_im) = (scale * w[k] * im, scale * w[k] * re);
        let (y_re, y_im) = (weight[k] * log[k].re, weight[k] * log[k].im);
        a11 += p_re * p_re + p_im * p_im;
        a12 += p_re * q_re + p_im * q_im;
        a22 += q_re * q_re + q_im * q_im;
        b1 += p_re * y_re + p_im * y_im;
        b2 += q_re * y_re + q_im * y_im;
    }
    let det = a11 * a22 - a12 * a12;
    let part =
        if det > 1e-12 * a11 * a22 { [(a22 * b1 - a12 * b2) / det, (a11 * b2 - a12 * b1) / det] } else { [0.0, 0.0] };
    Centre { w: centre, damping, part, gain: part[0] * b1 + part[1] * b2 }
}

/// Up to `count` centres, best first, no two within 3 % of each other.
pub(super) fn centres(w: &[f64], log: &[Complex<f64>], weight: &[f64], count: usize) -> Vec<Centre> {
    let mut all: Vec<Centre> = Vec::with_capacity(2 * w.len());
    for k in 0..w.len() {
        let between = if k + 1 < w.len() { (w[k] * w[k + 1]).sqrt() } else { w[k] };
        all.push(project(w, log, weight, between, DAMPINGS[0]));
        // Steps of half a width or less, widths taken from the neighbours' distance.
        let spacing = w[(k + 1).min(w.len() - 1)] / w[k] - 1.0;
        for &damping in &DAMPINGS {
            let step = ((damping / spacing.max(1e-9)) as usize).clamp(1, 64);
            if k % step == 0 {
                all.push(project(w, log, weight, w[k], damping));
            }
        }
    }
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.w.total_cmp(&b.w)));
    let mut chosen: Vec<Centre> = Vec::with_capacity(count);
    for c in all {
        if chosen.iter().all(|o| (o.w / c.w).ln().abs() > 0.03) {
            chosen.push(c);
            if chosen.len() == count {
                break;
            }
        }
    }
    chosen
}

/// One pair by iterated linear least squares over a window, with a free local gain.
fn local_rational(w: &[f64], ratio: &[Complex<f64>], weight: &[f64], start: &Centre, qr: &mut Qr) -> Option<Mode> {
    let n = w.len();
    let unit = start.w;
    let (mut w0, mut damping) = (1.0, start.damping);
    let mut mode = None;
    for _ in 0..4 {
        let mut b = vec![0.0; 2 * n];
        // R (s² + d1 s + d0) = g s² + n1 s + n0 over |R D_before|.
        qr.factor(2 * n, 5, |a| {
            for k in 0..n {
                let x = w[k] / unit;
                let q = Complex::new((w0 - x) * (w0 + x), 2.0 * damping * w0 * x);
                let scale = weight[k] / (ratio[k].norm() * q.norm().max(1e-9));
                let (s, r) = (Complex::new(0.0, x), ratio[k]);
                for (c, v) in [s * s, s, Complex::new(1.0, 0.0), -r * s, -r].iter().enumerate() {
                    a[c * 2 * n + k] = scale * v.re;
                    a[c * 2 * n + n + k] = scale * v.im;
                }
                let right = r * s * s;
                (b[k], b[n + k]) = (scale * right.re, scale * right.im);
            }
        });
        let x = qr.solve(&mut b);
        let (g, n1, n0, d1, d0) = (x[0], x[1], x[2], x[3], x[4]);
        if d0 <= 0.0 || g == 0.0 || n0 / g <= 0.0 {
            break;
        }
        w0 = d0.sqrt();
        // A pole in the right half-plane is mirrored, as in vector fitting (Gustavsen & Semlyen, 1999).
        damping = (0.5 * d1 / w0).abs().clamp(1e-4, 1.0);
        let wz = (n0 / g).sqrt();
        mode = Some(Mode {
            zero_rad_s: wz * unit,
            zero_damping_ratio: 0.5 * n1 / (g * wz),
            pole_rad_s: w0 * unit,
            pole_damping_ratio: damping,
        });
    }
    mode
}

/// The pair that the projection itself suggests: q_z = q_p + a ω² + b j w ω.
fn projected(c: &Centre) -> Mode {
    let zero_rad_s = c.w * (1.0 + c.part[0]).clamp(0.5, 2.0).sqrt();
    Mode {
        zero_rad_s,
        zero_damping_ratio: (c.damping + 0.5 * c.part[1]).clamp(-0.5, 0.5),
        pole_rad_s: c.w,
        pole_damping_ratio: c.damping,
    }
}

/// Memory and settings of the local fits.
pub(super) struct Local<'a> {
    pub w: &'a [f64],
    pub ratio: &'a [Complex<f64>],
    pub weight: &'a [f64],
    pub ranges: Ranges,
}

impl Local<'_> {
    /// The best pair near a centre, with the fall of the weighted sum of squares that it brings to the points around it.
    pub fn best(
        &self,
        c: &Centre,
        work: &mut Workspace,
        qr: &mut Qr,
        evaluations: &mut (usize, usize),
    ) -> Option<(f64, Mode)> {
        let n = self.w.len();
        let middle = self.w.partition_point(|v| *v < c.w);
        let judge = window(n, middle, 20);
        let before: f64 = judge.clone().map(|k| self.ratio[k].ln().norm_sqr() * self.weight[k].powi(2)).sum();
        let mut best: Option<(f64, Mode)> = None;
        let mut starts = vec![projected(c)];
        for side in [6, 16] {
            let r = window(n, middle, side);
            starts.extend(local_rational(&self.w[r.clone()], &self.ratio[r.clone()], &self.weight[r], c, qr));
        }
        for mode in starts {
            if let Some((cost, mode)) = self.refine(judge.clone(), &mode, work, evaluations)
                && best.as_ref().is_none_or(|(c, _)| cost < *c)
            {
                best = Some((cost, mode));
            }
        }
        best.map(|(cost, m)| (before - cost, m))
    }

    /// Four parameters and a local gain over one window.
    fn refine(
        &self,
        range: std::ops::Range<usize>,
        mode: &Mode,
        work: &mut Workspace,
        evaluations: &mut (usize, usize),
    ) -> Option<(f64, Mode)> {
        let mut shape = Shape { body: BodyForm::Without, delay: false, modes: 0 };
        let mut x = vec![0.0];
        let inside = |v: f64| v.ln().clamp(self.ranges.mode.0, self.ranges.mode.1).exp();
        let inside = Mode {
            zero_rad_s: inside(mode.zero_rad_s),
            zero_damping_ratio: mode.zero_damping_ratio.max(self.ranges.zero_damping),
            pole_rad_s: inside(mode.pole_rad_s),
            ..*mode
        };
        shape.push_mode(&mut x, &inside);
        let (w, target, weight) = (&self.w[range.clone()], &self.ratio[range.clone()], &self.weight[range]);
        let fit = LogFit { shape, w, target, weight, ranges: self.ranges };
        let settings = LevenbergSettings { iterations: 12, tolerance: 1e-3 };
        let out = minimise(&mut LogProblem::new(fit), &mut x, &settings, work);
        evaluations.0 += out.jacobians;
        evaluations.1 += out.evaluations;
        out.cost.is_finite().then(|| (out.cost, shape.mode(&x, 0)))
    }
}

/// Points around `middle`, `side` on each side where the data reach.
fn window(n: usize, middle: usize, side: usize) -> std::ops::Range<usize> {
    middle.saturating_sub(side)..(middle + side).min(n)
}
