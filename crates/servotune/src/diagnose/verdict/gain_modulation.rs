//! A gain that swings, with a phase of its own in every record: the mean over repeats smears it and their spread counts it as noise.
//!
//! In: the error of every run under the final model. The error sent back through filter and plant, times the command, holds a line at the
//! frequency of the swing (the matched filter for all frequencies at once); there the swing is fitted to every run by itself.

use super::finding::{Estimate, Finding};
use super::line_finding::left;
use super::naming::everywhere;
use crate::diagnose::data::linear_form::{Sampled, starts};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::{Normal, NuisanceBasis};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::trajectory::acting;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::noise::lines::peak;
use crate::diagnose::rules::{SWING_ALIKE, SWING_CHANCE, SWING_PERIODS};
use crate::diagnose::search::selection::Selection;
use crate::numeric::golden::golden_section;
use crate::physics::{Facts, parametric_gain};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// One run, ready to be fitted.
struct Ready {
    /// What acts on the arm (command_unit), and the error, whitened, start and constant torque taken out.
    acting: Vec<f64>,
    error: Vec<f64>,
    local: NuisanceBasis,
}

/// The swing in one run: fall of the sum of squares, depth and its variance.
struct Swung {
    gain: f64,
    depth: f64,
    variance: f64,
}

impl Ready {
    fn of(data: &DiagnosisData, sampled: &Sampled, run: &Run, error: &[f64]) -> Ready {
        let mut local = NuisanceBasis::default();
        let t = data.scene.sample_time_s;
        // Lines are looked for elsewhere: at a frequency that the command has too, a swing would take them.
        let lines = data.lines.iter().flat_map(|l| l.columns(run, t));
        for mut c in starts(&data.form.given, run.rested, t, run.len()).into_iter().chain(lines) {
            data.whitener.apply(&mut c);
            local.add_local(0, c);
        }
        let mut error = error.to_vec();
        data.whitener.apply(&mut error);
        local.project(&mut error);
        Ready { acting: acting(&sampled.delayed, &run.input, run.before), error, local }
    }

    /// The command times the error sent back to where the command acts.
    fn product(&self, data: &DiagnosisData, sampled: &Sampled) -> Vec<f64> {
        // The adjoint of a filter that does not change in time is itself, run backwards.
        let mut back: Vec<f64> = self.error.iter().rev().copied().collect();
        data.whitener.apply(&mut back);
        let mut torque = vec![0.0; back.len()];
        sampled.direct.add_response(&back, &mut torque);
        self.acting.iter().zip(torque.iter().rev()).map(|(i, w)| i * w).collect()
    }

    fn swung(&self, data: &DiagnosisData, sampled: &Sampled, hz: f64) -> Swung {
        let t = data.scene.sample_time_s;
        let column = |of: fn(f64) -> f64| {
            let torque: Vec<f64> =
                self.acting.iter().enumerate().map(|(k, i)| i * of(TAU * hz * (k as f64 + 0.5) * t)).collect();
            let mut y = vec![0.0; torque.len()];
            sampled.direct.add_response(&torque, &mut y);
            data.whitener.apply(&mut y);
            y
        };
        let columns = [column(f64::cos), column(f64::sin)];
        let normal = Normal::of(&self.local, &self.error, &columns, &[[0, self.error.len()]; 2]);
        let fit = normal.explained(false);
        let variance = 2.0 / normal.gram.trace().max(f64::MIN_POSITIVE);
        Swung { gain: fit.gain, depth: fit.strengths[0].hypot(fit.strengths[1]), variance }
    }
}

/// A swing of the gain that all runs show, each in its own phase.
pub(in crate::diagnose) fn gain_modulation(data: &DiagnosisData, selection: &Selection) -> Option<Finding> {
    let t = data.scene.sample_time_s;
    let plant = data.form.nominal(&selection.model.refitted.p).plant;
    let sampled = Sampled::of(&plant, t).ok()?;
    let runs: Vec<Ready> = left(data, selection).par_iter().map(|(run, e)| Ready::of(data, &sampled, run, e)).collect();
    let products: Vec<Vec<f64>> = runs.par_iter().map(|r| r.product(data, &sampled)).collect();
    let numbers = 2 * runs.len();
    let line = peak(&products, &vec![1.0; runs.len()], numbers, t, None)?;
    let longest = products.iter().map(Vec::len).max()?;
    let width = 1.0 / (longest as f64 * t);
    if line.hz < SWING_PERIODS * width {
        return None;
    }
    let at = |hz: f64| -> Vec<Swung> { runs.par_iter().map(|r| r.swung(data, &sampled, hz)).collect() };
    let gain = |all: &[Swung]| all.iter().map(|s| s.gain).sum::<f64>();
    let hz = golden_section(|hz| -gain(&at(hz)), line.hz - 0.5 * width, line.hz + 0.5 * width, 1e-3 * width).x;
    let all = at(hz);
    let log_p = log_tail(gain(&all), numbers) + (longest as f64).ln();
    let weight: f64 = all.iter().map(|s| s.variance.recip()).sum();
    let depth = all.iter().map(|s| s.depth / s.variance).sum::<f64>() / weight;
    let spread = (all.iter().map(|s| (s.depth - depth).powi(2) / s.variance).sum::<f64>() / weight).sqrt();
    if log_p > SWING_CHANCE.ln() || depth < SWING_ALIKE * spread {
        return None;
    }
    let &Facts { name: effect, says, port, .. } = &parametric_gain::FACTS;
    let off = 1.96 * f64::max(weight.recip().sqrt(), spread / (runs.len() as f64).sqrt());
    let apart = 1.96 * (12.0 / gain(&all)).sqrt() / (TAU * longest as f64 * t);
    let estimate =
        |value: f64, off: f64, unit: &str| Estimate { value, low: value - off, high: value + off, unit: unit.into() };
    let fitted: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
    Some(Finding {
        effect: effect.into(),
        family: vec![effect.into()],
        port,
        p_value: log_p.exp().max(1e-300),
        says: format!("At {hz:.3} Hz {says}; its phase differs from record to record."),
        parameters: BTreeMap::from([
            ("depth".to_owned(), estimate(depth, off, "1")),
            ("frequency_hz".to_owned(), estimate(hz, apart, "Hz")),
        ]),
        place: everywhere(&fitted),
    })
}
