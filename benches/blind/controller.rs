//! The contract's discrete law, its response, and gains by loop shaping with a check of stability and of Ms.

use crate::complex::C;
use crate::machine::{Plant, Units};
use crate::random::Random;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

#[derive(Clone, Debug)]
pub struct Law {
    pub ts: f64,
    pub limit: f64,
    pub kp: f64,
    pub ki: f64,
    pub kd: f64,
    pub tf: f64,
    /// (hertz, damping)
    pub lowpass: Vec<(f64, f64)>,
    /// (hertz, zero damping, pole damping)
    pub notch: Vec<(f64, f64, f64)>,
}

/// b0 b1 b2 a1 a2.
type Section = [f64; 5];

/// Bilinear transform, prewarped at w, of (n2 s^2 + n1 s + n0)/(s^2 + d1 s + d0).
fn bilinear(w: f64, t: f64, n: [f64; 3], d: [f64; 2]) -> Section {
    let g = w / (w * t / 2.0).tan();
    let a0 = g * g + d[0] * g + d[1];
    let b = |s: f64| n[0] * g * g + s * n[1] * g + n[2];
    [
        b(1.0) / a0,
        2.0 * (n[2] - n[0] * g * g) / a0,
        b(-1.0) / a0,
        2.0 * (d[1] - g * g) / a0,
        (g * g - d[0] * g + d[1]) / a0,
    ]
}

impl Law {
    pub fn sections(&self) -> Vec<Section> {
        let low = self.lowpass.iter().map(|&(f, d)| {
            let w = TAU * f;
            bilinear(w, self.ts, [0.0, 0.0, w * w], [2.0 * d * w, w * w])
        });
        let notch = self.notch.iter().map(|&(f, dz, dp)| {
            let w = TAU * f;
            bilinear(w, self.ts, [1.0, 2.0 * dz * w, w * w], [2.0 * dp * w, w * w])
        });
        low.chain(notch).collect()
    }

    pub fn response(&self, w: f64) -> C {
        let one = C::new(1.0, 0.0);
        let z1 = C::polar(1.0, -w * self.ts);
        let d = one - z1;
        let mut c = C::new(self.kp, 0.0)
            + C::new(self.ki * self.ts, 0.0) / d
            + d * self.kd / (C::new(self.ts, 0.0) + d * self.tf);
        for s in self.sections() {
            let z2 = z1 * z1;
            c = c * (C::new(s[0], 0.0) + z1 * s[1] + z2 * s[2]) / (one + z1 * s[3] + z2 * s[4]);
        }
        c
    }

    /// Loop with the hold; aliases above Nyquist are left out (the step test of the case catches what they would do).
    pub fn open_loop(&self, plant: &Plant, w: f64) -> C {
        let x = w * self.ts / 2.0;
        plant.response(w) * C::polar(x.sin() / x, -x) * self.response(w)
    }

    /// (Ms, crossover in Hz, phase margin in degrees), or nothing when the loop is not stable by its crossings.
    pub fn judge(&self, plant: &Plant) -> Option<(f64, f64, f64)> {
        let n = 3000;
        let (low, high) = (2.0f64, 0.49 / self.ts);
        let (mut ms, mut cross, mut margin) = (0.0f64, 0.0, 0.0);
        let mut before = C::new(0.0, 0.0);
        for i in 0..=n {
            let f = low * (high / low).powf(i as f64 / n as f64);
            let l = self.open_loop(plant, TAU * f);
            ms = ms.max(1.0 / (l + C::new(1.0, 0.0)).abs());
            if i > 0 && before.abs() > 1.0 && l.abs() <= 1.0 {
                let m = (l.arg() + PI).rem_euclid(TAU);
                let m = if m > PI { m - TAU } else { m };
                if cross == 0.0 {
                    cross = f;
                    margin = m.to_degrees();
                }
            }
            // A crossing of the real axis left of -1 above the gain crossover is an encirclement.
            if i > 0 && cross > 0.0 && l.abs() > 1.0 && l.re < 0.0 && before.im.signum() != l.im.signum() {
                return None;
            }
            before = l;
        }
        (cross > 0.0 && margin > 20.0).then_some((ms, cross, margin))
    }

