//! A candidate with its derivatives: objective and limits as straight lines around one decision vector.
//!
//! Margins: analytic, from d ln L = d ln C at the events of the curve, whose frequencies move along with the slope of ln L.
//! The write read off the spectrum: one backward pass a figure ([`crate::pes::SpectralPes::slopes`]). The simulated write, and wherever the
//! command's peak counts: forward differences, one run a parameter; an adjoint of a simulation would cost as much.

use super::bench::{figure_of_write, graze_violation, harmful_grazes, named_crossings};
use super::machine::{PesScore, Prepared};
use super::parameters::chain_of;
use super::requirements::Requirement;
use super::{Bench, Desk, Score, Side, What};
use crate::feedback::{Event, Graze};
use crate::lti::Section;
use nalgebra::Complex;
use std::f64::consts::{LOG10_E, TAU};

/// One limit near one candidate: value + gradient d, good where at most 0.
#[derive(Clone, Debug)]
pub(super) struct Row {
    machine: usize,
    /// Index of the requirement.
    wanted: usize,
    /// Where on the curve (rad/s); 0 for a figure of the write.
    w_rad_s: f64,
    from: From,
    /// Violation as a share of the limit.
    pub value: f64,
    pub gradient: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
enum From {
    Margin(Event),
    Graze(Graze),
    Write,
}

/// Objectives (one a machine) and limits around one candidate.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    pub score: Score,
    pub objectives: Vec<(f64, Vec<f64>)>,
    pub rows: Vec<Row>,
}

/// Step of the differences in ln of a parameter: the square root of rounding, scaled to a record of a thousand samples.
const STEP: f64 = 1e-6;
/// Step for the logarithm of a section's response, central: errors of 1e-10 by curvature and 1e-11 by rounding.
const SECTION_STEP: f64 = 1e-5;

impl Row {
    /// Whether two rows, of neighbouring candidates, speak of the same thing.
    pub fn same(&self, other: &Row) -> bool {
        self.machine == other.machine
            && self.wanted == other.wanted
            && (self.w_rad_s - other.w_rad_s).abs() <= 0.15 * self.w_rad_s
    }
}

/// The limits at the candidate whose figures lie in the desk, without gradients.
pub(super) fn rows(bench: &Bench, desk: &Desk) -> Vec<Row> {
    let mut all = Vec::new();
    for (machine, aimed) in bench.aimed.iter().enumerate() {
        let q = &desk.buffers[machine].on.quick;
        let found = &desk.scores[machine].found;
        let mut harmonic = 0;
        for (wanted, w) in aimed.iter().enumerate() {
            let mut push = |e: Event, value: f64| {
                let gradient = Vec::new();
                all.push(Row { machine, wanted, w_rad_s: e.w_rad_s, from: From::Margin(e), value, gradient });
            };
            let mut grazes: Vec<Row> = harmful_grazes(q, w)
                .map(|g| {
                    let (value, gradient) = (graze_violation(g), Vec::new());
                    Row { machine, wanted, w_rad_s: g.event.w_rad_s, from: From::Graze(*g), value, gradient }
                })
                .collect();
            // A crossing on the other side of -1 keeps its distance by its absolute value, unless it is the one named.
            let distance = |e: &Event, named: Option<f64>| {
                let value = if named == Some(e.value) { e.value } else { e.value.abs() };
                w.violation(value)
            };
            match w.what {
                What::PhaseMargin => {
                    q.gain_crossings.iter().for_each(|e| push(*e, distance(e, found.phase_margin_deg)));
                }
                What::GainMargin => {
                    q.phase_crossings.iter().for_each(|e| push(*e, distance(e, found.gain_margin_db)));
                }
                What::MaxSensitivity => q.dips.iter().for_each(|e| push(*e, w.violation(1.0 / e.value))),
                What::GainCrossover => {
                    named_crossings(q).for_each(|e| push(*e, w.violation(e.w_rad_s / TAU)));
                }
                _ => {
                    if let Some(x) = figure_of_write(w.what, &desk.scores[machine].pes, &mut harmonic) {
                        let (value, gradient) = (w.violation(x), Vec::new());
                        all.push(Row { machine, wanted, w_rad_s: 0.0, from: From::Write, value, gradient });
                    }
                }
            }
            all.append(&mut grazes);
        }
    }
    all
}

