//! Plants of the paper's family (second order, delay, resonance pairs) and sweep files of them in every dress.
#![allow(dead_code, missing_docs)]

use nalgebra::Complex;
use servotune::frf::Frf;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// SplitMix64 (Steele, Lea, Flood 2014): small, seeded, the same everywhere.
pub struct Draw(pub u64);

impl Draw {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    pub fn normal(&mut self) -> f64 {
        let r = (-2.0 * self.between(1e-300, 1.0).ln()).sqrt();
        r * (TAU * self.between(0.0, 1.0)).cos()
    }
}

pub struct Plant {
    gain: f64,
    w0: f64,
    z0: f64,
    delay: f64,
    /// Zero (rad/s, damping) and pole (rad/s, damping).
    pairs: Vec<[f64; 4]>,
}

impl Plant {
    pub fn random(seed: u64) -> Self {
        let mut d = Draw(seed.wrapping_mul(7919) + 1);
        let pairs = (0..4 + d.below(7))
            .map(|_| {
                let pole = TAU * d.between(600f64.ln(), 6000f64.ln()).exp();
                let zero = pole * (1.0 + d.between(-0.08, 0.08));
                [zero, d.between(0.005, 0.04), pole, d.between(0.005, 0.04)]
            })
            .collect();
        Plant {
            gain: d.between(30.0, 150.0),
            w0: TAU * d.between(40.0, 110.0),
            z0: d.between(0.05, 0.5),
            delay: d.between(20e-6, 90e-6),
            pairs,
        }
    }
    pub fn at(&self, w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        let pair = |a: f64, z: f64| s * s + s * (2.0 * z * a) + a * a;
        let mut p = self.gain * self.w0 * self.w0 / pair(self.w0, self.z0) * (-s * self.delay).exp();
        for [wz, dz, wp, dp] in &self.pairs {
            p *= pair(*wz, *dz) / pair(*wp, *dp);
        }
        p
    }
    /// Largest relative deviation of a response from the plant, on the response's own grid; a grid in the wrong unit
    /// counts as a whole.
    pub fn worst_error(&self, frf: &Frf) -> f64 {
        if (frf.w_rad_s()[0] / (TAU * 40.0) - 1.0).abs() > 1e-3 {
            return f64::INFINITY;
        }
        frf.w_rad_s().iter().zip(frf.value()).map(|(w, v)| (v / self.at(*w) - 1.0).norm()).fold(0.0, f64::max)
    }
}

/// How a file shows a response.
#[derive(Clone, Default)]
pub struct Show {
    pub linear: bool,
    pub radians: bool,
    pub rad_per_s: bool,
    pub margin: bool,
    pub conjugated: bool,
    pub header: bool,
}

impl Show {
    /// Dresses by name: each question alone and all together, without a header and with one.
    pub fn all() -> Vec<(String, Show)> {
        // Bits: linear, radians, rad/s, margin, conjugated, header.
        let dresses = [
            0b000000, 0b001000, 0b001001, 0b000010, 0b001010, 0b001100, 0b000111, 0b001111, 0b010000, 0b011000,
            0b011111, 0b101000, 0b100111, 0b111000,
        ];
        dresses
            .into_iter()
            .map(|bits: u32| {
                let bit = |k: u32| bits >> k & 1 == 1;
                let show = Show {
                    linear: bit(0),
                    radians: bit(1),
                    rad_per_s: bit(2),
                    margin: bit(3),
                    conjugated: bit(4),
                    header: bit(5),
                };
                let pick = |on, a: &'static str, b: &'static str| if on { a } else { b };
                let name = [
                    pick(show.header, "header", "bare"),
                    pick(show.linear, "linear", "dB"),
                    pick(show.radians, "rad", "deg"),
                    pick(show.rad_per_s, "rad/s", "Hz"),
                    pick(show.margin, "margin", "response"),
                    pick(show.conjugated, "conjugated", "causal"),
                ]
                .join(" ");
                (name, show)
            })
            .collect()
    }
}

/// A sweep of 300 points from 40 to 5000 Hz, 1 % noise in each part, five or six significant digits.
pub fn file(plant: &Plant, seed: u64, show: &Show) -> String {
    let mut d = Draw(seed ^ 0xabcd_ef01);
    let mut text = String::new();
    if show.header {
        let _ = writeln!(
            text,
            "Frequency ({})\tMagnitude ({})\tPhase ({})",
            if show.rad_per_s { "rad/s" } else { "Hz" },
            if show.linear { "abs" } else { "dB" },
            if show.radians { "rad" } else { "deg" }
        );
    }
    for i in 0..300 {
        let hz = 40.0 * (5000f64 / 40.0).powf(i as f64 / 299.0);
        let noise = Complex::new(1.0 + 0.01 * d.normal(), 0.01 * d.normal());
        let v = plant.at(TAU * hz) * noise;
        let mut phase = v.arg() + if show.margin { PI } else { 0.0 };
        if phase > PI {
            phase -= TAU;
        }
        if show.conjugated {
            phase = -phase;
        }
        let x = if show.rad_per_s { hz * TAU } else { hz };
        let size = if show.linear { v.norm() } else { 20.0 * v.norm().log10() };
        let angle = if show.radians { phase } else { phase.to_degrees() };
        let _ = writeln!(text, "{x:.3}\t{size:.6}\t{angle:.5}");
    }
    text
}
