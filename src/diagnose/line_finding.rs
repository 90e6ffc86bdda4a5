//! Findings about lines whose phase differs from run to run.

use super::bench::Bench;
use super::finding::{Estimate, Finding, Where};
use super::linear::{Sampled, free_motions};
use super::lines::Line;
use super::name::{everywhere, plain, text_of};
use super::run::Run;
use super::select::Selection;
use crate::lti::FrequencyResponse;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Amplitudes of a line in every fit run under the final model (position_unit).
fn amplitudes(bench: &Bench, selection: &Selection, line: &Line) -> Vec<f64> {
    let model = &selection.model;
    let t = bench.scene.sample_time_s;
    let body = bench.form.given.body;
    let mut out = Vec::new();
    // One repeat of every segment at a time stands in for its mean.
    let most = bench.stack.segments.iter().map(|s| s.runs.len()).max().unwrap_or(0);
    for j in 0..most {
        let runs: Vec<Run> =
            bench.stack.segments.iter().map(|s| bench.runs[s.runs[j.min(s.runs.len() - 1)]].clone()).collect();
        let errors = bench.fit(model.chosen.clone()).errors_of(&model.refitted.p, &runs);
        for ((s, run), e) in bench.stack.segments.iter().zip(&runs).zip(&errors) {
            if j < s.runs.len() {
                let [a, b] = line.fit(run, &free_motions(&body, t, run.len()), t, e);
                out.push(a.hypot(b));
            }
        }
    }
    out
}

/// Mean and its 95 % interval from the spread over runs.
fn estimate(values: &[f64], scale: f64, unit: &str) -> Estimate {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let off = 1.96 * (spread / n).sqrt();
    Estimate { value: scale * mean, low: scale * (mean - off), high: scale * (mean + off), unit: unit.into() }
}

/// One finding for all orders of the spindle, one for each other line.
pub(super) fn line_findings(bench: &Bench, selection: &Selection) -> Vec<Finding> {
    let runs: Vec<&Run> = bench.fit_runs.iter().map(|&r| &bench.runs[r]).collect();
    let given = &bench.form.given;
    let make = |effect: &str, family: &[&str], lines: &[&Line], parameters: BTreeMap<String, Estimate>| {
        let (says, port) = text_of(effect);
        let strongest = lines.iter().map(|l| l.log_p).fold(0.0, f64::min);
        let place = Where { frequency_hz: lines.iter().map(|l| [l.hz, l.hz]).collect(), ..everywhere(&runs) };
        let at: Vec<String> = lines.iter().map(|l| format!("{:.3}", l.hz)).collect();
        Finding {
            effect: effect.into(),
            family: family.iter().map(|f| (*f).to_owned()).collect(),
            port,
            p_value: strongest.exp().max(1e-300),
            says: format!("At {} Hz {says}; its phase differs from record to record.", at.join(", ")),
            parameters,
            place,
        }
    };
    let mut out = Vec::new();
    let mut orders: Vec<&Line> = bench.lines.iter().filter(|l| l.order.is_some()).collect();
    orders.sort_by_key(|l| l.order);
    if let Some(first) = orders.first() {
        let mut parameters = BTreeMap::from([("base_hz".to_owned(), plain(first.hz, "Hz"))]);
        for l in &orders {
            let harmonic = l.order.unwrap_or(1) as f64 / first.order.unwrap_or(1) as f64;
            let name = if l.order == first.order {
                "amplitude".to_owned()
            } else if harmonic.fract() == 0.0 {
                format!("amplitude_{harmonic:.0}")
            } else {
                format!("amplitude_of_order_{}", l.order.unwrap_or(0))
            };
            parameters.insert(name, estimate(&amplitudes(bench, selection, l), 1.0, &given.position_unit));
        }
        out.push(make("repeatable_runout", &["repeatable_runout"], &orders, parameters));
    }
    let sampled = Sampled::of(&selection.model.refitted.plant, bench.scene.sample_time_s);
    for l in bench.lines.iter().filter(|l| l.order.is_none()) {
        let values = amplitudes(bench, selection, l);
        let mut parameters = BTreeMap::from([
            ("frequency_hz".to_owned(), plain(l.hz, "Hz")),
            ("amplitude".to_owned(), estimate(&values, 1.0, &given.position_unit)),
        ]);
        if let Ok(s) = &sampled {
            let gain = s.direct.at(TAU * l.hz).norm();
            parameters.insert("amplitude_command".into(), estimate(&values, 1.0 / gain, &given.command_unit));
        }
        let family: &[&str] = match bench.scene.spindle_hz {
            Some(_) => &["line_disturbance"],
            None => &["line_disturbance", "repeatable_runout"],
        };
        out.push(make("line_disturbance", family, &[l], parameters));
    }
    out
}
