//! Torques that the product's library does not know.

use crate::physics::{Outside, Physics};
use crate::random::Random;
use std::f64::consts::TAU;

pub struct Stranger {
    kind: Outside,
    level: f64,
    scale: f64,
    draw: Random,
    states: Vec<f64>,
    x: f64,
    next: f64,
    now: f64,
    past: Vec<f64>,
}

impl Stranger {
    pub fn new(p: &Physics, x: f64, seed: u64) -> Self {
        let mut draw = Random::new(seed, 0x0075);
        let next = draw.range(0.0, 0.03);
        let now = draw.sign();
        let states = match p.outside {
            Outside::FractionalCable => vec![x; 9],
            Outside::Preisach => vec![-1.0; 12],
            _ => vec![0.0; 4],
        };
        Self {
            kind: p.outside,
            level: p.outside_level,
            scale: p.outside_scale,
            draw,
            states,
            x,
            next,
            now,
            past: Vec::new(),
        }
    }

    /// Torque in V, held over one sample.
    pub fn torque(&mut self, x: f64, v: f64, t: f64, dt: f64) -> f64 {
        let dx = x - self.x;
        self.x = x;
        let (level, scale) = (self.level, self.scale);
        match self.kind {
            Outside::None => 0.0,
            Outside::Preisach => {
                // Relays whose half width grows with distance from the middle: equal reversals give unequal loops.
                let n = self.states.len() as f64;
                let mut sum = 0.0;
                for (i, s) in self.states.iter_mut().enumerate() {
                    let centre = scale * 4.0 * ((i as f64 + 0.5) / n - 0.5);
                    let half = scale * (0.15 + 0.5 * (x / scale).abs().min(3.0) * (1.0 + i as f64 / n) / 3.0);
                    let wish = ((x - centre - half * *s) / (0.1 * scale)).tanh();
                    if wish * *s < 0.0 || wish.abs() > s.abs() {
                        *s += (wish - *s) * (dt / 4e-4).min(1.0);
                    }
                    sum += *s;
                }
                -level * sum / n
            }
            Outside::SqueezeFilm => {
                // Film thickness recovers slowly; its drag acts a few milliseconds late.
                self.past.push(v);
                let late = self.past.len().saturating_sub(1 + (3e-3 / dt) as usize);
                let old = self.past[late];
                self.states[0] += (v * v / (scale * scale) - self.states[0]) * (dt / 8e-3).min(1.0);
                -level * (old / scale) / (1.0 + self.states[0].max(0.0))
            }
            Outside::FractionalCable => {
                let mut sum = 0.0;
                for (i, s) in self.states.iter_mut().enumerate() {
                    let tau = 2e-4 * 2.6f64.powi(i as i32);
                    *s += (x - *s) * (1.0 - (-dt / tau).exp());
                    sum += (x - *s) * tau.powf(-0.35);
                }
                -level * sum / (scale * 40.0)
            }
            Outside::Telegraph => {
                if t >= self.next {
                    self.now = -self.now;
                    self.next = t - 0.02 * (1.0 - self.draw.unit()).ln();
                }
                level * self.now
            }
            Outside::CoggingLatch => {
                let phase = (x / scale).rem_euclid(1.0);
                let speed = (v / (scale * 60.0)).powi(2);
                let latch = if (phase - 0.5).abs() < 0.12 { 2.5 / (1.0 + speed) } else { 0.0 };
                -level * ((TAU * phase).sin().powi(3) + latch * (phase - 0.5) / 0.12)
            }
            Outside::TwoArm => {
                // A second arm swings on the same pivot when its own moves start.
                if t >= self.next {
                    self.next = t + self.draw.range(0.03, 0.09);
                    self.now = self.draw.sign();
                    self.states[1] += self.now * 40.0;
                }
                self.states[1] +=
                    dt * (-(TAU * 90.0).powi(2) * self.states[0] - 40.0 * self.states[1] - 3.0 * v / scale);
                self.states[0] += dt * self.states[1];
                let s = self.states[0] * 14.0;
                level * (s + 0.5 * s * s * s.signum())
            }
            Outside::Gyroscopic => {
                if t >= self.next {
                    self.next = t + self.draw.range(0.04, 0.1);
                    self.states[0] = self.draw.sign();
                }
                self.states[0] *= (-dt / 6e-3).exp();
                level * self.states[0] * (v / scale)
            }
            Outside::RateHysteresis => {
                let width = if v > 0.0 { 1.0 } else { 0.45 };
                let reach = 0.4 * scale * width * (1.0 + (v.abs() / (scale * 90.0)).sqrt());
                self.states[0] = (self.states[0].max(-reach).min(reach) + dx).clamp(-reach, reach);
                -level * (self.states[0] / (0.4 * scale)) * (1.0 + 0.5 * (self.states[0] / scale).tanh())
            }
        }
    }
}
