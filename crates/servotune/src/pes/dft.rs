//! The DFT of the window, eqs. (40) and (41), and its bands, eqs. (42) and (43).

use serde::Serialize;
use std::f64::consts::TAU;

/// One harmonic of the window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Harmonic {
    /// Index of the bin, from 1.
    pub k: usize,
    /// k sample_rate / N (Hz).
    pub hz: f64,
    /// |X_k| / N (position_unit).
    pub amplitude: f64,
}

/// A DFT over chosen bins of a window of fixed length, its factors computed once.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowDft {
    n: usize,
    rate_hz: f64,
    bins: Vec<usize>,
    /// Cosine and sine rows, bins x n.
    cos: Vec<f64>,
    sin: Vec<f64>,
}

impl WindowDft {
    /// Bins `bins` (each below n) of windows of `n` samples at `rate_hz`.
    pub fn new(n: usize, rate_hz: f64, bins: Vec<usize>) -> WindowDft {
        let mut cos = Vec::with_capacity(n * bins.len());
        let mut sin = Vec::with_capacity(n * bins.len());
        for &k in &bins {
            for i in 0..n {
                // The product is reduced as a whole number first: no digits are lost at high k i.
                let angle = TAU * ((k * i) % n) as f64 / n as f64;
                cos.push(angle.cos());
                sin.push(angle.sin());
            }
        }
        WindowDft { n, rate_hz, bins, cos, sin }
    }

    /// All harmonics from 1 to N/2.
    pub fn whole(n: usize, rate_hz: f64) -> WindowDft {
        WindowDft::new(n, rate_hz, (1..=n / 2).collect())
    }

    /// The bins.
    pub fn bins(&self) -> &[usize] {
        &self.bins
    }

    /// Samples of the window.
    pub fn samples(&self) -> usize {
        self.n
    }

    /// Frequency of bin k (Hz).
    pub fn hz(&self, k: usize) -> f64 {
        k as f64 * self.rate_hz / self.n as f64
    }

    /// |X_k|/N for every bin, into `amplitude`; `window` has n samples.
    pub fn amplitudes(&self, window: &[f64], amplitude: &mut Vec<f64>) {
        amplitude.clear();
        let rows = self.cos.chunks_exact(self.n).zip(self.sin.chunks_exact(self.n));
        for (cos, sin) in rows {
            // Four running sums a row: the compiler may then use vector lanes without changing the order of any sum.
            let (mut re, mut im) = ([0.0; 4], [0.0; 4]);
            let (w4, w1) = window[..self.n].as_chunks::<4>();
            let (c4, c1) = cos.as_chunks::<4>();
            let (s4, s1) = sin.as_chunks::<4>();
            for ((w, c), s) in w4.iter().zip(c4).zip(s4) {
                for j in 0..4 {
                    re[j] += w[j] * c[j];
                    im[j] += w[j] * s[j];
                }
            }
            for ((w, c), s) in w1.iter().zip(c1).zip(s1) {
                re[0] += w * c;
                im[0] += w * s;
            }
            let (re, im) = ((re[0] + re[1]) + (re[2] + re[3]), (im[0] + im[1]) + (im[2] + im[3]));
            amplitude.push((re * re + im * im).sqrt() / self.n as f64);
        }
    }

    /// Slopes of a figure in the window's samples, into `out`, from its slopes in the power |X_k|²/N² of each bin.
    pub fn slopes(&self, window: &[f64], power: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.n, 0.0);
        let scale = 2.0 / (self.n as f64 * self.n as f64);
        let rows = self.cos.chunks_exact(self.n).zip(self.sin.chunks_exact(self.n));
        for ((cos, sin), share) in rows.zip(power).filter(|(_, share)| **share != 0.0) {
            let sum = |row: &[f64]| row.iter().zip(window).map(|(a, b)| a * b).sum::<f64>() * scale * share;
            let (re, im) = (sum(cos), sum(sin));
            for ((out, cos), sin) in out.iter_mut().zip(cos).zip(sin) {
                *out += re * cos + im * sin;
            }
        }
    }

    /// Euclidean norm of the amplitudes of bins in `low_hz..=high_hz`, eqs. (42) and (43).
    pub fn band(&self, amplitude: &[f64], hz: [f64; 2]) -> f64 {
        self.inside(hz).map(|i| amplitude[i] * amplitude[i]).sum::<f64>().sqrt()
    }

    /// Which of the bins, by index, lie in `low_hz..=high_hz`.
    pub fn inside(&self, [low_hz, high_hz]: [f64; 2]) -> impl Iterator<Item = usize> {
        (0..self.bins.len()).filter(move |&i| (low_hz..=high_hz).contains(&self.hz(self.bins[i])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cosine_on_a_bin_has_half_its_amplitude_there_and_nothing_elsewhere() {
        let n = 200;
        let w: Vec<f64> = (0..n).map(|i| 0.8 * (TAU * 7.0 * f64::from(i) / f64::from(n) + 0.4).cos()).collect();
        let dft = WindowDft::whole(200, 27_480.0);
        let mut a = vec![];
        dft.amplitudes(&w, &mut a);
        for (k, a) in dft.bins().iter().zip(&a) {
            // Rounding of 200 products.
            assert!((a - if *k == 7 { 0.4 } else { 0.0 }).abs() < 1e-15 * 200.0);
        }
        assert!((dft.hz(7) - 7.0 * 137.4).abs() < 1e-9);
        assert!((dft.band(&a, [600.0, 1500.0]) - 0.4).abs() < 1e-12);
        assert!(dft.band(&a, [1500.0, 3000.0]) < 1e-12);
    }

    #[test]
    fn parseval_holds_for_an_odd_length() {
        let w: Vec<f64> = (0..15).map(|i| f64::from(i * i % 7)).collect();
        let dft = WindowDft::new(15, 1.0, (0..15).collect());
        let mut a = vec![];
        dft.amplitudes(&w, &mut a);
        let time: f64 = w.iter().map(|x| x * x).sum::<f64>() / 15.0;
        assert!((a.iter().map(|x| x * x).sum::<f64>() - time).abs() < 1e-12 * time);
    }
}
