//! Builds one sealed case: machine, controller, records, strength by the oracle's lambda, given model, answer.

use crate::controller::Law;
use crate::drives::{Plan, Wishes, plans};
use crate::effects::{self, Fact, Faults, OUTSIDE, Truth};
use crate::family::family;
use crate::fit::{Recorded, absorb, lambda};
use crate::machine::{Plant, Units};
use crate::physics::Physics;
use crate::random::Random;
use crate::world::{Noise, Track, run};
use crate::write;
use serde_json::{Map, Value, json};
use std::path::Path;

/// What a case is to hold.
#[derive(Clone, Debug)]
pub struct Order {
    pub id: String,
    pub seed: u64,
    /// null, linear, single, pair, outside, fault
    pub kind: &'static str,
    pub effects: Vec<&'static str>,
    pub lambda: f64,
    pub absorbed: bool,
    /// Plain records: closed loop, two amplitudes, repeats.
    pub plain: bool,
}

const FINE: usize = 64;
const SEARCH: usize = 16;

/// A case before its records are written.
pub struct Stage {
    pub ts: f64,
    pub law: Option<Law>,
    pub law_figures: (f64, f64, f64),
    pub plant: Plant,
    pub noise: Noise,
    pub plans: Vec<Plan>,
    pub base: Physics,
}

