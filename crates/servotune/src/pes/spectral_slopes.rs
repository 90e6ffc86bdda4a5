//! How the write read off the spectrum changes with the gains: one backward pass for each figure, whatever the number of parameters.
//!
//! In: after [`SpectralPes::write`], how a figure changes with the power of each bin, and the gradients d ln C of each parameter. Out: the figure's slope
//! in each parameter, exact. With dS = -S T d ln C a line z = S E moves by -z T d ln C and the noise on it by 2 Re(|S|² e |L|² d ln C - T n d ln C),
//! e the encoder's density and n all noise; so every slope is a sum of Re(W d ln C) over lines, and W does not depend on the parameter.

use super::spectral_adjoint::Adjoint;
use super::window_frame::LANES;
use super::{SpectralPes, SpectralWork};
use crate::feedback::SectionGradients;
use crate::numeric::wide::wide;
use nalgebra::Complex;

impl SpectralPes {
    /// Slopes of a figure into `out`, one for each pull; `shares` gives, for bins by index, the figure's slope in the bin's power |X_k|²/N².
    ///
    /// The write that the slopes belong to is the last one that `work` has seen.
    pub fn slopes(
        &self,
        shares: impl Iterator<Item = (usize, f64)>,
        gradients: &SectionGradients,
        work: &mut SpectralWork,
        out: &mut Vec<f64>,
    ) {
        let mut a = std::mem::take(&mut work.adjoint);
        a.bins.clear();
        a.bins.extend(shares.map(|(k, q)| (k, [2.0 * q * work.x[k].re, 2.0 * q * work.x[k].im, q])));
        let width = self.frame.width();
        for v in [&mut a.g_re, &mut a.g_im, &mut a.density, &mut a.w_re, &mut a.w_im] {
            v.resize(width, 0.0);
        }
        wide(|| self.back(&mut a));
        wide(|| self.weigh(&mut a, work));
        for t in &self.frame.touching {
            let Some((_, [x, y, q])) = a.bins.iter().find(|(k, _)| *k == t.bin) else { continue };
            let s = Complex::new(work.s_re[t.line], work.s_im[t.line]);
            let l = Complex::new(work.lines.re[t.line], work.lines.im[t.line]);
            let z = self.line(work, t.line);
            // d figure = Re(conj(x + jy) dX); a mirror image moves by the conjugate.
            let moved = Complex::new(*x, -*y) * t.weight;
            let moved = if t.mirror { moved.conj() * z } else { moved * z };
            let noise = self.encoder * s.norm_sqr() * l.norm_sqr() - (1.0 - s) * self.noise_density(work, t.line);
            let w = -moved * (1.0 - s) + 2.0 * q * t.leak * noise;
            a.w_re[t.line] += w.re;
            a.w_im[t.line] += w.im;
        }
        out.clear();
        out.extend(gradients.of.iter().map(|[re, im]| wide(|| pulled([&a.w_re, &a.w_im], [re, im]))));
        work.adjoint = a;
    }

    /// From the bins back to the folded lines.
    #[inline(always)]
    fn back(&self, a: &mut Adjoint) {
        let chunks = self.frame.width() / LANES;
        let g_re = &mut a.g_re.as_chunks_mut::<LANES>().0[..chunks];
        let g_im = &mut a.g_im.as_chunks_mut::<LANES>().0[..chunks];
        let density = &mut a.density.as_chunks_mut::<LANES>().0[..chunks];
        let all: f64 = a.bins.iter().map(|(_, [x, _, _])| x).sum();
        for c in 0..chunks {
            let (mut re, mut im, mut d) = ([-all; LANES], [0.0; LANES], [0.0; LANES]);
            for (k, [x, y, q]) in &a.bins {
                let u = &self.frame.sum[*k].as_chunks::<LANES>().0[c];
                let v = &self.frame.difference[*k].as_chunks::<LANES>().0[c];
                for j in 0..LANES {
                    re[j] -= y * v[j];
                    im[j] += x * u[j];
                    d[j] += q * (0.5 + 0.5 * (u[j] * u[j] + v[j] * v[j]));
                }
            }
            (g_re[c], g_im[c], density[c]) = (re, im, d);
        }
    }

    /// W of every line.
    #[inline(always)]
    fn weigh(&self, a: &mut Adjoint, work: &SpectralWork) {
        let n = self.lines().w_rad_s().len();
        let (b_re, b_im, b_density) = (&a.g_re[..n], &a.g_im[..n], &a.density[..n]);
        let (g_re, g_im, density) = (&work.g_re[..n], &work.g_im[..n], &work.density[..n]);
        let (s_re, s_im) = (&work.s_re[..n], &work.s_im[..n]);
        let (l_re, l_im) = (&work.lines.re[..n], &work.lines.im[..n]);
        let power = &self.frame.fold_power[..n];
        let (w_re, w_im) = (&mut a.w_re[..n], &mut a.w_im[..n]);
        for i in 0..n {
            let (t_re, t_im) = (1.0 - s_re[i], -s_im[i]);
            // conj(back) g, and twice the density's part.
            let re = -(b_re[i] * g_re[i] + b_im[i] * g_im[i]) - 2.0 * b_density[i] * density[i];
            let im = -(b_re[i] * g_im[i] - b_im[i] * g_re[i]);
            let s = s_re[i] * s_re[i] + s_im[i] * s_im[i];
            let l = l_re[i] * l_re[i] + l_im[i] * l_im[i];
            w_re[i] = t_re * re - t_im * im + 2.0 * b_density[i] * power[i] * s * self.encoder * l;
            w_im[i] = t_re * im + t_im * re;
        }
    }
}

/// Sum of Re(W p) over lines, in lanes.
#[inline(always)]
fn pulled([w_re, w_im]: [&[f64]; 2], [p_re, p_im]: [&[f64]; 2]) -> f64 {
    const FEW: usize = 4;
    let (p_re, p_im) = (p_re.as_chunks::<FEW>().0, p_im.as_chunks::<FEW>().0);
    let (w_re, w_im) = (w_re.as_chunks::<FEW>().0, w_im.as_chunks::<FEW>().0);
    let mut sum = [0.0; FEW];
    for ((a, b), (x, y)) in w_re.iter().zip(w_im).zip(p_re.iter().zip(p_im)) {
        for j in 0..FEW {
            sum[j] += a[j] * x[j] - b[j] * y[j];
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}
