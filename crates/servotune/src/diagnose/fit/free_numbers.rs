//! Which numbers of a model a fit by simulation moves, and where they stand among all.

use super::diagnosis_data::DiagnosisData;
use super::model::Model;
use crate::diagnose::data::linear_form::FreeParameter;

/// What is moved: places in the linear parameters, then strengths and numbers by effect and place.
#[derive(Clone)]
pub(in crate::diagnose) struct Free {
    pub free_parameters: Vec<usize>,
    pub strengths: Vec<[usize; 2]>,
    pub numbers: Vec<[usize; 2]>,
}

impl Free {
    pub(super) fn of(data: &DiagnosisData, model: &Model, moves: impl Fn(&FreeParameter) -> bool) -> Free {
        let free_parameters: Vec<usize> =
            (0..data.form.free_parameters.len()).filter(|&i| moves(&data.form.free_parameters[i])).collect();
        let (mut strengths, mut numbers) = (Vec::new(), Vec::new());
        for (e, c) in model.chosen.iter().enumerate() {
            let facts = c.setting.facts();
            if !facts.fixed && !facts.per_record {
                // A strength of exactly 0 belongs to a term that this form of the law has not.
                let there = (0..c.setting.strengths.len()).filter(|&i| c.setting.strengths[i] != 0.0);
                strengths.extend(there.map(|i| [e, i]));
            }
            if !facts.per_record {
                numbers.extend((0..c.continuous.len()).filter(|&i| c.continuous[i]).map(|i| [e, i]));
            }
        }
        Free { free_parameters, strengths, numbers }
    }
}

/// Where each number that was moved stands among all numbers of a fit: linear parameters, strengths, numbers.
pub(in crate::diagnose) fn places(free: &Free, model: &Model) -> Vec<usize> {
    let strengths = |e: usize| {
        let c = &model.chosen[e];
        if c.setting.facts().fixed { 0 } else { c.setting.strengths.len() }
    };
    let free_parameters = model.refitted.p.len();
    let all: usize = (0..model.chosen.len()).map(strengths).sum();
    let strength = |&[e, i]: &[usize; 2]| free_parameters + (0..e).map(strengths).sum::<usize>() + i;
    let moving = |e: usize, to: usize| model.chosen[e].continuous[..to].iter().filter(|c| **c).count();
    let numbers = |&[e, i]: &[usize; 2]| {
        let before: usize = (0..e).map(|e| moving(e, model.chosen[e].continuous.len())).sum();
        free_parameters + all + before + moving(e, i)
    };
    free.free_parameters
        .iter()
        .copied()
        .chain(free.strengths.iter().map(strength))
        .chain(free.numbers.iter().map(numbers))
        .collect()
}
