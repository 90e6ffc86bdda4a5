//! The paper's arm on a bearing that creeps before it slides, whose best linear fit at one amplitude is the paper's mode;
//! and its counterpart, where the mode is truly linear.

use crate::controller::Law;
use crate::drives::{Plan, multisine, spiral};
use crate::effects::{self, Faults, Truth};
use crate::family::family;
use crate::fit::absorb;
use crate::machine::{Mode, Plant, Units};
use crate::make::{Order, Stage, drop_at, linear, visibility};
use crate::physics::{Physics, Slip};
use crate::random::Random;
use crate::world::{Drive, Noise};
use crate::write;
use serde_json::{Map, Value, json};
use std::f64::consts::TAU;
use std::path::Path;

/// The paper's rigid mode: 369 rad/s (58.7 Hz), 0.22.
const PAPER: (f64, f64) = (369.0, 0.22);
/// Pole and zero of the paper's groups 1 to 6 (its equations 23 to 28).
const MODES: [[f64; 4]; 7] = [
    [7483.315, 0.037817, 7681.146, 0.037104],
    [11357.82, 0.0086724, 11445.52, 0.0096544],
    [15620.63, 0.0052475, 15760.75, 0.0060809],
    [21204.6, 0.069329, 21335.49, 0.064507],
    [22360.68, 0.026699, 22360.68, 0.022472],
    [27576.63, 0.011317, 28091.88, 0.01347],
    [25099.8, 0.018347, 25298.22, 0.017748],
];

fn plans(r: &mut Random, seed: u64, ts: f64, rms: f64) -> Vec<Plan> {
    let n = (0.24 / ts) as usize;
    let none = vec![0.0; n];
    let far = 11.0 * r.sign();
    let rest = |x: f64| vec![x; n];
    let list: Vec<(&str, bool, bool, f64, Vec<f64>, Vec<f64>, usize)> = vec![
        ("multisine_id", false, false, 0.0, rest(0.0), multisine(r, n, ts, rms), 3),
        ("multisine_small", false, false, 0.0, rest(0.0), multisine(r, n, ts, 0.35 * rms), 2),
        ("spiral_short", false, false, 0.0, spiral(n, ts, 0.0, 1.5, 60.0, true), none.clone(), 2),
        ("spiral_long", false, false, -far, spiral(n, ts, -far, 2.0 * far, 350.0, true), none.clone(), 2),
        ("holdout_multisine", true, true, 0.0, rest(0.0), multisine(r, n, ts, 3.0 * rms), 1),
        ("holdout_spiral", true, false, far, spiral(n, ts, far, -0.7 * far, 240.0, true), none.clone(), 1),
        ("holdout_zone", true, false, far, rest(far), multisine(r, n, ts, rms), 1),
    ];
    let mut plans = Vec::new();
    for (group, holdout, beyond, start, reference, excitation, count) in list {
        for i in 1..=count {
            let drive = Drive {
                reference: reference.clone(),
                excitation: excitation.clone(),
                command: None,
                start,
                settle: (0.04 / ts) as usize,
                clock: plans.len() as f64 * 0.4,
                seed: seed ^ (plans.len() as u64 + 1).wrapping_mul(0x2545_f491_4f6c_dd1d),
            };
            let name = if holdout { group.to_owned() } else { format!("{group}_{i}") };
            plans.push(Plan { name, group: group.to_owned(), holdout, beyond, drive });
        }
    }
    plans
}

