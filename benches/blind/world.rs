//! One record of a sealed machine: exact events at the delayed command edges, Verlet steps with implicit friction in
//! between (64 a sample), modes by their exact response to a ramp over each step.

use crate::controller::{Law, Running};
use crate::machine::{Mode, Plant};
use crate::outside::Stranger;
use crate::physics::Physics;
use crate::random::Random;
use std::f64::consts::{PI, TAU};

/// What drives one record.
#[derive(Clone, Debug)]
pub struct Drive {
    pub reference: Vec<f64>,
    pub excitation: Vec<f64>,
    /// Command of an open-loop record, or of a replay.
    pub command: Option<Vec<f64>>,
    /// Rest position before the record.
    pub start: f64,
    /// Samples at rest before the record is taken.
    pub settle: usize,
    /// Wall clock at the record's first sample, s.
    pub clock: f64,
    pub seed: u64,
}

#[derive(Clone, Copy, Debug)]
pub struct Noise {
    pub sigma: f64,
    /// Correlation from sample to sample.
    pub colour: f64,
}

#[derive(Clone, Debug, Default)]
pub struct Track {
    pub command: Vec<f64>,
    /// Reading without the base noise.
    pub clean: Vec<f64>,
    pub noise: Vec<f64>,
    /// Head position: no sensor errors.
    pub head: Vec<f64>,
    pub spindle: Vec<f64>,
}

/// Exact response of a mode to a ramp over a step.
struct Stepper {
    a: [f64; 4],
    b0: [f64; 2],
    b1: [f64; 2],
}

fn stepper(m: &Mode, h: f64) -> Stepper {
    // q1' = w q2, q2' = -2 z w q2 - w q1 + w x; input x0 + (x1 - x0) t/h. Taylor series of the 4x4 exponential.
    let w = m.wp * h;
    let a = [[0.0, w, 0.0, 0.0], [-w, -2.0 * m.zp * w, w, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0; 4]];
    let mut e = [[0.0; 4]; 4];
    let mut term = [[0.0; 4]; 4];
    for i in 0..4 {
        e[i][i] = 1.0;
        term[i][i] = 1.0;
    }
    for n in 1..=24 {
        let mut next = [[0.0; 4]; 4];
        for i in 0..4 {
            for j in 0..4 {
                next[i][j] = (0..4).map(|k| term[i][k] * a[k][j]).sum::<f64>() / f64::from(n);
            }
        }
        term = next;
        for i in 0..4 {
            for j in 0..4 {
                e[i][j] += term[i][j];
            }
        }
    }
    let b1 = [e[0][3], e[1][3]];
    Stepper { a: [e[0][0], e[0][1], e[1][0], e[1][1]], b0: [e[0][2] - b1[0], e[1][2] - b1[1]], b1 }
}

struct Segment {
    steps: usize,
    h: f64,
    modes: Vec<Stepper>,
}

