//! The linear plant in the generator's own units (track, V), its response, and random machines.

use crate::complex::C;
use crate::random::Random;
use std::f64::consts::TAU;
use std::fmt::Write;

/// (s^2 + 2 zz wz s + wz^2)/(s^2 + 2 zp wp s + wp^2).
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    pub wz: f64,
    pub zz: f64,
    pub wp: f64,
    pub zp: f64,
}

#[derive(Clone, Debug)]
pub struct Plant {
    /// Acceleration per command, without the resonance gain.
    pub b: f64,
    /// Squared natural frequency; 0 for a free inertia.
    pub k: f64,
    /// Viscous rate in 1/s.
    pub c: f64,
    pub delay: f64,
    pub gain: f64,
    pub modes: Vec<Mode>,
}

/// Powers of the position and command units in a figure.
#[derive(Clone, Copy, Debug)]
pub struct Units {
    pub length: f64,
    pub command: f64,
    pub length_name: &'static str,
    pub command_name: &'static str,
}

impl Plant {
    pub fn response(&self, w: f64) -> C {
        let s = C::new(0.0, w);
        let mut g = C::polar(self.gain * self.b, -w * self.delay) / (s * s + s * self.c + C::new(self.k, 0.0));
        for m in &self.modes {
            g = g * (s * s + s * (2.0 * m.zz * m.wz) + C::new(m.wz * m.wz, 0.0));
            g = g / (s * s + s * (2.0 * m.zp * m.wp) + C::new(m.wp * m.wp, 0.0));
        }
        g
    }

    pub fn random(r: &mut Random, sample: f64, free: bool) -> Self {
        let dc = r.range(60.0, 90.0);
        let w0: f64 = r.range(330.0, 420.0);
        let z0 = r.range(0.15, 0.3);
        let top = (0.42 / sample).min(5000.0);
        let count = 3 + r.below(4);
        let mut modes = Vec::new();
        for i in 0..count {
            let low = 1050.0 * (top / 1050.0).powf(i as f64 / count as f64);
            let high = 1050.0 * (top / 1050.0).powf((i as f64 + 0.8) / count as f64);
            let wp = TAU * r.log_range(low, high);
            let wz = wp * (1.0 + r.sign() * r.log_range(0.005, 0.03));
            let zp = r.log_range(0.01, 0.045);
            modes.push(Mode { wz, zz: zp * r.range(0.9, 1.25), wp, zp });
        }
        let gain = if r.chance(0.5) { 1.0 } else { r.range(0.9, 1.25) };
        Plant {
            b: dc * w0 * w0,
            k: if free { 0.0 } else { w0 * w0 },
            c: if free { r.range(20.0, 120.0) } else { 2.0 * z0 * w0 },
            delay: r.range(40e-6, 90e-6),
            gain,
            modes,
        }
    }

    /// The file of the contract, in the case's units.
    pub fn toml(&self, units: &Units) -> String {
        let mut t = String::new();
        let ratio = units.length / units.command;
        let _ = writeln!(
            t,
            "position_unit = \"{}\"\ncommand_unit = \"{}\"\n\n[plant]",
            units.length_name, units.command_name
        );
        if self.k > 0.0 {
            let w = self.k.sqrt();
            let _ = writeln!(t, "dc_gain = {:e}\nnatural_frequency_rad_s = {:.9}", self.b / self.k * ratio, w);
            let _ = writeln!(t, "damping_ratio = {:.9}", self.c / (2.0 * w));
        } else {
            let _ = writeln!(t, "natural_frequency_rad_s = 0.0\nacceleration_gain = {:e}", self.b * ratio);
            let _ = writeln!(t, "viscous_rate_per_s = {:.9}", self.c);
        }
        let _ = writeln!(t, "delay_s = {:e}\nresonance_gain = {:.9}", self.delay, self.gain);
        for m in &self.modes {
            let _ = writeln!(t, "\n[[plant.modes]]\nzero_rad_s = {:.6}\nzero_damping_ratio = {:.9}", m.wz, m.zz);
            let _ = writeln!(t, "pole_rad_s = {:.6}\npole_damping_ratio = {:.9}", m.wp, m.zp);
        }
        t
    }
}
