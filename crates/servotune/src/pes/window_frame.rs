//! What a window sees of every line of the there-and-back spectrum, whatever the machine and the gains: the Dirichlet kernels.
//!
//! In: lines, clock, window, bins. Out: [`WindowFrame`]. A fleet asks for the same one for every slot: the last one is kept and handed out
//! again. It is a pure function of its key.
//!
//! The mean of exp(j a i) over n samples is (e^{j n a} - 1)/n · 1/(e^{j a} - 1), and 1/(e^{j a} - 1) = -1/2 - (j/2) cot(a/2). With a = line - bin the
//! first factor is the line's own, whichever the bin: it is folded into the line. What is left for a pair of line and bin is real: half the sum and
//! half the difference of the cotangents of the line and of its mirror image. So a bin costs two real products a line instead of four.

use nalgebra::Complex;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

/// Numbers handled side by side: a line of the processor's cache.
pub(super) const LANES: usize = 8;

/// Everything that the kernels depend on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameKey {
    /// Lines (rad/s).
    pub w_rad_s: Vec<f64>,
    /// Servo rate (Hz).
    pub rate_hz: f64,
    /// Samples of the window.
    pub samples: usize,
    /// Time of its first sample (s).
    pub from_s: f64,
    /// Bins that are read.
    pub bins: Vec<usize>,
    /// Distance between lines, both signs counted once (Hz).
    pub spacing_hz: f64,
}

/// Kernels of every bin on every line. Arrays over lines are filled up with zeros to whole lanes.
#[derive(Debug)]
pub(super) struct WindowFrame {
    key: FrameKey,
    /// What is folded into a line: turned to the window's start, times (e^{j n a} - 1)/n.
    pub fold: [Vec<f64>; 2],
    /// Its square times the spacing: what is folded into a noise density.
    pub fold_power: Vec<f64>,
    /// For every bin, half the sum and half the difference of the two cotangents on every line.
    pub sum: Vec<Vec<f64>>,
    /// The difference; see [`WindowFrame::sum`].
    pub difference: Vec<Vec<f64>>,
    /// Lines next to a bin, where folding would lose digits.
    pub touching: Vec<Touching>,
}

/// A line so near to a bin that its kernel is given as it is; the cotangent in the arrays is 0 there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touching {
    /// Index of the bin and of the line.
    pub bin: usize,
    /// The line.
    pub line: usize,
    /// What is to be added for the line z, or for conj(z) where it is the mirror image that touches.
    pub weight: Complex<f64>,
    /// Whether the mirror image touches.
    pub mirror: bool,
    /// What is to be added of the line's noise density.
    pub leak: f64,
}

/// The frame asked for last. A lock that another thread left poisoned holds a whole frame or none.
static LAST: Mutex<Option<Arc<WindowFrame>>> = Mutex::new(None);

/// The frame of a key.
pub(super) fn frame(key: FrameKey) -> Arc<WindowFrame> {
    {
        let last = LAST.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(frame) = last.as_ref().filter(|f| f.key == key) {
            return Arc::clone(frame);
        }
    }
    let frame = Arc::new(WindowFrame::of(key));
    *LAST.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(Arc::clone(&frame));
    frame
}

impl WindowFrame {
    /// Lines, filled up to whole lanes.
    pub fn width(&self) -> usize {
        self.fold_power.len()
    }

    fn of(key: FrameKey) -> WindowFrame {
        let (n, lines) = (key.samples, key.w_rad_s.len());
        let width = lines.next_multiple_of(LANES);
        let angle = |w: f64| w / key.rate_hz;
        let turn: Vec<Complex<f64>> = key.w_rad_s.iter().map(|w| Complex::from_polar(1.0, w * key.from_s)).collect();
        // e^{jx} - 1 = 2j sin(x/2) e^{jx/2}
        let end = |w: f64| {
            let half = 0.5 * angle(w) * n as f64;
            Complex::from_polar(2.0 * half.sin() / n as f64, half) * Complex::i()
        };
        let fold: Vec<Complex<f64>> = key.w_rad_s.iter().zip(&turn).map(|(w, t)| t * end(*w)).collect();
        let padded = |x: Vec<f64>| -> Vec<f64> { x.into_iter().chain([0.0; LANES]).take(width).collect() };
        let (mut sum, mut difference, mut touching) = (Vec::new(), Vec::new(), Vec::new());
        for (bin, &k) in key.bins.iter().enumerate() {
            let at = TAU * k as f64 / n as f64;
            let (mut sums, mut differences) = (Vec::with_capacity(width), Vec::with_capacity(width));
            for (line, &w) in key.w_rad_s.iter().enumerate() {
                let mut side = |a: f64, mirror: bool| {
                    if let Some(c) = cotangent(a, n) {
                        return c;
                    }
                    let (t, f) = if mirror { (turn[line].conj(), fold[line].conj()) } else { (turn[line], fold[line]) };
                    let kernel = kernel(if mirror { -a } else { a }, n);
                    // The arrays give -1/2 of the fold, with no cotangent.
                    let leak = (kernel.norm_sqr() - 0.25 * fold[line].norm_sqr()) * key.spacing_hz;
                    touching.push(Touching { bin, line, weight: t * kernel + 0.5 * f, mirror, leak });
                    0.0
                };
                let (own, image) = (side(angle(w) - at, false), side(angle(w) + at, true));
                sums.push(0.5 * (own + image));
                differences.push(0.5 * (own - image));
            }
            sum.push(padded(sums));
            difference.push(padded(differences));
        }
        WindowFrame {
            fold: [padded(fold.iter().map(|f| f.re).collect()), padded(fold.iter().map(|f| f.im).collect())],
            fold_power: padded(fold.iter().map(|f| f.norm_sqr() * key.spacing_hz).collect()),
            sum,
            difference,
            touching,
            key,
        }
    }
}