    /// Gains for the plant: PID by the crossover asked for, notch on the strongest mode, low-pass.
    pub fn design(plant: &Plant, ts: f64, r: &mut Random) -> Option<(Law, f64, f64, f64)> {
        let mut fc = r.range(430.0, 620.0) * (110e-6 / (plant.delay + ts)).min(1.15);
        for _ in 0..30 {
            let wc = TAU * fc;
            let strongest =
                plant.modes.iter().max_by(|a, b| plant.response(a.wp).abs().total_cmp(&plant.response(b.wp).abs()))?;
            let kd = 1.0;
            let kp = kd * wc / r.range(2.6, 3.6);
            let ki = kp * wc / r.range(12.0, 25.0);
            let mut law = Law {
                ts,
                limit: 10.0,
                kp,
                ki,
                kd,
                tf: r.range(0.2, 0.6) * ts,
                lowpass: vec![((12.0 * fc).min(0.38 / ts), 0.7)],
                notch: vec![(strongest.wp / TAU, 0.05, 0.25)],
            };
            let g = 1.0 / law.open_loop(plant, wc).abs();
            law.kp *= g;
            law.ki *= g;
            law.kd *= g;
            if let Some((ms, cross, margin)) = law.judge(plant) {
                if ms < 2.5 {
                    return Some((law, ms, cross, margin));
                }
            }
            fc *= 0.93;
        }
        None
    }

    /// Gains to so many digits.
    pub fn rounded(mut self, digits: usize) -> Self {
        for g in [&mut self.kp, &mut self.ki, &mut self.kd] {
            *g = format!("{:.*e}", digits, *g).parse().unwrap_or(*g);
        }
        self
    }

    pub fn toml(&self, units: &Units) -> String {
        let scale = units.command / units.length;
        let mut t =
            format!("sample_time_s = {:e}\noutput_limit = {:e}\n\n[pid]\n", self.ts, self.limit * units.command);
        let _ = writeln!(t, "kp = {:e}\nki_per_s = {:e}", self.kp * scale, self.ki * scale);
        let _ = writeln!(t, "kd_s = {:e}\nderivative_filter_s = {:e}", self.kd * scale, self.tf);
        for (f, d) in &self.lowpass {
            let _ = writeln!(t, "\n[[lowpass]]\nfrequency_hz = {f}\ndamping_ratio = {d}");
        }
        for (f, z, p) in &self.notch {
            let _ = writeln!(t, "\n[[notch]]\nfrequency_hz = {f}\nzero_damping_ratio = {z}\npole_damping_ratio = {p}");
        }
        t
    }
}

/// The law at work.
pub struct Running {
    law: Law,
    sections: Vec<Section>,
    states: Vec<[f64; 2]>,
    sum: f64,
    slope: f64,
    last: f64,
}

impl Running {
    /// Starts at rest with a steady command `u0`; `rounded` runs the sections in single precision coefficients.
    pub fn new(law: &Law, u0: f64, rounded: bool) -> Self {
        let mut sections = law.sections();
        if rounded {
            sections.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        }
        let states = sections.iter().map(|s| [u0 * (1.0 - s[0]), u0 * (s[2] - s[4])]).collect();
        Self { law: law.clone(), sections, states, sum: u0, slope: 0.0, last: 0.0 }
    }

    pub fn step(&mut self, e: f64) -> f64 {
        let l = &self.law;
        self.sum += l.ki * l.ts * e;
        // D = kd (1 - z1)/(T + Tf (1 - z1)).
        self.slope = (l.kd * (e - self.last) + l.tf * self.slope) / (l.ts + l.tf);
        self.last = e;
        let mut x = l.kp * e + self.sum + self.slope;
        for (s, q) in self.sections.iter().zip(&mut self.states) {
            let y = s[0] * x + q[0];
            q[0] = s[1] * x - s[3] * y + q[1];
            q[1] = s[2] * x - s[4] * y;
            x = y;
        }
        x.clamp(-l.limit, l.limit)
    }
}