/// Scores `x` and takes all derivatives there; none where the loop is unstable.
pub(super) fn linearise(bench: &Bench, x: &[f64], desk: &mut Desk) -> Option<Linear> {
    let score = bench.score(x, desk);
    if score.violation >= super::bench::UNSTABLE {
        return None;
    }
    let n = x.len();
    let mut rows = rows(bench, desk);
    let mut objectives: Vec<(f64, Vec<f64>)> =
        desk.scores.iter().map(|s| (s.objective, Vec::with_capacity(n))).collect();
    let base: Vec<PesScore> = desk.scores.iter().map(|s| s.pes.clone()).collect();
    let sections: Vec<[Section; 2]> = sections_around(bench, x, desk);
    for row in &mut rows {
        let (From::Margin(e) | From::Graze(Graze { event: e, .. })) = row.from else { continue };
        let w = &bench.aimed[row.machine][row.wanted];
        let t = bench.machines[row.machine].sampled.sample_time_s();
        let back = Complex::from_polar(1.0, -e.w_rad_s * t);
        let named = row.value == w.violation(e.value);
        row.gradient = sections
            .iter()
            .map(|[minus, plus]| {
                let pull = (plus.at_delay(back) / minus.at_delay(back)).ln() / (2.0 * SECTION_STEP);
                match row.from {
                    From::Graze(g) => {
                        if g.minimum {
                            -pull.re
                        } else {
                            pull.re
                        }
                    }
                    _ => margin_slope(w, &e, pull, named),
                }
            })
            .collect();
    }
    if bench.machines.iter().all(Prepared::has_slopes) {
        backward(bench, &sections, desk, &mut objectives, &mut rows);
    } else {
        differences(bench, x, &base, desk, &mut objectives, &mut rows);
        desk.evaluations += n;
    }
    Some(Linear { score, objectives, rows })
}

/// Gradients of the write by one backward pass for each figure of each machine; the desk holds the candidate's own write.
fn backward(
    bench: &Bench,
    sections: &[[Section; 2]],
    desk: &mut Desk,
    objectives: &mut [(f64, Vec<f64>)],
    rows: &mut [Row],
) {
    let Desk { buffers, scores, pulls, slopes, .. } = desk;
    let mut done = None;
    for (i, ((machine, b), s)) in bench.machines.iter().zip(buffers).zip(&*scores).enumerate() {
        machine.pull(done, sections, SECTION_STEP, pulls);
        done = Some(machine);
        machine.slopes(&s.pes, pulls, b, &bench.harmonics, slopes);
        let (low, high) = (bench.weight_low, bench.weight_high);
        let all = (low * s.pes.dft_low + high * s.pes.dft_high).max(f64::MIN_POSITIVE);
        objectives[i].1.extend(slopes.dft_low.iter().zip(&slopes.dft_high).map(|(a, b)| (low * a + high * b) / all));
        for row in rows.iter_mut().filter(|r| r.machine == i && matches!(r.from, From::Write)) {
            let w = &bench.aimed[i][row.wanted];
            let of: &[f64] = match w.what {
                What::DftLow => &slopes.dft_low,
                What::DftHigh => &slopes.dft_high,
                What::Harmonic { .. } => &slopes.harmonics[harmonics_before(bench, row)],
                _ => continue,
            };
            // A figure of the write has a limit that it must not exceed.
            row.gradient.extend(of.iter().map(|d| d / w.limit));
        }
    }
}

/// How many limits of harmonics stand before a row's.
fn harmonics_before(bench: &Bench, row: &Row) -> usize {
    let before = &bench.aimed[row.machine][..row.wanted];
    before.iter().filter(|w| matches!(w.what, What::Harmonic { .. })).count()
}

/// Gradients of the write by forward differences: one write a parameter.
fn differences(
    bench: &Bench,
    x: &[f64],
    base: &[PesScore],
    desk: &mut Desk,
    objectives: &mut [(f64, Vec<f64>)],
    rows: &mut [Row],
) {
    let mut moved = x.to_vec();
    for j in 0..x.len() {
        moved[j] = x[j] + STEP;
        bench.parameters.put(&moved, &mut desk.controller);
        chain_of(&desk.controller, &mut desk.chain);
        bench.judge_writes(desk);
        moved[j] = x[j];
        for ((value, gradient), s) in objectives.iter_mut().zip(&desk.scores) {
            gradient.push((s.objective - *value) / STEP);
        }
        for row in rows.iter_mut().filter(|r| matches!(r.from, From::Write)) {
            let before = harmonics_before(bench, row);
            let w = &bench.aimed[row.machine][row.wanted];
            let figure = |p: &PesScore| figure_of_write(w.what, p, &mut { before }).unwrap_or(0.0);
            let difference =
                w.violation(figure(&desk.scores[row.machine].pes)) - w.violation(figure(&base[row.machine]));
            row.gradient.push(difference / STEP);
        }
    }
}

/// The section that each parameter acts on, a little to either side.
fn sections_around(bench: &Bench, x: &[f64], desk: &mut Desk) -> Vec<[Section; 2]> {
    let p = &bench.parameters;
    let mut moved = x.to_vec();
    let mut around = Vec::with_capacity(x.len());
    for j in 0..x.len() {
        let mut side = |h: f64| {
            moved[j] = x[j] + h;
            p.put(&moved, &mut desk.controller);
            chain_of(&desk.controller, &mut desk.chain);
            moved[j] = x[j];
            desk.chain.get(p.section_of(j)).copied()
        };
        let still = Section { b0: 1.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0 };
        around.push(match (side(-SECTION_STEP), side(SECTION_STEP)) {
            (Some(minus), Some(plus)) => [minus, plus],
            // Outside the range of a filter nothing moves.
            _ => [still, still],
        });
    }
    p.put(x, &mut desk.controller);
    chain_of(&desk.controller, &mut desk.chain);
    around
}