/// Applies the faults of the data to a record.
pub fn deliver(track: &Track, plan: &Plan, faults: &Faults, index: usize) -> Recorded {
    let n = track.clean.len();
    let mut rec = Recorded {
        reference: plan.drive.reference.clone(),
        excitation: plan.drive.excitation.clone(),
        command: track.command.clone(),
        clean: track.clean.clone(),
        noise: track.noise.clone(),
        head: track.head.clone(),
        spindle: track.spindle.clone(),
        start: plan.drive.start,
    };
    if faults.shift != 0.0 {
        // Cubic Lagrange of the clean reading; the noise is of the reader, so it is not shifted.
        for k in 0..n {
            let at = (k as f64 - faults.shift).clamp(1.0, n as f64 - 3.0);
            let i = at.floor() as usize;
            let f = at - i as f64;
            let y = &track.clean[i - 1..i + 3];
            rec.clean[k] = y[0] * (-f * (f - 1.0) * (f - 2.0) / 6.0)
                + y[1] * ((f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0)
                + y[2] * (-(f + 1.0) * f * (f - 2.0) / 2.0)
                + y[3] * ((f + 1.0) * f * (f - 1.0) / 6.0);
        }
    }
    if faults.factor != 0.0 {
        rec.clean.iter_mut().chain(&mut rec.noise).for_each(|x| *x *= faults.factor);
    }
    if faults.only.is_empty() || faults.only.contains(&index) {
        for &(share, count) in &faults.stuck {
            let k = (share * n as f64) as usize;
            for i in k..(k + count).min(n) {
                rec.clean[i] = rec.clean[k - 1];
                rec.noise[i] = rec.noise[k - 1];
            }
        }
        for &(share, count) in faults.lost.iter().rev() {
            let k = (share * n as f64) as usize;
            // The position column alone lost rows at its own buffer; the rest of the row stayed.
            for column in [&mut rec.clean, &mut rec.noise] {
                column.drain(k..(k + count).min(n));
            }
        }
        let left = rec.clean.len();
        for column in [&mut rec.reference, &mut rec.excitation, &mut rec.command, &mut rec.head, &mut rec.spindle] {
            column.truncate(left);
        }
    }
    rec
}

impl Stage {
    pub fn draw(order: &Order, r: &mut Random) -> Option<Self> {
        let ts = match r.below(10) {
            0 if !order.plain => 100e-6,
            1..=3 => 39.6e-6,
            _ => (r.range(22e-6, 60e-6) * 1e7).round() / 1e7,
        };
        let free = !order.plain && r.chance(0.12) && !order.effects.contains(&"nonlinear_spring");
        let plant = Plant::random(r, ts, free);
        let (law, ms, cross, margin) = Law::design(&plant, ts, r)?;
        // Gains as the file will say them.
        let law = if r.chance(0.3) { law.rounded(5) } else { law };
        let noise = Noise { sigma: 0.003, colour: if r.chance(0.35) { r.range(0.2, 0.6) } else { 0.0 } };
        let wishes = Wishes {
            ts,
            seconds: if order.plain { 0.24 } else { *r.pick(&[0.2, 0.24, 0.24, 0.3]) },
            repeats: order.plain || r.chance(0.85),
            one_amplitude: !order.plain && r.chance(0.15),
            small: r.range(0.03, 0.07),
            ratio: r.range(2.4, 3.4),
            reach: r.range(12.0, 16.0),
            speed: r.range(220.0, 420.0),
        };
        let open = !free && !order.plain && r.chance(0.12) && !order.effects.contains(&"controller_mismatch");
        let mut plans = plans(r, &wishes, order.seed);
        let mut base = Physics { spindle_hz: *r.pick(&[90.0, 120.0, 120.0, 100.0, 150.0]), ..Physics::default() };
        if open {
            // The command of the linear loop becomes a given command.
            for plan in &mut plans {
                let quiet = Noise { sigma: 0.0, colour: 0.0 };
                let t = run(&plant, &Physics::default(), Some(&law), &plan.drive, quiet, ts, 4)?;
                plan.drive.command = Some(t.command.iter().map(|u| (u * 1e8).round() / 1e8).collect());
            }
        }
        if r.chance(0.5) {
            base.quantum = noise.sigma * r.range(0.02, 0.2);
        }
        // The oracle's noise is the sensor's: beside an effect no windage.
        if r.chance(0.2) && matches!(order.kind, "null" | "linear") {
            base.windage = noise.sigma * 0.04 * plant.k.max(1e5) / plant.b;
            base.windage_hz = 60.0;
        }
        Some(Self { ts, law: (!open).then_some(law), law_figures: (ms, cross, margin), plant, noise, plans, base })
    }

    pub fn truth(&self) -> Truth {
        Truth { plant: self.plant.clone(), physics: self.base.clone(), faults: Faults::default(), shocked: None }
    }

    /// Runs the records asked for.
    pub fn take(&self, t: &Truth, which: &[usize], fine: usize) -> Option<Vec<Recorded>> {
        let take = |&i: &usize| {
            let plan = &self.plans[i];
            let mut p = t.physics.clone();
            if t.shocked.is_some_and(|s| s != i) {
                p.shock = 0.0;
            }
            let track = run(&t.plant, &p, self.law.as_ref(), &plan.drive, self.noise, self.ts, fine)?;
            let rec = deliver(&track, plan, &t.faults, i);
            rec.clean.iter().all(|x| x.abs() < 200.0 * t.faults.factor.abs().max(1.0)).then_some(rec)
        };
        which.iter().map(take).collect()
    }

    /// First record of each fitted group, and (with a fault in record 1) that one.
    pub fn few(&self) -> Vec<usize> {
        let mut seen: Vec<&str> = Vec::new();
        let mut list = Vec::new();
        for (i, p) in self.plans.iter().enumerate() {
            if !p.holdout && (!seen.contains(&p.group.as_str()) || i == 1) {
                seen.push(&p.group);
                list.push(i);
            }
        }
        list
    }

    /// Oracle lambda of a truth over all fitted records, from one record of each group.
    pub fn lambda(&self, t: &Truth, modes: bool) -> Option<(f64, f64, Vec<f64>)> {
        let few = self.few();
        let mut quiet = t.clone();
        if self.base.quantum > 0.0 && (t.physics.quantum - self.base.quantum).abs() < 1e-15 {
            quiet.physics.quantum = 0.0;
        }
        if t.physics.windage == self.base.windage {
            quiet.physics.windage = 0.0;
        }
        let recs = self.take(&quiet, &few, SEARCH)?;
        let (p, raw, each) = lambda(&self.plant, &recs, self.noise, self.ts, t.physics.extra_delay > 0.0, modes)?;
        // Repeats count in proportion.
        let fitted = self.plans.iter().filter(|p| !p.holdout).count() as f64 / few.len() as f64;
        let fitted = if t.shocked.is_some() || !t.faults.only.is_empty() { 1.0 } else { fitted };
        (p.is_finite()).then_some((p * fitted, raw * fitted, each))
    }
}

fn put(name: &str, q: f64, u: &[f64; 8], ts: f64, t: &mut Truth) -> Fact {
    match OUTSIDE.iter().find(|o| o.0 == name) {
        Some((_, kind)) => effects::add_outside(*kind, q, u, t),
        None => effects::add(name, q, u, ts, t),
    }
}

/// Strength whose lambda is near the one asked for (bisection in the effect's own logarithmic strength).
fn strength(stage: &Stage, name: &str, u: &[f64; 8], want: f64) -> Option<f64> {
    let at = |q: f64| {
        let mut t = stage.truth();
        put(name, q, u, stage.ts, &mut t);
        stage.lambda(&t, false).map(|l| l.0)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..8 {
        let q = (low + high) / 2.0;
        match at(q) {
            Some(l) if l < want => {
                low = q;
                if l > want / 1.4 {
                    return Some(q);
                }
            }
            Some(l) if l < want * 1.4 => return Some(q),
            _ => high = q,
        }
    }
    Some(if low > 0.0 { low } else { return None })
}

/// Makes and writes the case; nothing when this draw could not be made (the caller draws again).
pub fn make(order: &Order, out: &Path, attempt: u64) -> Option<Value> {
    let mut r = Random::new(order.seed, attempt);
    let stage = Stage::draw(order, &mut r)?;
    let mut truth = stage.truth();
    let mut answer = Map::new();
    let mut places = Map::new();
    let mut lambdas = Map::new();
    let mut facts: Vec<(&str, Fact)> = Vec::new();
    let scale = units(&mut r, order.plain);
    for name in &order.effects {
        let mut u = [0.0; 8];
        u.iter_mut().for_each(|u| *u = r.unit());
        let graded = !matches!(order.kind, "fault") && *name != "controller_mismatch";
        let q = if graded { strength(&stage, name, &u, order.lambda)? } else { r.range(0.3, 1.0) };
        let mut alone = stage.truth();
        put(name, q, &u, stage.ts, &mut alone);
        let (projected, raw, each) = stage.lambda(&alone, true)?;
        let named = contract_name(name);
        let noted = if graded { json!(projected) } else { Value::Null };
        lambdas.insert(named.into(), json!({"projected": noted, "raw": raw, "records": each, "strength": q}));
        let fact = put(name, q, &u, stage.ts, &mut truth);
        facts.push((named, fact));
    }
    // Positions are told as recorded: the arm's own, seen through its modes at rest.
    let seen: f64 = stage.plant.modes.iter().map(|m| (m.wz / m.wp).powi(2)).product();
    for (named, fact) in &facts {
        let figures: Map<String, Value> = fact
            .figures
            .iter()
            .map(|(n, v, l, c)| {
                let v = if *n == "drop_at_15" { drop_at(15.0 / scale.length / seen, *v) } else { *v };
                ((*n).to_owned(), json!(v * scale.length.powi(*l) * scale.command.powi(*c)))
            })
            .collect();
        answer.insert((*named).into(), Value::Object(figures));
        places.insert((*named).into(), fact.place.clone());
    }
    let all: Vec<usize> = (0..stage.plans.len()).collect();
    let recs = stage.take(&truth, &all, FINE)?;
    let mut given = stage.plant.clone();
    if order.kind == "linear" {
        let mut off = || 1.0 + r.sign() * r.range(0.01, 0.05);
        given.b *= off();
        given.k *= off();
        given.c *= off();
        given.delay *= off();
        if r.chance(0.5) {
            let (i, f) = (r.below(given.modes.len()), 1.0 + r.sign() * r.range(0.003, 0.015));
            given.modes[i].wp *= f;
            given.modes[i].wz *= f;
        }
    }
    if order.absorbed {
        let multisines: Vec<usize> = (0..all.len())
            .filter(|&i| stage.plans[i].group.starts_with("multisine") && !stage.plans[i].holdout)
            .collect();
        let one = *r.pick(&multisines);
        given = absorb(&stage.plant, &recs[one..=one], stage.noise, stage.ts, 6, false)?;
    }
    let seen = visibility(&stage, &given, &recs)?;
    if facts.is_empty() {
        let (projected, raw, _) = stage.lambda(&truth, true)?;
        lambdas.insert("numerical".into(), json!({"projected": projected, "raw": raw}));
    }
    write::case(order, out, &stage, &given, &recs, &scale, &mut r).ok()?;
    let names: Vec<&str> = match order.kind {
        "null" => vec!["none"],
        "linear" => vec!["linear_parameters"],
        "outside" => vec!["unexplained"],
        _ => facts.iter().map(|f| f.0).collect(),
    };
    let families: Vec<Vec<&str>> = names.iter().map(|n| family(n).to_vec()).collect();
    let mut harmless = Vec::new();
    if stage.base.quantum > 0.0 {
        harmless.push("quantisation");
    }
    if stage.base.windage > 0.0 {
        harmless.push("broadband_disturbance");
    }
    if stage.noise.colour > 0.0 {
        harmless.push("encoder_noise");
    }
    let (ms, cross, margin) = stage.law_figures;
    let roles: Map<String, Value> =
        stage.plans.iter().map(|p| (p.name.clone(), json!({"holdout": p.holdout, "beyond": p.beyond}))).collect();
    Some(json!({
        "id": order.id, "kind": order.kind, "effects": names, "family": families, "answer": answer, "where": places,
        "outside": if order.kind == "outside" { json!(order.effects) } else { Value::Null },
        "fault": if order.kind == "fault" { json!(order.effects) } else { Value::Null },
        "tier": if order.absorbed { "absorbed" } else { "clean" },
        "lambda": lambdas, "visibility": seen, "harmless": harmless, "records": roles,
        "sigma": stage.noise.sigma * scale.length, "noise_colour": stage.noise.colour,
        "units": {"position": scale.length_name, "command": scale.command_name},
        "sample_time_s": stage.ts, "closed_loop": stage.law.is_some(),
        "Ms": ms, "crossover": cross, "phase_margin": margin,
        "truth": linear(&stage.plant, &scale), "given": linear(&given, &scale),
    }))
}

pub fn contract_name(name: &str) -> &str {
    match name {
        "misalignment_whole" | "misalignment_part" => "misalignment",
        "stuck_samples" => "lost_samples",
        n if OUTSIDE.iter().any(|o| o.0 == n) => "unexplained",
        n => n,
    }
}

pub fn linear(p: &Plant, s: &Units) -> Value {
    let w = p.k.sqrt();
    json!({"acceleration_gain": p.b * p.gain * s.length / s.command, "w0": w, "viscous_rate_per_s": p.c,
        "z0": if w > 0.0 { json!(p.c / (2.0 * w)) } else { Value::Null }, "delay": p.delay})
}

/// Rms difference of recording and closed-loop simulation of the given model over the noise, record by record.
pub fn visibility(stage: &Stage, given: &Plant, recs: &[Recorded]) -> Option<Map<String, Value>> {
    let mut map = Map::new();
    for (plan, rec) in stage.plans.iter().zip(recs) {
        let quiet = Noise { sigma: 0.0, colour: 0.0 };
        let Some(sim) = run(given, &Physics::default(), stage.law.as_ref(), &plan.drive, quiet, stage.ts, 8) else {
            map.insert(plan.name.clone(), Value::Null);
            continue;
        };
        let n = rec.clean.len();
        let ss: f64 = (0..n).map(|i| (rec.clean[i] + rec.noise[i] - sim.clean[i]).powi(2)).sum();
        map.insert(plan.name.clone(), json!((ss / n as f64).sqrt() / stage.noise.sigma));
    }
    Some(map)
}

/// Fall of the torque factor where the arm stands at `x` tracks, of a machine whose field has fallen by `drop` at 15 tracks.
pub fn drop_at(x: f64, drop: f64) -> f64 {
    let fall = drop / (1.0 - drop) * (x / 15.0).powi(2);
    fall / (1.0 + fall)
}

fn units(r: &mut Random, plain: bool) -> Units {
    let lengths = [("track", 1.0), ("track", 1.0), ("um", 0.25), ("urad", 4.0), ("rad", 1e-6), ("nm", 250.0)];
    let commands = [("V", 1.0), ("V", 1.0), ("count", 3276.8), ("A", 0.4)];
    let (length_name, length) = if plain { lengths[0] } else { *r.pick(&lengths) };
    let (command_name, command) = if plain { commands[0] } else { *r.pick(&commands) };
    Units { length, command, length_name, command_name }
}
