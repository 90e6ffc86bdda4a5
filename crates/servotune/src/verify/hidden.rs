//! What a mode between two points of a sweep could still do, given what its neighbours would have shown.
//!
//! Assumed: around any interval the response is a cubic in ln w plus at most one mode r/(sigma + j (w - w0)) with a damping ratio of at least
//! the least one. Eight points cannot be a cubic and the mode at once, so what the cubic leaves over bounds r, and r bounds the
//! error of the interpolation (`specs/certificate.md`).

use nalgebra::Complex;

/// Points around an interval, and coefficients of the cubic.
const AROUND: usize = 8;
const CUBIC: usize = 4;
/// The places and widths of a mode are tried on a lattice; between them the ratio moves by less than this.
const BETWEEN: f64 = 1.25;
/// Deviations of the noise that are allowed for.
const SIGMAS: f64 = 4.0;

/// One interval of a sweep.
#[derive(Clone, Debug)]
pub(super) struct Gap {
    /// Cubic through the four nearest points in u = w less the first point's, Newton form in absolute w.
    pub knots: [f64; CUBIC],
    pub newton: [Complex<f64>; CUBIC],
    /// Bound of |P - cubic| between the two points.
    pub error: f64,
}

/// The interval from point `i` to the next. `std` is the absolute deviation of one value there.
pub(super) fn gap(w: &[f64], p: &[Complex<f64>], i: usize, least_damping: f64, std: f64) -> Gap {
    let n = w.len();
    let first = i.saturating_sub(AROUND / 2 - 1).min(n - AROUND);
    let (w8, p8) = (&w[first..first + AROUND], &p[first..first + AROUND]);
    let inner = i.saturating_sub(1).min(n - CUBIC);
    let mut knots = [0.0; CUBIC];
    let mut newton = [Complex::new(0.0, 0.0); CUBIC];
    knots.copy_from_slice(&w[inner..inner + CUBIC]);
    newton.copy_from_slice(&p[inner..inner + CUBIC]);
    divided(&knots, &mut newton);
    let basis = cubics(w8);
    let left = norm(&over(&basis, p8));
    let (low, high) = (w[i], w[i + 1]);
    let step = high - low;
    let sigma = least_damping * low;
    let mut worst = 0.0f64;
    let mut width = sigma;
    loop {
        for place in -6..=14 {
            let w0 = low + step * f64::from(place) / 8.0;
            let mode = |x: f64| width / Complex::new(width, x - w0);
            let seen = norm(&over(&basis, &w8.iter().map(|x| mode(*x)).collect::<Vec<_>>()));
            let mut line = knots.map(mode);
            divided(&knots, &mut line);
            let off = |x: f64| (mode(x) - horner(&knots, &line, x)).norm();
            let at = [0.125, 0.3, 0.5, 0.7, 0.875].map(|s| off(low + s * step));
            let most = at.iter().fold(off(w0.clamp(low, high)), |m, x| m.max(*x));
            worst = worst.max(most / seen.max(f64::MIN_POSITIVE));
        }
        width *= 2.0;
        if width > 2.0 * step.max(sigma) {
            break;
        }
    }
    // Noise moves what is left over, and the four values of the cubic (whose weights sum to at most 1.25 in the middle).
    let noise = SIGMAS * std;
    Gap { knots, newton, error: BETWEEN * worst * (left + noise * ((AROUND - CUBIC) as f64).sqrt()) + 1.25 * noise }
}

/// Values into divided differences.
fn divided(knots: &[f64; CUBIC], values: &mut [Complex<f64>; CUBIC]) {
    for level in 1..CUBIC {
        for k in (level..CUBIC).rev() {
            values[k] = (values[k] - values[k - 1]) / (knots[k] - knots[k - level]);
        }
    }
}

fn horner(knots: &[f64; CUBIC], newton: &[Complex<f64>; CUBIC], x: f64) -> Complex<f64> {
    (0..CUBIC - 1).rev().fold(newton[CUBIC - 1], |s, k| s * (x - knots[k]) + newton[k])
}

impl Gap {
    /// Value, first derivative, and bound of the second over x ± half.
    pub fn at(&self, x: f64, half: f64) -> (Complex<f64>, Complex<f64>, f64) {
        let (mut value, mut first, mut second) =
            (self.newton[CUBIC - 1], Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        for k in (0..CUBIC - 1).rev() {
            let d = x - self.knots[k];
            second = second * d + 2.0 * first;
            first = first * d + value;
            value = value * d + self.newton[k];
        }
        (value, first, second.norm() + half * 6.0 * self.newton[CUBIC - 1].norm())
    }
}

/// Orthonormal cubics in ln w over the points (Gram and Schmidt, twice for the digits).
fn cubics(w: &[f64]) -> Vec<Vec<f64>> {
    let middle = w[w.len() / 2].ln();
    let scale = (w[w.len() - 1] / w[0]).ln();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for power in 0..CUBIC {
        let mut v: Vec<f64> = w.iter().map(|w| ((w.ln() - middle) / scale).powi(power as i32)).collect();
        for _ in 0..2 {
            for b in &basis {
                let dot: f64 = v.iter().zip(b).map(|(x, y)| x * y).sum();
                v.iter_mut().zip(b).for_each(|(x, y)| *x -= dot * y);
            }
        }
        let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.iter_mut().for_each(|x| *x /= size);
        basis.push(v);
    }
    basis
}

/// What the cubics leave over.
fn over(basis: &[Vec<f64>], p: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let mut v = p.to_vec();
    for b in basis {
        let dot: Complex<f64> = v.iter().zip(b).map(|(x, y)| x * *y).sum();
        v.iter_mut().zip(b).for_each(|(x, y)| *x -= dot * *y);
    }
    v
}

fn norm(v: &[Complex<f64>]) -> f64 {
    v.iter().map(|x| x.norm_sqr()).sum::<f64>().sqrt()
}
