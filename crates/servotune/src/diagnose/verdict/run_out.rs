//! Run-out of the disk that another law hides: orders of the spindle that stand out of what the offered model leaves are fitted to it and taken
//! out of the records, and what is left of those is diagnosed anew.
//!
//! In: a diagnosis. Out: the orders, records without them, and a diagnosis that has them. Convention: a run-out adds to the recorded position
//! and moves nothing; the controller hears it. Spec: `specs/mismatch.md`, "Run-out beside another law".

use super::finding::{Estimate, Finding, Verdict};
use super::fit_report::{Errors, figures_of};
use super::judgement::Later;
use super::localisation::place;
use super::naming::RUNOUT;
use super::outcome::Outcome;
use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, entry};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::{errors, size};
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::noise::lines::{HIGHEST_ORDER, Line, standing_orders};
use crate::diagnose::noise::repeats::without_start;
use crate::diagnose::rules::Answer;
use crate::numeric::digits::said;
use crate::numeric::least_squares::Qr;
use crate::physics::repeatable_runout::{FACTS, RepeatableRunout};
use crate::physics::{Facts, LawSetting};
use crate::recording::Role;
use std::collections::BTreeMap;

/// Orders of the spindle in the recorded position.
#[derive(Clone)]
pub(in crate::diagnose) struct RunOut {
    orders: Vec<Line>,
    /// Cosine and sine of each (position_unit).
    phasors: Vec<[f64; 2]>,
    /// Changes of those by one standard error each, along directions that err independently.
    directions: Vec<Vec<[f64; 2]>>,
    /// Fall of the sum of squares of the whitened error.
    gain: f64,
}

impl RunOut {
    /// The orders that stand out of what the offered model leaves of the fit records in open loop; none where a run-out is named already, or
    /// nothing stands out.
    pub fn beside(made: &Outcome) -> Option<RunOut> {
        let data = &made.data;
        let named = made.judgement.findings.iter().any(|f| f.effect == RUNOUT);
        if named || made.judgement.verdict == Verdict::DataFault {
            return None;
        }
        let heard = heard(made);
        let data = heard.as_ref().unwrap_or(data);
        let left = Left::of(data, &made.open[2])?;
        let mut orders = standing_orders(&left.errors, data.scene.sample_time_s, data.scene.spindle_hz);
        orders.retain(|o| data.lines.iter().all(|l| l.order != o.order));
        if orders.is_empty() { None } else { left.fitted(orders) }
    }

    /// The same orders once more, fitted to what is left where they are taken out already.
    pub fn bettered(&self, made: &Outcome) -> Option<RunOut> {
        let heard = heard(made);
        let more = Left::of(heard.as_ref().unwrap_or(&made.data), &made.open[2])?.fitted(self.orders.clone())?;
        let phasors = self.phasors.iter().zip(&more.phasors).map(|(a, b)| [a[0] + b[0], a[1] + b[1]]).collect();
        Some(RunOut { phasors, gain: self.gain + more.gain, ..more })
    }

    /// What it adds to the position of a run.
    fn motion(&self, run: &Run, sample_time_s: f64) -> Vec<f64> {
        let mut all = vec![0.0; run.len()];
        for (line, [c, s]) in self.orders.iter().zip(&self.phasors) {
            let [cos, sin] = line.columns(run, sample_time_s);
            all.iter_mut().zip(cos.iter().zip(&sin)).for_each(|(m, (a, b))| *m += c * a + s * b);
        }
        all
    }

    /// Runs without it.
    pub fn taken_out_of(&self, runs: &[Run], sample_time_s: f64) -> Vec<Run> {
        runs.iter().map(|r| r.without(&self.motion(r, sample_time_s))).collect()
    }

