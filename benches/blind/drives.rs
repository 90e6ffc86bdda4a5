//! References and excitations: random-phase multisines and constant-velocity moves, at several amplitudes and zones.

use crate::random::Random;
use crate::world::Drive;
use std::f64::consts::TAU;

/// One planned record.
#[derive(Clone, Debug)]
pub struct Plan {
    pub name: String,
    pub group: String,
    pub holdout: bool,
    /// The hold-out beyond the fitted amplitudes.
    pub beyond: bool,
    pub drive: Drive,
}

/// What a case may ask of its records.
#[derive(Clone, Copy, Debug)]
pub struct Wishes {
    pub ts: f64,
    pub seconds: f64,
    pub repeats: bool,
    pub one_amplitude: bool,
    /// Root mean square of the small multisine, V.
    pub small: f64,
    pub ratio: f64,
    /// Longest move, track.
    pub reach: f64,
    pub speed: f64,
}

pub fn multisine(r: &mut Random, n: usize, ts: f64, rms: f64) -> Vec<f64> {
    let span = n as f64 * ts;
    let top = (4500f64).min(0.4 / ts);
    let mut lines = Vec::new();
    let mut at = 1.0f64;
    while at / span < top {
        let k = at.round();
        if lines.last() != Some(&k) {
            lines.push(k);
        }
        at = (at * 1.035).max(at + 1.0);
    }
    let mut x = vec![0.0; n];
    for k in &lines {
        // Less at the top, as the amplifier's users do.
        let a = 1.0 / (1.0 + k / span / 1500.0);
        let phase = r.range(0.0, TAU);
        for (i, x) in x.iter_mut().enumerate() {
            *x += a * (TAU * k * i as f64 / n as f64 + phase).cos();
        }
    }
    let now = (x.iter().map(|x| x * x).sum::<f64>() / n as f64).sqrt();
    x.iter().map(|x| (x * rms / now * 1e6).round() / 1e6).collect()
}

/// Moves there and back at constant speed, smooth at both ends.
pub fn spiral(n: usize, ts: f64, from: f64, distance: f64, speed: f64, both: bool) -> Vec<f64> {
    let span = n as f64 * ts;
    let ramp = 2e-3;
    let travel = distance.abs() / speed;
    let mut goals = vec![(0.03 * span, distance.signum())];
    if both {
        goals.push(((0.5 * span).max(0.03 * span + travel + 6e-3), -distance.signum()));
    }
    let mut x = from;
    let mut out = Vec::with_capacity(n);
    for i in 0..n {
        let t = i as f64 * ts;
        let mut v = 0.0;
        for (start, sign) in &goals {
            let s = t - start;
            if s > 0.0 && s < travel + ramp {
                let up = (s / ramp).min(1.0).min((travel + ramp - s) / ramp);
                v += sign * speed * up.clamp(0.0, 1.0);
            }
        }
        x += v * ts;
        out.push(x);
    }
    out
}

pub fn plans(r: &mut Random, w: &Wishes, seed: u64) -> Vec<Plan> {
    let n = (w.seconds / w.ts).round() as usize;
    let mut list: Vec<(&str, bool, bool, f64, Vec<f64>, Vec<f64>, usize)> = Vec::new();
    let zone = |x: f64| vec![x; n];
    let none = vec![0.0; n];
    let many = |r: &mut Random, most: usize| if w.repeats { 2 + r.below(most - 1) } else { 1 };
    let (m1, m2, m3, m4) = (many(r, 4), many(r, 2), many(r, 3), many(r, 2));
    let (a, b) = (w.small, w.small * w.ratio);
    list.push(("multisine_a", false, false, 0.0, zone(0.0), multisine(r, n, w.ts, a), m1));
    if !w.one_amplitude {
        list.push(("multisine_b", false, false, 0.0, zone(0.0), multisine(r, n, w.ts, b), m2));
    }
    let small_move = w.reach * r.range(0.25, 0.5);
    if !w.one_amplitude {
        list.push((
            "spiral_a",
            false,
            false,
            0.0,
            spiral(n, w.ts, 0.0, small_move, w.speed * 0.6, true),
            none.clone(),
            m4,
        ));
    }
    let from = -w.reach * r.sign();
    list.push(("spiral_b", false, false, from, spiral(n, w.ts, from, -2.0 * from, w.speed, true), none.clone(), m3));
    let far = w.reach * r.range(0.4, 0.8) * r.sign();
    let between = if w.one_amplitude { a * r.range(0.7, 1.3) } else { r.range(a, b) };
    list.push(("holdout_multisine", true, false, 0.0, zone(0.0), multisine(r, n, w.ts, between), 1));
    let start = w.reach * r.range(-0.9, -0.2);
    let length = w.reach * r.range(0.8, 1.6);
    list.push((
        "holdout_spiral",
        true,
        false,
        start,
        spiral(n, w.ts, start, length, w.speed * r.range(0.7, 1.2), true),
        none.clone(),
        1,
    ));
    if r.chance(0.6) {
        let rms = if w.one_amplitude { 3.0 * a } else { (3.0 * a).max(1.5 * b).min(3.0 * b) };
        list.push(("holdout_beyond", true, true, 0.0, zone(0.0), multisine(r, n, w.ts, rms), 1));
    }
    if r.chance(0.5) {
        list.push(("holdout_zone", true, false, far, zone(far), multisine(r, n, w.ts, between), 1));
    }
    let mut plans = Vec::new();
    let mut clock = 0.0;
    for (group, holdout, beyond, start, reference, excitation, count) in list {
        for i in 1..=count {
            let name = if holdout { group.to_owned() } else { format!("{group}_{i}") };
            let drive = Drive {
                reference: reference.iter().map(|x| (x * 1e7).round() / 1e7).collect(),
                excitation: excitation.clone(),
                command: None,
                start,
                settle: (0.04 / w.ts) as usize,
                clock,
                seed: seed ^ (plans.len() as u64 + 1).wrapping_mul(0x2545_f491_4f6c_dd1d),
            };
            clock += w.seconds + 0.15;
            plans.push(Plan { name, group: group.to_owned(), holdout, beyond, drive });
        }
    }
    plans
}
