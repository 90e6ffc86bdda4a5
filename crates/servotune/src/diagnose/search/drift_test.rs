//! Whether what a law of each record's own took follows the motion: a drift that comes anew with every repeat of one move is none.
//!
//! Analysis of variance of the strengths: between moves against between repeats of one move, each in units of its error. What goes
//! its own way differs as much from repeat to repeat as from move to move, or is the same everywhere.

use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::stacked_records::NuisanceBasis;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::regressors::white_columns;
use crate::diagnose::rules::{DRIFT_FOLLOWS_MOTION, DRIFT_REPEATS};
use crate::numeric::least_squares::dot;
use nalgebra::{DMatrix, DVector};

/// Whether the strengths of effect `at`, which are each record's own, follow the motion; false where too few repeats tell.
pub(super) fn follows_motion(data: &DiagnosisData, model: &Model, at: usize) -> bool {
    let chosen = &model.chosen[at];
    let facts = chosen.setting.facts();
    if !facts.per_record || !chosen.effect().independent_of_motion() {
        return false;
    }
    let nominal = data.form.nominal(&model.refitted.p).plant;
    let Ok(sampled) = Sampled::of(&nominal, data.scene.sample_time_s) else { return false };
    let segments = &data.stack.segments;
    let local = data.fit(vec![]).local_basis();
    let m = facts.columns;
    let (mut total, mut pull) = (DMatrix::zeros(m, m), DVector::zeros(m));
    let mut moves: Vec<(DMatrix<f64>, DVector<f64>)> = Vec::new();
    let (mut within, mut repeats) = (0.0, 0);
    for (i, s) in segments.iter().enumerate() {
        let motion = &data.trajectories[i];
        let law = &chosen.setting.law;
        let columns = white_columns(law, &data.scene, motion, &sampled, &data.whitener);
        let mut basis = NuisanceBasis::default();
        let free: Vec<Vec<f64>> = columns
            .into_iter()
            .map(|mut c| {
                let mut whole = vec![0.0; data.stack.total];
                whole[s.start..s.start + s.len].copy_from_slice(&c);
                local.project(&mut whole);
                c.copy_from_slice(&whole[s.start..s.start + s.len]);
                c
            })
            .collect();
        free.iter().for_each(|c| basis.add_local(0, c.clone()));
        let of_segment: Vec<&Vec<f64>> =
            data.repeats.iter().filter(|(r, e)| s.runs.contains(r) && e.len() == s.len).map(|(_, e)| e).collect();
        if of_segment.len() > 1 {
            let n = of_segment.len() as f64;
            // Repeats come scaled back to the noise of one record.
            let spans = vec![[0, s.len]; of_segment.len()];
            let squares = basis.coordinates(&of_segment, &spans).iter().flatten().map(|c| c * c).sum::<f64>();
            within += squares * (n - 1.0) / n;
            repeats += of_segment.len() - 1;
        }
        let information = DMatrix::from_fn(m, m, |j, k| s.weight * s.weight * dot(&free[j], &free[k]));
        let strengths = DVector::from_column_slice(&chosen.own(i)[..m]);
        pull += &information * &strengths;
        total += &information;
        moves.push((information, strengths));
    }
    if repeats < DRIFT_REPEATS || moves.len() < 2 {
        return false;
    }
    if !total.iter().chain(pull.iter()).all(|x| x.is_finite()) {
        return false;
    }
    let Some(common) = total.svd(true, true).solve(&pull, 1e-12).ok() else { return false };
    let between: f64 = moves
        .iter()
        .map(|(information, strengths)| {
            let off = strengths - &common;
            off.dot(&(information * &off))
        })
        .sum();
    let between = between / ((moves.len() - 1) * m) as f64;
    let within = (within / (repeats * m) as f64).max(1.0);
    between > DRIFT_FOLLOWS_MOTION * within
}
