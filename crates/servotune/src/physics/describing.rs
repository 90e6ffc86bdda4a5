//! The describing function of any effect, by running its law to a steady cycle.
//!
//! In: law and strengths, amplitude A, frequency w. Out: N = (first harmonic of what the effect adds)/A, complex; a positive real part
//! is in phase with the input. The input is the command u = i = A sin(w t) for [`Entry::Command`], and the position
//! x = A sin(w t) with no command otherwise. Definition: Gelb, Vander Velde 1968, by quadrature over one cycle.

use super::effect::{COLUMNS, Entry};
use super::library::LawSetting;
use super::sample::{MotionScene, Sample};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Steps of one cycle: kinks of a law are met within 1/4096 of it, an error of the harmonic below 1e-5.
const STEPS: usize = 4096;
/// Most cycles to a steady one.
const CYCLES: usize = 400;
/// Change from cycle to cycle that counts as steady, relative.
const STEADY: f64 = 1e-10;

/// N(A, w) of what the effect adds, to the torque or command (command_unit) or to the position; none where no steady cycle
/// is reached (an effect of time, such as a drift) or where `amplitude` or `w_rad_s` is not above 0.
pub fn describing(setting: &LawSetting, scene: &MotionScene, amplitude: f64, w_rad_s: f64) -> Option<Complex<f64>> {
    let good = |v: f64| v.is_finite() && v > 0.0;
    if !good(amplitude) || !good(w_rad_s) {
        return None;
    }
    let facts = setting.facts();
    // The law is sampled as finely as the cycle asks for, whatever the machine's clock.
    let step = TAU / w_rad_s / STEPS as f64;
    let fine = MotionScene { sample_time_s: step, ..scene.clone() };
    let mut law = setting.law.in_motion(&fine);
    let mut out = [0.0; COLUMNS];
    let mut last: Option<Complex<f64>> = None;
    for cycle in 0..CYCLES {
        let mut sum = Complex::new(0.0, 0.0);
        for k in 0..STEPS {
            let from = sample(facts.entry, amplitude, w_rad_s, step, cycle * STEPS + k);
            let to = sample(facts.entry, amplitude, w_rad_s, step, cycle * STEPS + k + 1);
            law.columns(&from, &to, &mut out[..facts.columns]);
            law.commit(&from, &to);
            let added: f64 = setting.strengths.iter().zip(&out).map(|(s, c)| s * c).sum();
            // A mean over the interval belongs to its middle.
            let at = if facts.entry == Entry::Torque { k as f64 + 0.5 } else { (k + 1) as f64 };
            sum += Complex::from_polar(added, -TAU * at / STEPS as f64);
        }
        // sin(w t) itself has the coefficient -j.
        let n = sum * Complex::new(0.0, 2.0 / STEPS as f64) / amplitude;
        if let Some(before) = last
            && (n - before).norm() <= STEADY * n.norm()
        {
            return Some(n);
        }
        last = Some(n);
    }
    None
}

fn sample(entry: Entry, amplitude: f64, w: f64, step: f64, index: usize) -> Sample {
    let (sin, cos) = (TAU * (index % STEPS) as f64 / STEPS as f64).sin_cos();
    let t = step * index as f64;
    if entry == Entry::Command {
        let u = amplitude * sin;
        Sample { t, u, i: u, ..Sample::default() }
    } else {
        Sample { t, x: amplitude * sin, v: amplitude * w * cos, ..Sample::default() }
    }
}