/// Half turns over the window below which a line touches a bin: beyond, folding costs at most a thousandfold of rounding.
const NEAR: f64 = 1e-3;

/// cot(a/2); none where the angle is next to a whole turn.
fn cotangent(a: f64, n: usize) -> Option<f64> {
    let (sin, cos) = (0.5 * a).sin_cos();
    (sin.abs() * n as f64 > NEAR).then(|| cos / sin)
}

/// Mean of exp(j angle i) over i = 0..n.
pub(super) fn kernel(angle: f64, n: usize) -> Complex<f64> {
    let half = 0.5 * angle;
    let n = n as f64;
    let size =
        if half.sin().abs() < 1e-12 { (n * half).cos() / half.cos() } else { (n * half).sin() / (n * half.sin()) };
    Complex::from_polar(1.0, (n - 1.0) * half) * size
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the frame says of one line in one bin, for a line z: X, and the share of the density.
    fn seen(frame: &WindowFrame, bin: usize, line: usize, z: Complex<f64>) -> (Complex<f64>, f64) {
        let g = z * Complex::new(frame.fold[0][line], frame.fold[1][line]);
        let (sum, difference) = (frame.sum[bin][line], frame.difference[bin][line]);
        let mut x = Complex::new(g.im * sum - g.re, -g.re * difference);
        let mut leak = frame.fold_power[line] * 0.5 * (1.0 + sum * sum + difference * difference);
        for t in frame.touching.iter().filter(|t| (t.bin, t.line) == (bin, line)) {
            x += t.weight * if t.mirror { z.conj() } else { z };
            leak += t.leak;
        }
        (x, leak)
    }

    #[test]
    fn a_line_is_seen_as_the_mean_over_the_window_says() {
        let (n, rate, from_s) = (24, 1000.0, 0.0123);
        let bin_w = TAU * rate / n as f64;
        // Between bins, on a bin, a millionth of a bin beside one, and where the mirror image comes to lie on a bin.
        let w = vec![0.3 * bin_w, 2.0 * bin_w, 3.0 * bin_w * (1.0 + 1e-6), 5.4 * bin_w, 21.0 * bin_w];
        let bins = vec![2, 3];
        let key =
            FrameKey { w_rad_s: w.clone(), rate_hz: rate, samples: n, from_s, bins: bins.clone(), spacing_hz: 2.0 };
        let f = frame(key);
        let z = Complex::new(0.7, -0.4);
        for (b, k) in bins.iter().enumerate() {
            for (l, w) in w.iter().enumerate() {
                let mean = |z: Complex<f64>, w: f64| -> Complex<f64> {
                    let at = |i: usize| {
                        let t = from_s + i as f64 / rate;
                        z * Complex::from_polar(1.0, w * t - TAU * (k * i) as f64 / n as f64)
                    };
                    (0..n).map(at).sum::<Complex<f64>>() / n as f64
                };
                let both = mean(z, *w) + mean(z.conj(), -w);
                let one = Complex::new(1.0, 0.0);
                let power = 2.0 * (mean(one, *w).norm_sqr() + mean(one, -w).norm_sqr());
                let (x, leak) = seen(&f, b, l, z);
                // Rounding, a thousandfold beside a bin.
                assert!((x - both).norm() < 1e-12 && (leak - power).abs() < 1e-12, "bin {k} line {l}: {x} {both}");
            }
        }
        assert!(f.touching.len() == 3, "{:?}", f.touching);
        let other = frame(FrameKey { rate_hz: 2000.0, ..f.key.clone() });
        assert!(other.sum != f.sum && frame(f.key.clone()).sum == f.sum);
    }
}