/// Makes one showcase case (`null`: its counterpart); nothing when the search for the friction failed.
pub fn make(order: &Order, null: bool, out: &Path, attempt: u64) -> Option<Value> {
    let mut r = Random::new(order.seed, attempt);
    let ts = 39.6e-6;
    let plant = Plant {
        b: 75.0 * PAPER.0 * PAPER.0,
        k: PAPER.0 * PAPER.0,
        c: 2.0 * PAPER.1 * PAPER.0,
        delay: 65e-6,
        gain: 1.188502,
        modes: MODES.iter().map(|m| Mode { wz: m[0], zz: m[1], wp: m[2], zp: m[3] }).collect(),
    };
    let (law, ms, cross, margin) = Law::design(&plant, ts, &mut r)?;
    let noise = Noise { sigma: 0.003, colour: 0.35 };
    let rms = r.range(0.012, 0.016);
    let base = Physics { spindle_hz: 120.0, quantum: 3e-4, ..Physics::default() };
    let stage = Stage {
        ts,
        law: Some(law),
        law_figures: (ms, cross, margin),
        plant: plant.clone(),
        noise,
        plans: plans(&mut r, order.seed, ts, rms),
        base,
    };
    let mut truth =
        Truth { plant: plant.clone(), physics: stage.base.clone(), faults: Faults::default(), shocked: None };
    let (mut answer, mut small) = (Map::new(), Value::Null);
    let mut given;
    if null {
        given = absorb(&plant, &stage.take(&truth, &[0], 64)?, noise, ts, 6, false)?;
    } else {
        let mut cable = stage.truth();
        let u: [f64; 8] = std::array::from_fn(|_| r.unit());
        let facts = effects::add("cable_spring", 0.45, &u, ts, &mut cable);
        truth.physics = cable.physics;
        truth.physics.rolloff = 0.06;
        truth.plant.k = 0.0;
        let (mut w, mut length) = (TAU * 77.0, 0.03f64);
        truth.plant.c = 2.0 * 0.005 * w;
        let shape = r.bits();
        given = plant.clone();
        let mut hit = false;
        for _ in 0..16 {
            truth.physics.slip = Slip::draw(&mut Random::new(shape, 5), 40, w * w, length);
            given = absorb(&given, &stage.take(&truth, &[0], 16)?, noise, ts, 5, true)?;
            let (wf, zf) = (given.k.sqrt(), given.c / (2.0 * given.k.sqrt()));
            if (wf / PAPER.0 - 1.0).abs() < 0.006 && (zf / PAPER.1 - 1.0).abs() < 0.03 {
                hit = true;
                break;
            }
            // Stiffness moves the frequency, length the damping (a longer one slides less).
            w *= (PAPER.0 / wf).powf(0.8).clamp(0.8, 1.25);
            length *= (zf / PAPER.1).powf(0.6).clamp(0.6, 1.6);
        }
        small = json!(w / TAU);
        // What is asked of this set: a small-signal mode of 70 to 83 Hz; another bearing is drawn where it does not.
        if !hit || w < TAU * 70.0 {
            eprintln!(
                "{}: fit {:.1} Hz {:.3}, small {:.1} Hz, length {length:.4}",
                order.id,
                given.k.sqrt() / TAU,
                given.c / (2.0 * given.k.sqrt()),
                w / TAU
            );
            return None;
        }
        given = absorb(&given, &stage.take(&truth, &[0], 64)?, noise, ts, 5, true)?;
        let s = &truth.physics.slip;
        answer.insert(
            "pivot_friction".into(),
            json!({"sliding_length": s.length(), "level_command": s.level() / (plant.b * plant.gain),
            "stiffness_per_s2": s.stiffness(), "small_signal_hz": w / TAU}),
        );
        let seen: f64 = stage.plant.modes.iter().map(|m| (m.wz / m.wp).powi(2)).product();
        answer.insert("torque_factor_rolloff".into(), json!({"drop_at_15": drop_at(15.0 / seen, 0.06)}));
        answer.insert("cable_spring".into(), facts.figures.iter().map(|f| (f.0.to_owned(), json!(f.1))).collect());
    }
    let all: Vec<usize> = (0..stage.plans.len()).collect();
    let recs = stage.take(&truth, &all, 64)?;
    let seen = visibility(&stage, &given, &recs)?;
    let (projected, raw, each) = stage.lambda(&truth, true)?;
    let units = Units { length: 1.0, command: 1.0, length_name: "track", command_name: "V" };
    write::case(order, out, &stage, &given, &recs, &units, &mut r).ok()?;
    let names = if null { vec!["none"] } else { vec!["pivot_friction", "torque_factor_rolloff", "cable_spring"] };
    let families: Vec<Vec<&str>> = names.iter().map(|n| family(n).to_vec()).collect();
    let roles: Map<String, Value> =
        stage.plans.iter().map(|p| (p.name.clone(), json!({"holdout": p.holdout, "beyond": p.beyond}))).collect();
    Some(json!({
        "id": order.id, "kind": if null { "p58_null" } else { "p58" }, "effects": names, "family": families, "answer": answer,
        "where": {}, "outside": null, "fault": null, "tier": "absorbed",
        "lambda": {"all": {"projected": projected, "raw": raw, "records": each}}, "visibility": seen,
        "harmless": ["quantisation", "encoder_noise"], "records": roles, "sigma": noise.sigma, "noise_colour": noise.colour,
        "units": {"position": "track", "command": "V"}, "sample_time_s": ts, "closed_loop": true,
        "Ms": ms, "crossover": cross, "phase_margin": margin, "small_signal_hz": small,
        "truth": linear(&truth.plant, &units), "given": linear(&given, &units),
        "given_hz": given.k.sqrt() / TAU, "given_damping": given.c / (2.0 * given.k.sqrt()),
    }))
}
