//! A loop's factors at many points of the unit circle: four points side by side, each with the bits that it has alone.
//!
//! In: points z. Out: the plant, or the sections, at each. A curve is hundreds of points of one plant, so that its numbers are loaded once for
//! four of them and four sums grow at a time.

use super::{DiscretePlant, Section};
use crate::numeric::wide::{Wide, widest};
use nalgebra::Complex;

/// Points handled side by side.
const LANES: usize = 4;

/// Parts of four numbers, real and imaginary.
type Four = [[f64; LANES]; 2];

/// Four points of a list; beyond its end the last one again.
#[inline(always)]
fn four(z: &[Complex<f64>], from: usize) -> Four {
    let at = |j: usize| z[(from + j).min(z.len() - 1)];
    [std::array::from_fn(|j| at(j).re), std::array::from_fn(|j| at(j).im)]
}

impl DiscretePlant {
    /// P(z) at each of some points.
    pub(crate) fn at_each(&self, z: &[Complex<f64>]) -> Vec<Complex<f64>> {
        let sums = widest(Terms { plant: self, z });
        z.iter().zip(sums).map(|(z, [now, before])| self.with_delay(*z, now, before)).collect()
    }
}

/// What the terms give to P(z), of the newest command and of the one before.
struct Terms<'a> {
    plant: &'a DiscretePlant,
    z: &'a [Complex<f64>],
}

impl Wide for Terms<'_> {
    type Output = Vec<[Complex<f64>; 2]>;

    #[inline(always)]
    fn compute(self) -> Self::Output {
        let p = self.plant;
        let mut all = Vec::with_capacity(self.z.len() + LANES);
        for from in (0..self.z.len()).step_by(LANES) {
            let [z_re, z_im] = four(self.z, from);
            let mut sum = [[0.0; LANES]; 4];
            let rows = p.lambda_re.iter().zip(&p.lambda_im).zip(p.now_re.iter().zip(&p.now_im));
            for (((re, im), (now_re, now_im)), (before_re, before_im)) in rows.zip(p.before_re.iter().zip(&p.before_im))
            {
                let lambda = Complex::new(*re, *im);
                for j in 0..LANES {
                    let z = Complex::new(z_re[j], z_im[j]);
                    // As `DiscretePlant::at_z` has it, to the last bit.
                    let (upper, lower) = (z - lambda, z - lambda.conj());
                    let scale = 0.5 / (upper * lower);
                    let half = |gain: Complex<f64>| (gain * lower + gain.conj() * upper) * scale;
                    let now = half(Complex::new(*now_re, *now_im));
                    let before = half(Complex::new(*before_re, *before_im));
                    sum[0][j] += now.re;
                    sum[1][j] += now.im;
                    sum[2][j] += before.re;
                    sum[3][j] += before.im;
                }
            }
            let [now_re, now_im, before_re, before_im] = sum;
            all.extend(
                (0..LANES).map(|j| [Complex::new(now_re[j], now_im[j]), Complex::new(before_re[j], before_im[j])]),
            );
        }
        all
    }
}

/// The product of sections at each z⁻¹ of some.
pub(crate) fn chain_at_each(chain: &[Section], back: &[Complex<f64>]) -> Vec<Complex<f64>> {
    widest(Chain { chain, back })
}

struct Chain<'a> {
    chain: &'a [Section],
    back: &'a [Complex<f64>],
}

impl Wide for Chain<'_> {
    type Output = Vec<Complex<f64>>;

    #[inline(always)]
    fn compute(self) -> Self::Output {
        let mut all = Vec::with_capacity(self.back.len() + LANES);
        for from in (0..self.back.len()).step_by(LANES) {
            let [re, im] = four(self.back, from);
            let mut product = [[1.0; LANES], [0.0; LANES]];
            for s in self.chain {
                for j in 0..LANES {
                    let one = Complex::new(product[0][j], product[1][j]) * s.at_delay(Complex::new(re[j], im[j]));
                    (product[0][j], product[1][j]) = (one.re, one.im);
                }
            }
            all.extend((0..LANES).map(|j| Complex::new(product[0][j], product[1][j])));
        }
        all.truncate(self.back.len());
        all
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, Mode, Plant, Sections};
    use std::f64::consts::PI;

    /// Every length of list, every kind of term, delays with and without whole samples: the bits of one point at a time.
    #[test]
    fn points_side_by_side_have_the_bits_of_points_in_a_row() {
        let t = 5e-5;
        let modes: Vec<Mode> = (1..=5)
            .map(|i| {
                let w = 2e3 * f64::from(i);
                Mode { zero_rad_s: 1.02 * w, zero_damping_ratio: 0.01, pole_rad_s: w, pole_damping_ratio: 0.02 }
            })
            .collect();
        let free = Body::FreeInertia { acceleration_gain: 2e6, viscous_rate_per_s: 0.0 };
        let lag = Body::SecondOrder { dc_gain: 20.0, natural_frequency_rad_s: 60.0, damping_ratio: 2.0 };
        let chain = vec![Section::lowpass(4e3, 0.7, t).unwrap(), Section::notch(700.0, 0.05, 0.3, t).unwrap()];
        let sections = Sections { chain, sample_time_s: t };
        for (body, delay_s) in [(free, 0.0), (lag.clone(), 1.3 * t), (lag, 2.0 * t)] {
            let (position_unit, command_unit) = ("um".into(), "A".into());
            let plant = Plant {
                position_unit,
                command_unit,
                body,
                delay_s,
                resonance_gain: 1.0,
                modes: modes.clone(),
                physics: vec![],
            };
            let plant = DiscretePlant::of(&plant, t).unwrap();
            for count in 0..=2 * LANES + 1 {
                let z: Vec<_> = (1..=count).map(|i| Complex::from_polar(1.0, PI * i as f64 / 9.0)).collect();
                let back: Vec<_> = z.iter().map(|z| z.conj()).collect();
                assert_eq!(plant.at_each(&z), z.iter().map(|&z| plant.at_z(z)).collect::<Vec<_>>());
                let alone: Vec<_> = back.iter().map(|&b| sections.at_delay(b)).collect();
                assert_eq!(chain_at_each(&sections.chain, &back), alone);
            }
        }
    }
}
