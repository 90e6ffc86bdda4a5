//! A write read off the spectrum, taken apart: what every line adds to every bin.
//!
//! In: a [`SpectralPes`]. Out: the numbers by which S on the lines makes the bins, for who wants more than the write of one controller.

use super::spectral::SpectralPes;
use nalgebra::Complex;

/// What S makes of the write: X_k = still + sum of own z + mirror conj z with z = S error, noise power = sum of noise |S|² (encoder |L|² + windage).
#[derive(Clone, Debug)]
pub struct SpectralParts {
    /// (1 - P F) R on every line.
    pub error: Vec<Complex<f64>>,
    /// Density of the encoder noise.
    pub encoder: f64,
    /// Density of the windage times |P|² on every line.
    pub windage: Vec<f64>,
    /// The bins, ascending.
    pub bins: Vec<BinParts>,
}

/// One bin; each list is over the lines.
#[derive(Clone, Debug)]
pub struct BinParts {
    /// What is there without any line: run-out.
    pub still: Complex<f64>,
    /// Weight of a line.
    pub own: Vec<Complex<f64>>,
    /// Weight of its conjugate, the line's mirror image.
    pub mirror: Vec<Complex<f64>>,
    /// Weight of the noise's density.
    pub noise: Vec<f64>,
}

impl SpectralPes {
    /// The write taken apart.
    pub fn parts(&self) -> SpectralParts {
        let lines = self.lines().w_rad_s().len();
        let f = &*self.frame;
        let fold = |i: usize| Complex::new(f.fold[0][i], f.fold[1][i]);
        let mut bins: Vec<BinParts> = (0..self.runout.len())
            .map(|k| {
                let (u, v) = (&f.sum[k], &f.difference[k]);
                // Of g = fold z the bin sees Im g u - Re g and, as imaginary part, -Re g v.
                let own = |i: usize| fold(i) * Complex::new(-0.5, -0.5 * (u[i] + v[i]));
                let mirror = |i: usize| fold(i).conj() * Complex::new(-0.5, 0.5 * (u[i] - v[i]));
                BinParts {
                    still: self.runout[k],
                    own: (0..lines).map(own).collect(),
                    mirror: (0..lines).map(mirror).collect(),
                    noise: (0..lines).map(|i| f.fold_power[i] * 0.5 * (1.0 + u[i] * u[i] + v[i] * v[i])).collect(),
                }
            })
            .collect();
        for t in &f.touching {
            let bin = &mut bins[t.bin];
            let side = if t.mirror { &mut bin.mirror } else { &mut bin.own };
            side[t.line] += t.weight;
            bin.noise[t.line] += t.leak;
        }
        SpectralParts {
            error: (0..lines).map(|i| Complex::new(self.error[0][i], self.error[1][i])).collect(),
            encoder: self.encoder,
            windage: self.windage[..lines].to_vec(),
            bins,
        }
    }
}
