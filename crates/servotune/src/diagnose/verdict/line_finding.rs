//! Findings about lines whose phase differs from run to run.

use super::finding::{Estimate, Finding, Where};
use super::naming::{HUM, RUNOUT, everywhere, text_of};
use crate::diagnose::data::linear_form::{Sampled, starts};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::Segment;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::noise::lines::Line;
use crate::diagnose::noise::lines::mains;
use crate::diagnose::rules::{HUM_COHERENCE, HUM_FADES, HUM_PERIODS, HUM_SPREAD, LINE_REST};
use crate::diagnose::search::selection::Selection;
use crate::lti::FrequencyResponse;
use crate::physics::unexplained;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Every fit run with its error under the final model.
pub(in crate::diagnose) fn left(data: &DiagnosisData, selection: &Selection) -> Vec<(Run, Vec<f64>)> {
    let model = &selection.model;
    let mut out = Vec::new();
    // One repeat of every segment at a time stands in for its mean.
    let most = data.stack.segments.iter().map(|s| s.runs.len()).max().unwrap_or(0);
    for j in 0..most {
        let runs: Vec<Run> =
            data.stack.segments.iter().map(|s| data.runs[s.runs[j.min(s.runs.len() - 1)]].clone()).collect();
        let errors = data.fit(model.chosen.clone()).errors_of(&model.refitted.p, &runs);
        let own = data.stack.segments.iter().map(|s| j < s.runs.len());
        out.extend(runs.into_iter().zip(errors).zip(own).filter(|(_, own)| *own).map(|(r, _)| r));
    }
    out
}

/// A line in every run: its cosine and sine over the whole, the first and the second half; and its periods in the shortest run.
struct Phasors([Vec<[f64; 2]>; 3], f64);

impl Phasors {
    fn of(data: &DiagnosisData, runs: &[(Run, Vec<f64>)], line: &Line) -> Phasors {
        let (t, given) = (data.scene.sample_time_s, &data.form.given);
        let over = |part: [usize; 2]| -> Vec<[f64; 2]> {
            let each = runs.iter().map(|(run, e)| {
                let [from, to] = part.map(|p| p * run.len() / 2);
                line.fit(run, from..to, &starts(given, run.rested, t, to - from), t, e)
            });
            each.collect()
        };
        let shortest = runs.iter().map(|(run, _)| run.len()).min().unwrap_or(0);
        Phasors([over([0, 2]), over([0, 1]), over([1, 2])], line.hz * shortest as f64 * t)
    }

    fn amplitudes(&self) -> Vec<f64> {
        self.0[0].iter().map(|[a, b]| a.hypot(*b)).collect()
    }

    /// Whether it is a hum: as strong in every run, as strong in both halves of each, and in step over them. A narrow band of
    /// noise changes its strength from run to run as Rayleigh's law has it (relative spread 0.52) and loses its step; what rings
    /// after a push dies away; what has few periods in a record is any slow change.
    fn steady(&self) -> bool {
        let amplitudes = self.amplitudes();
        let n = amplitudes.len() as f64;
        let mean = amplitudes.iter().sum::<f64>() / n;
        let spread = (amplitudes.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
        let Phasors([_, first, second], periods) = self;
        let power = |x: &[[f64; 2]]| x.iter().map(|[a, b]| a * a + b * b).sum::<f64>();
        let (before, after) = (power(first), power(second));
        let (re, im) = first
            .iter()
            .zip(second)
            .fold((0.0, 0.0), |(re, im), ([a, b], [c, d])| (re + a * c + b * d, im + a * d - b * c));
        let ratio = after / before;
        *periods >= HUM_PERIODS
            && spread < HUM_SPREAD * mean
            && re.hypot(im) > HUM_COHERENCE * (before * after).sqrt()
            && (1.0 / HUM_FADES..HUM_FADES).contains(&ratio)
    }
}

/// Mean and its 95 % interval from the spread over runs.
fn estimate(values: &[f64], scale: f64, unit: &str) -> Estimate {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let off = 1.96 * (spread / n).sqrt();
    Estimate { value: scale * mean, low: scale * (mean - off), high: scale * (mean + off), unit: unit.into() }
}

/// A line's place: as narrow as the longest record resolves (Hz).
fn resolved(data: &DiagnosisData, hz: f64) -> [f64; 2] {
    let width = 1.0 / data.scene.duration_s.max(data.scene.sample_time_s);
    [(hz - width).max(0.0), hz + width]
}

/// A line's frequency with its 95 % interval: the Cramér-Rao bound for a tone of the strength found, its phase each record's own
/// (Rife & Boorstyn 1974).
fn frequency(data: &DiagnosisData, line: &Line) -> Estimate {
    let off = 1.96 * (12.0 / (-2.0 * line.log_p).max(1.0)).sqrt() / (TAU * data.scene.duration_s);
    Estimate { value: line.hz, low: line.hz - off, high: line.hz + off, unit: "Hz".into() }
}

/// A line and how it shows in every run.
type Heard<'a> = (&'a Line, Phasors);

