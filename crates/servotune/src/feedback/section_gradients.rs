//! Gradients of one section on a whole grid: d ln C over a change of its parameter, at every point.
//!
//! In: the section a little to either side. Out: real and imaginary part of the central difference of its logarithm, in arrays over the grid.

use super::SampledPlant;
use super::sampled::LANES;
use crate::lti::Section;
use crate::numeric::wide::wide;

/// d ln C at every point of a grid, one array pair for each parameter. Made once, used for every candidate.
#[derive(Clone, Debug, Default)]
pub struct SectionGradients {
    /// Real and imaginary part, parameter by parameter; filled up to whole lanes.
    pub of: Vec<[Vec<f64>; 2]>,
}

impl SampledPlant {
    /// The gradients of sections given at -h and +h of each parameter, into `gradients`.
    pub fn section_gradients(&self, sections: &[[Section; 2]], h: f64, gradients: &mut SectionGradients) {
        gradients.of.resize_with(sections.len(), Default::default);
        for (pair, out) in sections.iter().zip(&mut gradients.of) {
            out.iter_mut().for_each(|a| a.resize(self.cos.len() * LANES, 0.0));
            wide(|| self.pull_lanes(pair, 1.0 / h, out));
        }
    }

    #[inline(always)]
    fn pull_lanes(&self, [minus, plus]: &[Section; 2], rate: f64, [re, im]: &mut [Vec<f64>; 2]) {
        let (re, _) = re.as_chunks_mut::<LANES>();
        let (im, _) = im.as_chunks_mut::<LANES>();
        for ((cos, sin), (re, im)) in self.cos.iter().zip(&self.sin).zip(re.iter_mut().zip(im)) {
            for j in 0..LANES {
                // Times z: a common factor of both products.
                let top = |s: &Section| (s.b1 + (s.b0 + s.b2) * cos[j], (s.b0 - s.b2) * sin[j]);
                let under = |s: &Section| (s.a1 + (1.0 + s.a2) * cos[j], (1.0 - s.a2) * sin[j]);
                let times = |(a, b): (f64, f64), (c, d): (f64, f64)| (a * c - b * d, a * d + b * c);
                let (p, m) = (times(top(plus), under(minus)), times(top(minus), under(plus)));
                // ln(p/m) = 2 artanh((p - m)/(p + m)), whose cube is far below rounding.
                let (x, y) = (p.0 + m.0, p.1 + m.1);
                let (u, v) = (p.0 - m.0, p.1 - m.1);
                let size = x * x + y * y;
                // Where the section is 0, as a low-pass at half the sample rate, ln C has no slope, and L none that counts.
                let scale = if size > 0.0 { rate / size } else { 0.0 };
                (re[j], im[j]) = ((u * x + v * y) * scale, (v * x - u * y) * scale);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn the_pull_is_the_slope_of_the_logarithm() {
        let t = 4e-5;
        let w: Vec<f64> = (1..30).map(|i| 2000.0 * f64::from(i)).collect();
        let grid = SampledPlant::of_points(t, 0, w.clone(), &vec![Complex::new(1.0, 0.0); w.len()]);
        let section = |x: f64| Section::notch(1200.0 * x.exp(), 0.05, 0.25, t).unwrap();
        let mut gradients = SectionGradients::default();
        grid.section_gradients(&[[section(-1e-5), section(1e-5)]], 1e-5, &mut gradients);
        for (i, w) in w.iter().enumerate() {
            let at = |x: f64| section(x).at_delay(Complex::from_polar(1.0, -w * t)).ln();
            // A wider difference of fourth order: what it leaves is 1e-12 of the fifth derivative, a notch's damping to the fifth below.
            let h = 1e-4;
            let wide = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            let found = Complex::new(gradients.of[0][0][i], gradients.of[0][1][i]);
            assert!((found - wide).norm() < 1e-6 * (1.0 + wide.norm()), "{found} {wide}");
        }
    }
}