/// d violation for d ln C = `pull` at an event.
fn margin_slope(w: &Requirement, e: &Event, pull: Complex<f64>, named: bool) -> f64 {
    // Near a slope of 0 the event has no speed of its own worth following.
    let ratio = |a: f64, b: f64| if b.abs() > 1e-6 { a / b } else { 0.0 };
    let change = match w.what {
        What::PhaseMargin => (pull.im - pull.re * ratio(e.slope.im, e.slope.re)).to_degrees(),
        What::GainMargin => -20.0 * LOG10_E * (pull.re - pull.im * ratio(e.slope.re, e.slope.im)),
        What::GainCrossover => -ratio(pull.re, e.slope.re) * e.w_rad_s / TAU,
        // |1 + L| falls with the part of dL along 1 + L; at the dip its own frequency does not matter.
        What::MaxSensitivity => {
            let one_plus = 1.0 + e.l;
            let fall = (one_plus.conj() * e.l * pull).re / one_plus.norm();
            -fall / (e.value * e.value)
        }
        _ => 0.0,
    };
    let sign = match w.what {
        What::PhaseMargin | What::GainMargin if !named && e.value < 0.0 => -1.0,
        _ => 1.0,
    };
    let direction = if w.side == Side::AtLeast { -1.0 } else { 1.0 };
    sign * direction * change / w.limit
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::frf::Frf;
    use crate::lti::{FrequencyResponse, Plant, PlantFile};
    use crate::tune::{Hold, Machine, Parameters, Spec};
    use std::path::Path;

    #[test]
    fn backward_slopes_are_those_of_differences() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let spec = Spec::read(&folder.join("specs/limits/floor.toml")).unwrap();
        let text = std::fs::read_to_string(folder.join("specs/controllers/nominal.toml")).unwrap();
        let start: crate::controller::Controller = toml::from_str(&text).unwrap();
        let text = std::fs::read_to_string(folder.join("specs/machines/healthy.toml")).unwrap();
        let plant: Plant = toml::from_str::<PlantFile>(&text).unwrap().try_into().unwrap();
        let w: Vec<f64> = (0..400).map(|i| TAU * 20.0 * 1.0155f64.powi(i)).collect();
        let frf = |gain: f64| Frf::new(w.clone(), w.iter().map(|w| plant.at(*w) * gain).collect(), None).unwrap();
        let frfs = [frf(1.0), frf(0.9)];
        let machines: Vec<Machine<'_>> = frfs
            .iter()
            .map(|frf| Machine::Response { frf, hold: Hold::NotIncluded, continuation: Some(&plant) })
            .collect();
        let parameters = Parameters::of(&spec, Some(&start), start.sample_time_s);
        let bench = Bench::new(&machines, &spec, parameters).unwrap();
        let mut desk = bench.desk();
        let mut x = bench.parameters().vector(&start);
        // Off the bounds, so that every parameter moves the loop: a notch beside the mode, half as deep.
        for (x, [from, to]) in x.iter_mut().zip(bench.parameters().bounds()) {
            *x = x.clamp(from + 0.2 * (to - from), to - 0.2 * (to - from));
        }
        bench.score(&x, &mut desk);
        let sections = sections_around(&bench, &x, &mut desk);
        bench.score(&x, &mut desk);
        let new = || rows(&bench, &desk).into_iter().filter(|r| matches!(r.from, From::Write)).collect::<Vec<Row>>();
        let (mut back, mut forth) = (new(), new());
        let base: Vec<PesScore> = desk.scores.iter().map(|s| s.pes.clone()).collect();
        let objective = || desk.scores.iter().map(|s| (s.objective, Vec::new())).collect::<Vec<_>>();
        let (mut a, mut b) = (objective(), objective());
        backward(&bench, &sections, &mut desk, &mut a, &mut back);
        differences(&bench, &x, &base, &mut desk, &mut b, &mut forth);
        // Half the second derivative, about 1, times the step of the differences, and their rounding: 1e-10 over the step.
        let near = |a: &[f64], b: &[f64]| {
            a.len() == x.len()
                && b.len() == x.len()
                && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-4 * (0.1 + b.abs()))
        };
        assert!(back.len() == 8 && a.len() == 2);
        for (p, q) in a.iter().zip(&b) {
            assert!(near(&p.1, &q.1) && p.1.iter().all(|d| *d != 0.0), "{p:?} {q:?}");
        }
        for (p, q) in back.iter().zip(&forth) {
            assert!(near(&p.gradient, &q.gradient), "{p:?} {q:?}");
        }
    }
}
