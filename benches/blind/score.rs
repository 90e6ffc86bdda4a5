//! Scores diagnoses against the sealed answers: one report in Markdown and one in JSON, all counts stated.

use crate::commit;
use crate::family::inseparable;
use crate::statistics::{interval, median, overlap, power};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// From here on a name is asked for.
const NAMEABLE: f64 = 100.0;

#[derive(Default)]
struct Share {
    hits: usize,
    of: usize,
}

impl Share {
    fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }
    fn text(&self) -> String {
        if self.of == 0 {
            return "none of this kind".into();
        }
        let (low, high) = interval(self.hits, self.of);
        let share = 100.0 * self.hits as f64 / self.of as f64;
        format!(
            "{} of {} ({share:.1} %, 95 % interval {:.1} to {:.1} %)",
            self.hits,
            self.of,
            100.0 * low,
            100.0 * high
        )
    }
    fn json(&self) -> Value {
        json!({"hits": self.hits, "of": self.of})
    }
}

fn read(path: &Path) -> Option<Value> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

fn words(v: &Value) -> Vec<String> {
    v.as_array().into_iter().flatten().filter_map(|x| x.as_str().map(str::to_owned)).collect()
}

fn spans(v: &Value) -> Vec<(f64, f64)> {
    let pair = |p: &Value| Some((p.get(0)?.as_f64()?, p.get(1)?.as_f64()?));
    v.as_array().into_iter().flatten().filter_map(pair).collect()
}

/// One case, read from its answer and its diagnosis.
struct Case {
    kind: String,
    truth: Vec<String>,
    family: Vec<Vec<String>>,
    verdict: String,
    found: Vec<String>,
    findings: Vec<Value>,
    /// Smallest projected lambda of the effects; infinite where none is stated.
    lambda: f64,
    answer: Value,
    diagnosis: Value,
    seconds: Option<f64>,
}

fn case(answer: Value, ddir: &Path) -> Case {
    let id = answer["id"].as_str().unwrap_or_default().to_owned();
    let diagnosis = read(&ddir.join(&id).join("diagnosis.json")).unwrap_or(Value::Null);
    let seconds = std::fs::read_to_string(ddir.join(&id).join("seconds.txt")).ok().and_then(|t| t.trim().parse().ok());
    let findings: Vec<Value> = diagnosis["findings"].as_array().cloned().unwrap_or_default();
    let lambdas = answer["lambda"].as_object().into_iter().flatten().filter_map(|(_, l)| l["projected"].as_f64());
    Case {
        kind: answer["kind"].as_str().unwrap_or_default().into(),
        truth: words(&answer["effects"]),
        family: answer["family"].as_array().into_iter().flatten().map(words).collect(),
        verdict: diagnosis["verdict"].as_str().unwrap_or("missing").into(),
        found: findings.iter().filter_map(|f| f["effect"].as_str().map(str::to_owned)).collect(),
        findings,
        lambda: lambdas.fold(f64::INFINITY, f64::min),
        answer,
        diagnosis,
        seconds,
    }
}

impl Case {
    /// Names that the verdict stands for: a lone `family` verdict or no verdict names nothing.
    fn names(&self) -> Vec<&str> {
        let said = matches!(self.verdict.as_str(), "named" | "data_fault");
        let plain = |n: &&str| !matches!(*n, "unexplained" | "linear_parameters");
        self.found.iter().map(String::as_str).filter(plain).filter(|_| said).collect()
    }
    fn in_family(&self, name: &str) -> bool {
        self.truth.iter().any(|t| t == name) || self.family.iter().flatten().any(|f| f == name)
    }
    fn first_family(&self) -> bool {
        let named = self.found.first().is_some_and(|n| self.in_family(n));
        let told = self.findings.first().map(|f| words(&f["family"])).unwrap_or_default();
        let refit = self.verdict == "refit" && self.in_family("linear_parameters");
        named || refit || (self.verdict == "family" && told.iter().any(|n| self.truth.contains(n)))
    }
    fn harmless(&self) -> bool {
        let list = words(&self.answer["harmless"]);
        !self.found.is_empty() && self.found.iter().all(|f| list.contains(f) || f == "linear_parameters")
    }
    fn quiet(&self) -> bool {
        matches!(self.verdict.as_str(), "no_mismatch" | "refit" | "undecidable")
    }
}