    /// As effects: base orders with their harmonics, the lowest first.
    fn effects(&self, phasors: &[[f64; 2]]) -> Vec<LawSetting> {
        let number = |l: &Line| l.order.unwrap_or(0);
        let mut rest: Vec<usize> = (0..self.orders.len()).collect();
        rest.sort_by_key(|&i| number(&self.orders[i]));
        let mut all = Vec::new();
        while let Some(&first) = rest.first() {
            let base = &self.orders[first];
            let mut strengths = vec![0.0; FACTS.columns];
            rest.retain(|&i| {
                let own = (1..=FACTS.columns / 2).find(|h| h * number(base) == number(&self.orders[i]));
                own.inspect(|h| strengths[2 * h - 2..2 * h].copy_from_slice(&phasors[i])).is_none()
            });
            all.push(LawSetting::new(RepeatableRunout { base_hz: base.hz }, strengths));
        }
        all
    }

    /// What was found in records without it, made an outcome of the records as they are; `helps` is the rule by which it stays.
    pub fn entered(&self, made: Outcome, recorded: &[Run], closed: Option<&ControlLaw>, helps: Answer) -> Outcome {
        let own = self.effects(&self.phasors);
        let findings = own.iter().enumerate().map(|(i, setting)| self.finding(&made.data, i, setting)).collect();
        let Corrected { mut plant, effects } = made.corrected;
        plant.physics.extend(own.iter().map(|setting| entry(setting, &made.data.scene)));
        // What the second search found of a run-out is the rest of this one: the model has both, and the name stands once.
        let mut found = made.judgement;
        found.findings.retain(|f| f.effect != RUNOUT);
        let judgement = found.after(Later::Beside(findings), helps.consulted).said(Some(
            "orders of the spindle stood out of what the first search left; they were taken out of the records, and the rest was searched again".into(),
        ));
        // Which of them a push fell into, the search found.
        let known = |(r, found): (&Run, &Run)| Run { shocked: found.shocked, ..r.clone() };
        let data = DiagnosisData { runs: recorded.iter().zip(&made.data.runs).map(known).collect(), ..made.data };
        let every: Vec<&Run> = data.runs.iter().collect();
        let linear = SimulatedModel::of(&made.refitted, &[], &data.scene);
        let with_refit = |[given, _, after]: Errors, law| [given, errors(&linear, &every, law), after];
        let (shown, open) = (with_refit(made.errors, closed), with_refit(made.open, None));
        let fit = figures_of(&data, &every, [&open, &shown], closed.is_some());
        let corrected = Corrected { plant, effects: [effects, own].concat() };
        Outcome { judgement, corrected, fit, errors: shown, open, data, ..made }
    }

    fn finding(&self, data: &DiagnosisData, at: usize, setting: &LawSetting) -> Finding {
        let &Facts { name: effect, says, port, .. } = &FACTS;
        let mut signal = data.stack.series(|i| {
            let mut motion = self.motion(&data.means[i], data.scene.sample_time_s);
            data.whitener.apply(&mut motion);
            motion
        });
        data.fit(vec![]).local_basis().project(&mut signal);
        let place = place(data, &data.stack, &signal);
        let base = setting.parameters(&data.scene);
        let moved = |direction: &Vec<[f64; 2]>| {
            let to: Vec<[f64; 2]> =
                self.phasors.iter().zip(direction).map(|(p, d)| [p[0] + d[0], p[1] + d[1]]).collect();
            self.effects(&to)[at].parameters(&data.scene)
        };
        let moved: Vec<_> = self.directions.iter().map(moved).collect();
        let there = setting.strengths.chunks(2).map(|s| s != [0.0; 2]).collect::<Vec<_>>();
        let estimates = base.iter().enumerate().filter(|(k, _)| *k == 0 || there[(k - 1) / 2]).map(|(k, p)| {
            let off = 1.96 * moved.iter().map(|m| m[k].beyond(p).powi(2)).sum::<f64>().sqrt();
            let unit = p.unit.text(&data.form.given.position_unit, &data.form.given.command_unit);
            (p.name.to_owned(), Estimate { value: p.value, low: p.value - off, high: p.value + off, unit })
        });
        let log_p = log_tail(self.gain, 2 * self.orders.len()) + self.orders.len() as f64 * (HIGHEST_ORDER as f64).ln();
        Finding {
            effect: effect.into(),
            family: vec![effect.into()],
            port,
            p_value: log_p.min(0.0).exp().max(1e-300),
            says: format!("At {} Hz {says}.", frequencies(setting)),
            parameters: BTreeMap::from_iter(estimates),
            place,
        }
    }
}

