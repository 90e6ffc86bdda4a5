//! Which cases a set holds, and making them all.

use crate::effects::{FAULTS, OUTSIDE, PAIRS, SINGLES};
use crate::make::{Order, make as make_case};
use crate::random::Random;
use crate::showcase;
use rayon::prelude::*;
use serde_json::json;
use std::path::Path;

/// Cases of the default benchmark.
const COUNT: usize = 150;

fn benchmark(seed: u64, count: usize) -> Vec<Order> {
    let mut r = Random::new(seed, 0);
    let part = |share: f64| (share * count as f64).round() as usize;
    let mut list: Vec<(&'static str, Vec<&'static str>)> = Vec::new();
    let nulls = part(0.3);
    for i in 0..nulls {
        list.push((if i % 3 == 2 { "linear" } else { "null" }, vec![]));
    }
    let mut deck: Vec<&'static str> = Vec::new();
    for _ in 0..part(0.38) {
        if deck.is_empty() {
            deck = SINGLES.to_vec();
            // The commonest come twice.
            deck.extend(&SINGLES[..8]);
            r.shuffle(&mut deck);
        }
        list.extend(deck.pop().map(|e| ("single", vec![e])));
    }
    let first = r.below(PAIRS.len());
    for i in 0..part(0.12) {
        let (a, b) = PAIRS[(first + i) % PAIRS.len()];
        list.push(("pair", vec![a, b]));
    }
    let first = r.below(OUTSIDE.len());
    for i in 0..part(0.12) {
        list.push(("outside", vec![OUTSIDE[(first + i) % OUTSIDE.len()].0]));
    }
    let first = r.below(FAULTS.len());
    while list.len() < count {
        list.push(("fault", vec![FAULTS[(first + list.len()) % FAULTS.len()]]));
    }
    r.shuffle(&mut list);
    list.into_iter()
        .enumerate()
        .map(|(i, (kind, effects))| {
            let lambda = match kind {
                "pair" | "outside" => r.log_range(100.0, 1e5),
                _ => r.log_range(10.0, 1e5),
            };
            let linear = effects.iter().any(|e| matches!(*e, "extra_delay" | "time_base_drift"));
            let absorbed = r.chance(0.55) && !matches!(kind, "linear" | "fault") && !linear;
            let id = format!("B{:03}", i + 1);
            Order { id, seed: r.bits(), kind, effects, lambda, absorbed, plain: false }
        })
        .collect()
}

fn power(seed: u64) -> Vec<Order> {
    let mut r = Random::new(seed, 1);
    let mut list = Vec::new();
    for (letter, effect) in
        ["pivot_friction", "coulomb_friction", "torque_factor_rolloff", "extra_delay"].iter().enumerate()
    {
        for step in 0..8 {
            for twin in 0..2 {
                let lambda = 2.5 * 2.4f64.powi(step);
                let id = format!("W{}{step}{twin}", letter + 1);
                list.push(Order {
                    id,
                    seed: r.bits(),
                    kind: "single",
                    effects: vec![effect],
                    lambda,
                    absorbed: false,
                    plain: true,
                });
            }
        }
    }
    list
}

fn p58(seed: u64, count: usize) -> Vec<Order> {
    let mut r = Random::new(seed, 2);
    let order =
        |id: String, kind, seed| Order { id, seed, kind, effects: vec![], lambda: 0.0, absorbed: true, plain: true };
    let mut list: Vec<Order> = (1..=count).map(|i| order(format!("P58_{i}"), "p58", r.bits())).collect();
    list.extend((1..=count).map(|i| order(format!("P58_null_{i}"), "p58_null", r.bits())));
    list
}

pub fn make(out: &Path, seed: u64, set: &str, count: Option<usize>) -> Result<(), String> {
    let cases = out.to_path_buf();
    let answers = out.join("answers");
    std::fs::create_dir_all(&answers).map_err(|e| format!("{}: {e}", answers.display()))?;
    let orders = match set {
        "benchmark" => benchmark(seed, count.unwrap_or(COUNT)),
        "power" => power(seed),
        "p58" => p58(seed, count.unwrap_or(2)),
        other => return Err(format!("unknown set {other}: benchmark, power or p58")),
    };
    let began = std::time::Instant::now();
    let made: Vec<Result<(), String>> = orders
        .par_iter()
        .map(|order| {
            for attempt in 1..=12 {
                // An effect that a machine can not show at the strength asked for gets less of it, then another machine.
                let mut order = order.clone();
                // Weak ones get more of it.
                let less = if order.lambda < 40.0 { 1.25f64 } else { 1.0 / 1.6 };
                order.lambda *= less.powi(attempt - 1);
                let answer = match order.kind {
                    "p58" | "p58_null" => showcase::make(&order, order.kind == "p58_null", &cases, attempt as u64),
                    _ => make_case(&order, &cases, attempt as u64),
                };
                if let Some(answer) = answer {
                    let file = answers.join(format!("{}.json", order.id));
                    let text = serde_json::to_string_pretty(&answer).map_err(|e| e.to_string())?;
                    return std::fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()));
                }
            }
            Err(format!("{} ({:?}) could not be made", order.id, order.effects))
        })
        .collect();
    let failed: Vec<String> = made.into_iter().filter_map(Result::err).collect();
    for f in &failed {
        eprintln!("blind: {f}");
    }
    let set = json!({"set": set, "seed": seed, "cases": orders.len() - failed.len(), "failed": failed});
    std::fs::write(out.join("set.json"), set.to_string()).map_err(|e| e.to_string())?;
    eprintln!("{} cases in {:.1} s", orders.len() - failed.len(), began.elapsed().as_secs_f64());
    Ok(())
}