fn varying(m: &Mode, shift: f64, growth: f64, q: [f64; 2], x0: f64, x1: f64, h: f64) -> [f64; 2] {
    let w = m.wp * (1.0 + shift);
    let f = |q: [f64; 2], x: f64| {
        let z = m.zp * (1.0 + growth * (q[1] * q[1]).sqrt());
        [w * q[1], w * (x - q[0] - 2.0 * z * q[1])]
    };
    let at = |q: [f64; 2], k: [f64; 2], h: f64| [q[0] + h * k[0], q[1] + h * k[1]];
    let k1 = f(q, x0);
    let k2 = f(at(q, k1, h / 2.0), (x0 + x1) / 2.0);
    let k3 = f(at(q, k2, h / 2.0), (x0 + x1) / 2.0);
    let k4 = f(at(q, k3, h), x1);
    [0, 1].map(|i| q[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// Field of a magnet seen by a coil that nears its edge: 1 at the middle, `1 - drop` at 15 track.
fn field(x: f64, drop: f64) -> f64 {
    let a = (x / 15.0).powi(2);
    1.0 / (1.0 + a * drop / (1.0 - drop))
}

/// Runs one record; nothing comes back when the machine runs away.
pub fn run(
    plant: &Plant,
    p: &Physics,
    law: Option<&Law>,
    d: &Drive,
    noise: Noise,
    ts: f64,
    fine: usize,
) -> Option<Track> {
    let mut draw = Random::new(d.seed, 0x5eed);
    let dt = ts * (1.0 + p.clock);
    let delay = plant.delay + p.extra_delay;
    let whole = (delay / dt).floor() as usize;
    let part = delay - whole as f64 * dt;
    let segment = |length: f64| {
        let steps = ((length / dt * fine as f64).ceil() as usize).max(usize::from(length > 1e-12));
        let h = if steps > 0 { length / steps as f64 } else { 0.0 };
        Segment { steps, h, modes: plant.modes.iter().map(|m| stepper(m, h)).collect() }
    };
    let segments = [segment(part), segment(dt - part)];
    let b = plant.b * plant.gain;
    // The reading, not the arm, rests at the start: monic modes have a static gain of their own.
    let full: f64 = plant.modes.iter().map(|m| (m.wz / m.wp).powi(2)).product();
    let rest = d.start / full;
    let u0 = plant.k * rest / b;
    let mut law_now = law.cloned();
    if let Some(l) = &mut law_now {
        l.kp *= 1.0 + p.law_gain;
        l.kd *= 1.0 + p.law_gain;
        for n in &mut l.notch {
            n.0 *= 1.0 + p.law_notch;
        }
    }
    let mut running = law_now.as_ref().map(|l| Running::new(l, u0, d.seed.is_multiple_of(3)));
    let n = d.reference.len();
    let mut past = vec![u0; whole + 2];
    let (mut x, mut v) = (rest, 0.0f64);
    let mut slip = vec![0.0f64; p.slip.k.len()];
    let (mut slip_force, mut tip) = (0.0f64, x);
    let mut modes: Vec<[f64; 2]> = Vec::new();
    let mut dc = vec![1.0; plant.modes.len() + 1];
    for (i, m) in plant.modes.iter().enumerate() {
        modes.push([x * dc[i], 0.0]);
        dc[i + 1] = dc[i] * (m.wz / m.wp).powi(2);
    }
    let mut inputs: Vec<f64> = dc.iter().map(|g| g * x).collect();
    let out: Vec<[f64; 2]> = plant
        .modes
        .iter()
        .map(|m| [(m.wz * m.wz - m.wp * m.wp) / (m.wp * m.wp), (2.0 * m.zz * m.wz - 2.0 * m.zp * m.wp) / m.wp])
        .collect();
    let (mut amp, mut slewed) = (u0, u0);
    let (mut sensor, mut base, mut base_v) = (x * full, 0.0f64, 0.0f64);
    let (mut creep, mut bias, mut turn) = (x, 0.0, x);
    let (mut wind, mut walk, mut ar) = (0.0, 0.0, 0.0);
    let mut rate = 0.0;
    let mut stranger = Stranger::new(p, x, d.seed);
    let wb = TAU * p.base_hz;
    let spindle0 = draw.range(0.0, TAU);
    let mut track = Track::default();
    for step in 0..d.settle + n {
        let k = step.saturating_sub(d.settle);
        let live = step >= d.settle;
        let t = (step as f64 - d.settle as f64) * dt;
        // Reading.
        let y = inputs[plant.modes.len()];
        let spindle = spindle0 + TAU * p.spindle_hz * t;
        let seen = if p.sensor_hz > 0.0 { sensor } else { y };
        let mut m = seen + if p.base_ratio != 0.0 { base } else { 0.0 };
        if p.jitter > 0.0 {
            m += rate * p.jitter * draw.normal();
        }
        if p.cyclic != 0.0 {
            let a = TAU * m / p.cyclic_period + p.cyclic_phase;
            m += p.cyclic * a.cos() + p.cyclic_second * (2.0 * a).sin();
        }
        if p.scale_amplitude != 0.0 {
            m += p.scale_amplitude * ((TAU * m / p.scale_period + p.scale_phase).cos() - p.scale_phase.cos());
        }
        if p.runout != 0.0 {
            m += p.runout * (spindle + p.runout_phase).cos() + p.runout_second * (2.0 * spindle).sin();
        }
        if p.speed_noise > 0.0 {
            m += p.speed_noise * v.abs() * draw.normal();
        }
        ar = noise.colour * ar + (1.0 - noise.colour * noise.colour).sqrt() * draw.normal();
        let e = noise.sigma * ar;
        let mut read = m + e;
        if p.quantum > 0.0 {
            read = (read / p.quantum).round() * p.quantum;
        }
        // Command.
        let r = d.reference[k];
        let u = match (&d.command, &mut running) {
            (Some(c), _) => {
                if live {
                    c[k]
                } else {
                    u0
                }
            }
            (None, Some(l)) => l.step(r - read),
            (None, None) => u0,
        };
        let w = u + if live { d.excitation[k] } else { 0.0 };
        if live {
            track.command.push(u);
            track.clean.push(read - e);
            track.noise.push(e);
            track.head.push(y);
            track.spindle.push(spindle);
        }
        past.rotate_right(1);
        past[0] = w;
        // Slow torques, held over the sample.
        let mut torque = 0.0;
        if p.line != 0.0 {
            torque += p.line * (TAU * p.line_hz * (t + d.clock)).cos();
        }
        if p.windage > 0.0 {
            let rho = (-TAU * p.windage_hz * dt).exp();
            wind = rho * wind + (1.0 - rho * rho).sqrt() * draw.normal();
            torque += p.windage * wind;
        }
        if p.shock != 0.0 && t >= p.shock_at && t < p.shock_at + p.shock_length {
            torque += p.shock * (PI * (t - p.shock_at) / p.shock_length).sin();
        }
        if p.offset_rate != 0.0 && live {
            walk += p.offset_walk * dt.sqrt() * draw.normal();
            torque += p.offset_rate * t + walk;
        }
        if p.bias_level != 0.0 {
            // A way back of more than a twentieth of a track begins a new move.
            if (x - tip).abs() > 0.05 && (x - tip) * (tip - turn) < 0.0 {
                (turn, tip) = (tip, x);
            }
            if (x - tip) * (tip - turn) >= 0.0 {
                tip = x;
            }
            let run = tip - turn;
            let target = p.bias_level * (run / p.bias_length).clamp(-1.0, 1.0);
            bias += (target - bias) * (dt / p.bias_tau).min(1.0);
            torque -= bias;
        }
        if p.cable_creep != 0.0 {
            creep += (x - creep) * (dt / p.cable_tau).min(1.0);
        }
        torque += stranger.torque(x, v, t, dt);
        let mut g = 1.0;
        if p.gain_drift != 0.0 {
            g += p.gain_drift * (1.0 - (-(t + d.clock).max(0.0) / p.gain_tau).exp());
        }
        if p.gain_ripple != 0.0 {
            g += p.gain_ripple * (TAU * p.gain_ripple_hz * t + spindle0).cos();
        }
        for (s, seg) in segments.iter().enumerate() {
            let mut u = past[whole + 1 - s] * g;
            if p.dead_band > 0.0 {
                u = u.signum() * (u.abs() - p.dead_band).max(0.0);
            }
            let h = seg.h;
            for _ in 0..seg.steps {
                let mut i = u;
                if p.slew > 0.0 {
                    slewed += (i - slewed).clamp(-p.slew * h, p.slew * h);
                    i = slewed;
                }
                if p.amplifier_hz > 0.0 {
                    let before = amp;
                    amp += (i - amp) * (1.0 - (-TAU * p.amplifier_hz * h).exp());
                    i = (before + amp) / 2.0;
                }
                if p.saturation > 0.0 {
                    i = i.clamp(-p.saturation, p.saturation);
                }
                let force = |x: f64, v: f64| {
                    let mut kt = 1.0;
                    if p.rolloff != 0.0 {
                        kt = field(x, p.rolloff);
                    }
                    if p.ripple != 0.0 {
                        kt += p.ripple * (TAU * x / p.ripple_period + p.ripple_phase).cos();
                    }
                    let mut a = i * kt + torque - p.drag * v * v.abs() - p.cubic * x * x * x;
                    a -= p.cable_offset + (p.cable_linear + p.cable_quadratic * x) * x + p.cable_creep * (x - creep);
                    b * a - plant.k * x - plant.c * v
                };
                let a0 = force(x, v) - slip_force;
                let x1 = x + h * v + 0.5 * h * h * a0;
                let dx = x1 - x;
                let mut held = 0.0;
                for (z, (k, reach)) in slip.iter_mut().zip(p.slip.k.iter().zip(&p.slip.reach)) {
                    *z = (*z + dx).clamp(-*reach, *reach);
                    held += k * *z;
                }
                slip_force = held;
                let a1 = force(x1, v + h * a0) - slip_force;
                let mut v1 = v + 0.5 * h * (a0 + a1);
                let mut x2 = x1;
                if p.coulomb > 0.0 {
                    v1 = v1.signum() * (v1.abs() - b * p.coulomb * h).max(0.0);
                    x2 = x + 0.5 * h * (v + v1);
                }
                if p.base_ratio != 0.0 {
                    let a = b * i * p.base_ratio;
                    base_v += h * (-a - wb * wb * base - 2.0 * p.base_damping * wb * base_v);
                    base += h * base_v;
                }
                let mut from = inputs[0];
                let mut to = x2;
                if p.play > 0.0 {
                    to = from.clamp(x2 - p.play / 2.0, x2 + p.play / 2.0);
                }
                inputs[0] = to;
                for (j, q) in modes.iter_mut().enumerate() {
                    let st = &seg.modes[j];
                    *q = if p.mode_shift != 0.0 && p.shift_mode == j {
                        varying(&plant.modes[j], p.mode_shift * x2 / 15.0, 0.0, *q, from, to, h)
                    } else if p.damp_growth != 0.0 && p.damp_mode == j {
                        varying(&plant.modes[j], 0.0, p.damp_growth, *q, from, to, h)
                    } else {
                        [
                            st.a[0] * q[0] + st.a[1] * q[1] + st.b0[0] * from + st.b1[0] * to,
                            st.a[2] * q[0] + st.a[3] * q[1] + st.b0[1] * from + st.b1[1] * to,
                        ]
                    };
                    let y = to + out[j][0] * q[0] + out[j][1] * q[1];
                    from = inputs[j + 1];
                    inputs[j + 1] = y;
                    to = y;
                }
                rate = (to - from) / h;
                if p.sensor_hz > 0.0 {
                    sensor += ((from + to) / 2.0 - sensor) * (1.0 - (-TAU * p.sensor_hz * h).exp());
                }
                (x, v) = (x2, v1);
            }
        }
        if !(x.abs() < 400.0 && v.is_finite()) {
            return None;
        }
    }
    Some(track)
}