/// The diagnosis data with the noise as repeats show it around the offered model, where that is less.
fn heard(made: &Outcome) -> Option<DiagnosisData> {
    let left: Vec<Vec<f64>> = made.data.fit_runs.iter().map(|&r| made.open[2][r].clone()).collect();
    made.data.heard_through(&left)
}

/// The frequencies of a run-out's harmonics, as a person says them.
fn frequencies(setting: &LawSetting) -> String {
    let base = setting.law.first_number();
    let all = setting.strengths.chunks(2).enumerate().filter(|(_, s)| *s != [0.0; 2]);
    let all: Vec<String> = all.map(|(h, _)| said((h + 1) as f64 * base, 3)).collect();
    all.join(" and ")
}

/// What a model leaves of the fit records, whitened, each record's start taken out.
struct Left<'a> {
    data: &'a DiagnosisData,
    /// Which records they are.
    runs: Vec<usize>,
    errors: Vec<Vec<f64>>,
}

/// Series that each belong to a record, whitened, the record's start taken out.
fn seen(data: &DiagnosisData, series: &[(usize, Vec<f64>)]) -> Vec<Vec<f64>> {
    without_start(series, &|n| data.starts(n), &|x| data.whitener.apply(x)).into_iter().map(|s| s.1).collect()
}

impl<'a> Left<'a> {
    /// Of the errors of all runs; none where one of them runs away.
    fn of(data: &'a DiagnosisData, errors: &[Vec<f64>]) -> Option<Left<'a>> {
        let runs = data.of_role(Role::Fit);
        let errors = seen(data, &runs.iter().map(|&r| (r, errors[r].clone())).collect::<Vec<_>>());
        errors.iter().flatten().all(|v| v.is_finite()).then_some(Left { data, runs, errors })
    }

    /// Orders fitted to it, one phasor each for all records.
    fn fitted(&self, orders: Vec<Line>) -> Option<RunOut> {
        let left = self.errors.concat();
        let (rows, cols) = (left.len(), 2 * orders.len());
        if rows <= cols {
            return None;
        }
        let columns = |&r: &usize| {
            let all = orders.iter().flat_map(|l| l.columns(&self.data.runs[r], self.data.scene.sample_time_s));
            all.map(|c| (r, c)).collect::<Vec<_>>()
        };
        let all = seen(self.data, &self.runs.iter().flat_map(columns).collect::<Vec<_>>());
        let columns: Vec<Vec<f64>> =
            (0..cols).map(|j| all.iter().skip(j).step_by(cols).flatten().copied().collect()).collect();
        let mut qr = Qr::default();
        qr.factor(rows, cols, |a| a.chunks_exact_mut(rows).zip(&columns).for_each(|(a, c)| a.copy_from_slice(c)));
        let numbers = qr.solve(&mut left.clone());
        let rest: Vec<f64> =
            (0..rows).map(|i| left[i] - columns.iter().zip(&numbers).map(|(c, n)| c[i] * n).sum::<f64>()).collect();
        // What the model leaves beside them may be more than noise.
        let spread = (size(&rest) / (rows - cols) as f64).sqrt();
        let pairs = |x: &[f64], by: f64| x.chunks_exact(2).map(|p| [by * p[0], by * p[1]]).collect::<Vec<_>>();
        let directions = qr.inverse_root().chunks_exact(cols).map(|d| pairs(d, spread)).collect();
        let sound = numbers.iter().all(|v| v.is_finite());
        sound.then(|| RunOut { orders, phasors: pairs(&numbers, 1.0), directions, gain: size(&left) - size(&rest) })
    }
}