pub fn score(dir: &Path, ddir: &Path, out: &Path) -> Result<(), String> {
    let root = commit::verify(dir)?;
    let cases: Vec<Case> = commit::answers(dir)?
        .iter()
        .map(|p| read(p).map(|a| case(a, ddir)).ok_or(format!("{}: unreadable", p.display())))
        .collect::<Result<_, _>>()?;
    let mut shares: BTreeMap<&str, Share> = BTreeMap::new();
    let mut add = |name: &'static str, hit: bool| shares.entry(name).or_default().add(hit);
    let mut confusion: BTreeMap<(String, String), usize> = BTreeMap::new();
    let mut curve: BTreeMap<(String, i32), (usize, usize, usize, f64)> = BTreeMap::new();
    let (mut time, mut inside, mut trusted, mut beyond) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut overlaps: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut errors: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut list = Vec::new();
    for c in &cases {
        add("01 diagnosis present", c.verdict != "missing");
        time.extend(c.seconds);
        let top = c.found.first().map_or(c.verdict.as_str(), String::as_str);
        *confusion.entry((c.truth.join(" + "), top.to_owned())).or_default() += 1;
        list.push(json!({"id": c.answer["id"], "kind": c.kind, "truth": c.truth, "verdict": c.verdict, "found": c.found,
            "lambda": if c.lambda.is_finite() { json!(c.lambda) } else { Value::Null }, "tier": c.answer["tier"], "seconds": c.seconds}));
        if c.verdict == "missing" && matches!(c.kind.as_str(), "null" | "p58_null" | "linear" | "outside") {
            // No answer is no false alarm, and nothing right either.
            match c.kind.as_str() {
                "linear" => add("06 linear parameters off: refit said", false),
                "outside" => {
                    add("16 outside the library: not given a name", false);
                    add("17 outside the library: located_unexplained or family", false);
                }
                _ => add("04 nulls with a clean model: no_mismatch said", false),
            }
            continue;
        }
        let wrong = c.names().iter().any(|n| !c.in_family(n) && !words(&c.answer["harmless"]).iter().any(|h| h == n));
        add("10 forced wrong name (all cases)", wrong);
        match c.kind.as_str() {
            "null" | "p58_null" => {
                add("02 false alarms on nulls", !c.quiet() && !c.harmless());
                add("03 nulls with only a noise finding that is true", !c.quiet() && c.harmless());
                if c.answer["tier"] == json!("clean") {
                    add("04 nulls with a clean model: no_mismatch said", c.verdict == "no_mismatch");
                }
            }
            "linear" => {
                add("05 false alarms where only linear parameters are off", !c.quiet() && !c.harmless());
                add("06 linear parameters off: refit said", c.verdict == "refit");
            }
            "single" => {
                let found = !matches!(c.verdict.as_str(), "no_mismatch" | "undecidable" | "missing");
                let key = if c.lambda < 30.0 {
                    "11 singles found, lambda under 30"
                } else if c.lambda < NAMEABLE {
                    "12 singles found, lambda 30 to 100"
                } else {
                    "13 singles found, lambda from 100"
                };
                add(key, found);
                let right = c.found.first() == c.truth.first() && matches!(c.verdict.as_str(), "named" | "data_fault");
                if c.lambda >= NAMEABLE && !c.truth.iter().any(|t| inseparable(t)) {
                    add("07 singles from lambda 100, no twin law: first name right", right);
                }
                if c.lambda >= NAMEABLE {
                    add("07 singles from lambda 100: first name right", right);
                    add("08 singles from lambda 100: family right", c.first_family());
                } else {
                    add("09 singles under lambda 100: family right", c.first_family());
                }
                if c.lambda.is_finite() {
                    let step = (2.0 * c.lambda.max(1.0).log10()).floor() as i32;
                    let e = curve.entry((c.truth.join(""), step)).or_default();
                    e.0 += 1;
                    e.1 += usize::from(found);
                    e.2 += usize::from(right);
                    e.3 += power(c.lambda);
                }
            }
            "pair" => {
                let hits = c.truth.iter().filter(|t| c.found.contains(t)).count();
                add("14 pairs: both named", hits == 2);
                add("15 pairs: at least one named", hits >= 1);
            }
            "outside" => {
                add("16 outside the library: not given a name", c.names().is_empty());
                add(
                    "17 outside the library: located_unexplained or family",
                    matches!(c.verdict.as_str(), "located_unexplained" | "family"),
                );
            }
            "fault" => {
                let told = c.verdict == "data_fault" || c.found.iter().any(|f| c.in_family(f));
                add("18 data faults: said to be one", told);
                add("19 data faults with a library name: named", c.truth.iter().all(|t| c.found.contains(t)));
            }
            "p58" => {
                add("20 showcase: pivot friction named", c.found.iter().any(|f| f == "pivot_friction"));
                add("21 showcase: all three named", c.truth.iter().all(|t| c.found.contains(t)));
            }
            _ => {}
        }
        let fit = &c.diagnosis["fit"]["holdout"];
        if let (Some(after), Some(floor)) = (fit["rms_after"].as_f64(), fit["noise_floor"].as_f64()) {
            inside.push(after / floor);
        }
        // The floor as the generator knows it; record by record where the diagnosis lists its records.
        let sigma = c.answer["sigma"].as_f64().unwrap_or(f64::NAN);
        trusted.extend(fit["rms_after"].as_f64().map(|a| a / sigma));
        for r in c.diagnosis["fit"]["records"].as_array().into_iter().flatten() {
            let file = r["file"].as_str().or(r["record"].as_str()).unwrap_or_default();
            let known = c.answer["records"]
                .as_object()
                .into_iter()
                .flatten()
                .find(|(n, v)| file.contains(n.as_str()) && v["beyond"] == json!(true));
            if let (Some(_), Some(after)) = (known, r["rms_after"].as_f64()) {
                beyond.push(after / sigma);
            }
        }
        for finding in &c.findings {
            let name = finding["effect"].as_str().unwrap_or_default();
            let place = &c.answer["where"][name];
            for key in ["time_s", "frequency_hz", "position"] {
                let (a, b) = (spans(&place[key]), spans(&finding["where"][key]));
                if !a.is_empty() && !b.is_empty() {
                    overlaps.entry(key).or_default().push(overlap(&a, &b));
                }
            }
            for (p, told) in finding["parameters"].as_object().into_iter().flatten() {
                let (Some(v), Some(t)) = (told["value"].as_f64(), c.answer["answer"][name][p].as_f64()) else {
                    continue;
                };
                errors.entry(format!("{name}.{p}")).or_default().push((v - t).abs() / t.abs().max(1e-300));
                if let (Some(low), Some(high)) = (told["low"].as_f64(), told["high"].as_f64()) {
                    add("22 parameter intervals that hold the truth", low <= t && t <= high);
                }
            }
        }
    }
    let mut md = format!(
        "# Sealed mismatch cases\n\nMerkle root `{root}` verified; {} cases.\n\n| figure | count |\n|---|---|\n",
        cases.len()
    );
    for (name, s) in &shares {
        let _ = writeln!(md, "| {} | {} |", &name[3..], s.text());
    }
    let mid = |v: &mut Vec<f64>| median(v).map_or("not reported".into(), |m| format!("{m:.3} (of {})", v.len()));
    let most = time.iter().copied().fold(0.0, f64::max);
    let _ = writeln!(md, "| hold-out rms over the diagnosis's own noise floor, median | {} |", mid(&mut inside));
    let _ = writeln!(md, "| hold-out rms over the true noise, median | {} |", mid(&mut trusted));
    let _ = writeln!(
        md,
        "| hold-out beyond the fitted amplitude, rms over the true noise, median | {} |",
        mid(&mut beyond)
    );
    let _ = writeln!(md, "| seconds a case, median | {} |\n| seconds, most | {most:.1} |", mid(&mut time));
    for (key, v) in &mut overlaps {
        let _ = writeln!(md, "| overlap of {key}, median | {} |", mid(v));
    }
    md.push_str("\n## Power against the oracle\n\nThe oracle knows the effect and the noise; its threshold pays for 30 hypotheses at 5 % for all together.\n\n");
    md.push_str(
        "| effect | lambda from | to | cases | found | named | oracle expects |\n|---|---|---|---|---|---|---|\n",
    );
    for ((name, step), (n, found, right, oracle)) in &curve {
        let edge = |s: i32| 10f64.powf(f64::from(s) / 2.0);
        let _ = writeln!(
            md,
            "| {name} | {:.0} | {:.0} | {n} | {found} | {right} | {oracle:.2} |",
            edge(*step),
            edge(step + 1)
        );
    }
    md.push_str("\n## Parameters\n\n| parameter | cases | median relative error |\n|---|---|---|\n");
    for (name, v) in &mut errors {
        let _ = writeln!(md, "| {name} | {} | {:.4} |", v.len(), median(v).unwrap_or(f64::NAN));
    }
    md.push_str("\n## What was there, and what was said first\n\n| truth | said | cases |\n|---|---|---|\n");
    for ((truth, said), n) in &confusion {
        let _ = writeln!(md, "| {truth} | {said} | {n} |");
    }
    let figures: Map<String, Value> = shares.iter().map(|(k, s)| (k[3..].to_owned(), s.json())).collect();
    let report = json!({"root": root, "cases": list, "figures": figures, "holdout_over_floor": inside, "holdout_over_noise": trusted, "beyond_over_noise": beyond});
    if let Some(parent) = out.parent() {
        std::fs::create_dir_all(parent).map_err(|e| e.to_string())?;
    }
    let text = serde_json::to_string_pretty(&report).map_err(|e| e.to_string())?;
    std::fs::write(out.with_extension("json"), text).map_err(|e| e.to_string())?;
    std::fs::write(out.with_extension("md"), &md).map_err(|e| e.to_string())?;
    Ok(())
}
