//! The first taps of a given controller's loop from error to command, and what the horizon's figures say of them.

use super::horizon::{Horizon, LimitPlant};
use crate::lti::Section;
use nalgebra::Complex;

/// Impulse response of G = C S with these sections, `length` taps; by running the sampled loop.
pub(super) fn taps(plant: &[f64], chain: &[Section], length: usize) -> Vec<f64> {
    let mut memory = vec![[0.0; 2]; chain.len()];
    let mut command = vec![0.0; length];
    for k in 0..length {
        let position: f64 = (0..k).map(|j| command[j] * plant[k - j]).sum();
        let mut signal = if k == 0 { 1.0 } else { 0.0 } - position;
        for (s, m) in chain.iter().zip(&mut memory) {
            let out = s.b0 * signal + m[0];
            m[0] = s.b1 * signal - s.a1 * out + m[1];
            m[1] = s.b2 * signal - s.a2 * out;
            signal = out;
        }
        command[k] = signal;
    }
    command
}

/// Expected |X_k|²/N² of every bin under taps of full length: noise from the start of the record on.
pub(super) fn energies(h: &Horizon, g: &[f64]) -> Vec<f64> {
    let whole = h.ahead + h.taps;
    let mut s: Vec<f64> = (0..whole).map(|k| -(0..=k).map(|j| h.plant[j] * g[k - j]).sum::<f64>()).collect();
    s[0] += 1.0;
    // Colour of the windage through S; before the record it is stationary, which its first innovation stands for.
    let mut coloured = vec![0.0; whole];
    let mut last = 0.0;
    for (c, s) in coloured.iter_mut().zip(&s) {
        last = h.keep * last + s;
        *c = last;
    }
    let pulled: Vec<f64> = {
        let mut e = vec![0.0; whole];
        e[h.ahead..].copy_from_slice(&h.target);
        (0..whole).map(|k| (0..=k).map(|j| g[j] * e[k - j]).sum()).collect()
    };
    let stationary = 1.0 / (1.0 - h.keep * h.keep).max(f64::MIN_POSITIVE);
    h.bins
        .iter()
        .map(|bin| {
            let moved: Complex<f64> = bin.input.iter().zip(&pulled).map(|(z, u)| z * *u).sum();
            let mut sum = (bin.still - moved).norm_sqr();
            for j in 0..whole {
                let through = |x: &[f64]| -> Complex<f64> { bin.input[j..].iter().zip(x).map(|(z, x)| z * *x).sum() };
                if h.encoder > 0.0 {
                    sum += h.encoder * h.encoder * through(g).norm_sqr();
                }
                if h.windage > 0.0 {
                    let share = if j == 0 { stationary } else { 1.0 };
                    sum += h.windage * h.windage * share * through(&coloured).norm_sqr();
                }
            }
            sum
        })
        .collect()
}

impl LimitPlant {
    /// The sampled model of a plant.
    pub fn of_model(plant: &crate::lti::Plant, sample_time_s: f64) -> Result<LimitPlant, crate::lti::LtiError> {
        Ok(LimitPlant::Sampled(crate::lti::DiscretePlant::of(plant, sample_time_s)?))
    }
}
