//! One effect over cycles of a sinusoidal motion: the first harmonic of what it adds.
//!
//! In: a position A sin(w t), the acting command as a phasor against it, the amplitude of the command. Out: the phasor of
//! what the effect adds, against the same sine. Where [`super::describing`] knows the position alone, this one also drives
//! laws that look at the acting command. Time and spindle stand still: a disturbance adds nothing.

use super::effect::{COLUMNS, Entry};
use super::library::LawSetting;
use super::sample::{MotionScene, Sample};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Steps of one cycle: a kink met within 1/512 of it leaves an error of the harmonic below 1e-5 of the kink's part.
const STEPS: usize = 512;
/// Most cycles: what has not settled by then is memory far slower than the cycle, and as good as constant over it.
const CYCLES: usize = 48;
/// Change from cycle to cycle that counts as settled, relative.
const SETTLED: f64 = 1e-7;

/// A sine, its table made once.
#[derive(Clone, Debug)]
pub struct Cycle {
    sine: Vec<f64>,
}

impl Default for Cycle {
    fn default() -> Self {
        Cycle { sine: (0..STEPS).map(|k| (TAU * k as f64 / STEPS as f64).sin()).collect() }
    }
}

/// The motion of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Frequency (rad/s).
    pub w_rad_s: f64,
    /// Amplitude of the position (position_unit).
    pub position: f64,
    /// Acting command as a phasor against the position's sine (command_unit).
    pub acting: Complex<f64>,
    /// Amplitude of the command, for [`Entry::Command`] (command_unit).
    pub command: f64,
}

impl Cycle {
    fn sin(&self, k: usize) -> f64 {
        self.sine[k % STEPS]
    }

    fn cos(&self, k: usize) -> f64 {
        self.sine[(k + STEPS / 4) % STEPS]
    }

    fn sample(&self, entry: Entry, m: &Motion, k: usize) -> Sample {
        let (sin, cos) = (self.sin(k), self.cos(k));
        if entry == Entry::Command {
            let u = m.command * sin;
            return Sample { u, i: u, ..Sample::default() };
        }
        let i = m.acting.re * sin + m.acting.im * cos;
        Sample { x: m.position * sin, v: m.position * m.w_rad_s * cos, u: i, i, ..Sample::default() }
    }

    /// The phasor that an effect adds (command_unit, or position_unit at [`Entry::Position`]) against the input's sine.
    pub fn added(&self, setting: &LawSetting, scene: &MotionScene, m: &Motion) -> Complex<f64> {
        let (entry, columns) = (setting.facts().entry, setting.facts().columns);
        let fine = MotionScene { sample_time_s: TAU / m.w_rad_s / STEPS as f64, ..scene.clone() };
        let mut law = setting.law.in_motion(&fine);
        let mut out = [0.0; COLUMNS];
        let mut last = Complex::new(f64::NAN, 0.0);
        for _ in 0..CYCLES {
            let (mut re, mut im) = (0.0, 0.0);
            let mut from = self.sample(entry, m, 0);
            for k in 1..=STEPS {
                let mut to = self.sample(entry, m, k);
                if entry != Entry::Command {
                    // What acts is the mean over the step.
                    from.i = 0.5 * (from.i + to.u);
                }
                law.columns(&from, &to, &mut out[..columns]);
                law.commit(&from, &to);
                let added: f64 = setting.strengths.iter().zip(&out).map(|(s, c)| s * c).sum();
                re += added * self.sin(k);
                im += added * self.cos(k);
                to.i = to.u;
                from = to;
            }
            let mut sum = Complex::new(re, im) * (2.0 / STEPS as f64);
            if entry == Entry::Torque {
                // A mean over the step belongs to its middle.
                sum *= Complex::from_polar(1.0, 0.5 * TAU / STEPS as f64);
            }
            if (sum - last).norm() <= SETTLED * sum.norm() {
                return sum;
            }
            last = sum;
        }
        last
    }
}