/// Lines that hum, and those that do not: narrow bands of noise, what rings, and what the model lacks at a multiple of the drive's own lap. A line that
/// a far stronger one left goes.
fn told_apart<'a>(data: &DiagnosisData, all: Vec<Heard<'a>>) -> [Vec<Heard<'a>>; 2] {
    let sizes: Vec<(f64, f64)> = all.iter().map(|(l, p)| (l.hz, p.amplitudes().iter().sum::<f64>())).collect();
    let width = 1.0 / data.scene.duration_s.max(data.scene.sample_time_s);
    // What a line nearer than the records resolve has over a line's own size.
    let beside = |(l, p): &(&Line, Phasors)| {
        let own: f64 = p.amplitudes().iter().sum();
        let others = sizes.iter().filter(|(hz, _)| *hz != l.hz && (hz - l.hz).abs() < width);
        others.map(|(_, size)| size / own).fold(0.0, f64::max)
    };
    // A much stronger one left it.
    let (seen, beside): (Vec<_>, Vec<f64>) = all
        .into_iter()
        .map(|line| (beside(&line), line))
        .filter(|(b, _)| b * LINE_REST < 1.0)
        .map(|(b, line)| (line, b))
        .unzip();
    let laps = laps_hz(data, &seen);
    // At a multiple of the drive's own lap it is what the model lacks.
    let driven = |hz: f64| laps.iter().any(|f| (hz - (hz / f).round() * f).abs() < LINE_REST * width);
    let hums = |(l, p): &(&Line, Phasors), beside: f64| p.steady() && beside < LINE_REST && !driven(l.hz);
    let (hums, others): (Vec<_>, Vec<_>) = seen.into_iter().zip(beside).partition(|(line, beside)| hums(line, *beside));
    [hums, others].map(|part| part.into_iter().map(|(line, _)| line).collect())
}

