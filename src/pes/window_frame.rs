//! What a window sees of every line of the there-and-back spectrum, whatever the machine and the gains: the Dirichlet kernels.
//!
//! In: lines, clock, window, bins. Out: [`WindowFrame`]. It costs a hundred times what the rest of a [`SpectralPes`](super::SpectralPes) costs,
//! and a fleet asks for the same one for every slot: the last one is kept and handed out again. It is a pure function of its key.

use nalgebra::Complex;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

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

/// Kernels of every bin on every line.
#[derive(Debug)]
pub(super) struct WindowFrame {
    key: FrameKey,
    /// Of the line and of its mirror image, turned to the window's start.
    pub turned: Vec<Vec<[Complex<f64>; 2]>>,
    /// Share of the line's noise density that falls into the bin.
    pub leak: Vec<Vec<f64>>,
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
    fn of(key: FrameKey) -> WindowFrame {
        let n = key.samples;
        let (mut turned, mut leak) = (Vec::with_capacity(key.bins.len()), Vec::with_capacity(key.bins.len()));
        for &k in &key.bins {
            let bin = TAU * k as f64 / n as f64;
            let pair = |w: &f64| [kernel(w / key.rate_hz - bin, n), kernel(-w / key.rate_hz - bin, n)];
            let pairs: Vec<[Complex<f64>; 2]> = key.w_rad_s.iter().map(pair).collect();
            leak.push(pairs.iter().map(|[a, b]| (a.norm_sqr() + b.norm_sqr()) * key.spacing_hz).collect());
            let turn = |(w, [a, b]): (&f64, &[Complex<f64>; 2])| {
                let turn = Complex::from_polar(1.0, w * key.from_s);
                [turn * a, turn.conj() * b]
            };
            turned.push(key.w_rad_s.iter().zip(&pairs).map(turn).collect());
        }
        WindowFrame { key, turned, leak }
    }
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

    #[test]
    fn the_kernel_is_the_mean_of_its_sum_and_another_key_gives_another_frame() {
        let (n, angle) = (7, 0.4);
        let sum: Complex<f64> = (0..n).map(|i| Complex::from_polar(1.0, angle * f64::from(i))).sum();
        // Seven terms of size 1: rounding only.
        assert!((kernel(angle, 7) - sum / f64::from(n)).norm() < 1e-14);
        let key = |rate_hz| FrameKey {
            w_rad_s: vec![100.0, 300.0],
            rate_hz,
            samples: 7,
            from_s: 0.01,
            bins: vec![1],
            spacing_hz: 2.0,
        };
        let (a, b) = (frame(key(1000.0)), frame(key(2000.0)));
        assert!(a.leak != b.leak && frame(key(1000.0)).leak == a.leak);
        let direct = Complex::from_polar(1.0, 3.0) * kernel(0.3 - TAU / 7.0, 7);
        assert!((a.turned[0][1][0] - direct).norm() < 1e-14);
    }
}