/// One finding for all orders of the spindle, one for each other line; and the frequencies (Hz) of those that are none, but narrow
/// bands of noise or something that rings.
pub(super) fn line_findings(data: &DiagnosisData, selection: &Selection) -> (Vec<Finding>, Vec<f64>) {
    let errors = if data.lines.is_empty() { Vec::new() } else { left(data, selection) };
    let all: Vec<(&Line, Phasors)> = data.lines.iter().map(|l| (l, Phasors::of(data, &errors, l))).collect();
    let [hums, others] = told_apart(data, all);
    let runs: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
    let given = &data.form.given;
    let make = |effect: &str, family: &[&str], lines: &[&Line], parameters: BTreeMap<String, Estimate>| {
        let (says, port) = text_of(effect);
        let strongest = lines.iter().map(|l| l.log_p).fold(0.0, f64::min);
        let place = Where { frequency_hz: lines.iter().map(|l| resolved(data, l.hz)).collect(), ..everywhere(&runs) };
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
    let mut orders: Vec<&(&Line, Phasors)> = hums.iter().filter(|l| l.0.order.is_some()).collect();
    orders.sort_by_key(|l| l.0.order);
    if let Some((first, _)) = orders.first() {
        let mut parameters = BTreeMap::from([("base_hz".to_owned(), frequency(data, first))]);
        for (l, phasors) in &orders {
            let harmonic = l.order.unwrap_or(1) as f64 / first.order.unwrap_or(1) as f64;
            let name = if l.order == first.order {
                "amplitude".to_owned()
            } else if harmonic.fract() == 0.0 {
                format!("amplitude_{harmonic:.0}")
            } else {
                format!("amplitude_of_order_{}", l.order.unwrap_or(0))
            };
            parameters.insert(name, estimate(&phasors.amplitudes(), 1.0, &given.position_unit));
        }
        let lines: Vec<&Line> = orders.iter().map(|o| o.0).collect();
        let alone = orders.len() == 1 && first.order.is_some_and(|o| o > 1) && mains(first.hz);
        let family: &[&str] = if alone { &[RUNOUT, HUM] } else { &[RUNOUT] };
        out.push(make(RUNOUT, family, &lines, parameters));
    }
    let sampled = Sampled::of(&selection.model.refitted.plant, data.scene.sample_time_s);
    for (l, phasors) in hums.iter().filter(|l| l.0.order.is_none()) {
        let values = phasors.amplitudes();
        let mut parameters = BTreeMap::from([
            ("frequency_hz".to_owned(), frequency(data, l)),
            ("amplitude".to_owned(), estimate(&values, 1.0, &given.position_unit)),
        ]);
        if let Ok(s) = &sampled {
            let gain = s.direct.at(TAU * l.hz).norm();
            parameters.insert("amplitude_command".into(), estimate(&values, 1.0 / gain, &given.command_unit));
        }
        let family: &[&str] = match data.scene.spindle_hz {
            Some(_) => &[HUM],
            None => &[HUM, RUNOUT],
        };
        out.push(make(HUM, family, &[l], parameters));
    }
    (out, others.iter().map(|(l, _)| l.hz).collect())
}

/// Frequencies of the laps (Hz) of records that were not repeated, where there are lines to compare.
fn laps_hz(data: &DiagnosisData, lines: &[(&Line, Phasors)]) -> Vec<f64> {
    let alone = data.stack.segments.iter().filter(|s| s.runs.len() == 1 && !lines.is_empty());
    let lap = |s: &Segment| data.runs[s.runs[0]].lap();
    alone.filter_map(lap).map(|n| 1.0 / (n as f64 * data.scene.sample_time_s)).collect()
}

/// Whether two findings are of one hum: their frequencies lie within their intervals of each other.
pub(super) fn same_line(a: &Finding, b: &Finding) -> bool {
    let of = |f: &Finding| f.parameters.get("frequency_hz").map(|e| [e.low, e.high]);
    let hum = |f: &Finding| f.effect == HUM;
    hum(a) && hum(b) && of(a).zip(of(b)).is_some_and(|(a, b)| a[0] <= b[1] && b[0] <= a[1])
}

/// What shows at some frequencies (Hz) in every repeat differently, and is no hum.
pub(super) fn unsteady(data: &DiagnosisData, frequencies_hz: &[f64]) -> Finding {
    let runs: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
    let port = unexplained::FACTS.port;
    let strongest = data.lines.iter().filter(|l| frequencies_hz.contains(&l.hz)).map(|l| l.log_p).fold(0.0, f64::min);
    let at: Vec<String> = frequencies_hz.iter().map(|f| format!("{f:.3}")).collect();
    Finding {
        effect: unexplained::FACTS.name.into(),
        family: vec![unexplained::FACTS.name.into()],
        port,
        p_value: strongest.exp().max(1e-300),
        says: format!(
            "Near {} Hz something moves the arm that differs from repeat to repeat and is no steady hum: it swells, dies away or comes and goes.",
            at.join(", ")
        ),
        parameters: BTreeMap::new(),
        place: Where { frequency_hz: frequencies_hz.iter().map(|&f| resolved(data, f)).collect(), ..everywhere(&runs) },
    }
}
