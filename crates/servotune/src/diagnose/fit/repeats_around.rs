//! What repeats differ by around another plant than the one that the diagnosis set out from.
//!
//! In: the diagnosis data, a plant. Out: one series (position_unit) a repeat, noise only. Repeats answer to other commands because the controller
//! hears other noise; a plant that is off leaves its error of that answer in the difference.

use super::diagnosis_data::DiagnosisData;
use super::equation_error_fit::simulation_error;
use super::trajectory::Trajectory;
use crate::diagnose::data::linear_form::{LinearForm, NominalModel, Sampled, free_motions};
use crate::diagnose::noise::repeats::{in_laps, noise_series, without_start};
use crate::lti::{LtiError, Plant};

/// Errors of the fit runs around a plant, its linear answer to their commands only.
fn errors(data: &DiagnosisData, plant: &Plant) -> Result<Vec<(usize, Vec<f64>)>, LtiError> {
    let form = LinearForm::new(plant, data.scene.sample_time_s);
    let nominal = form.nominal(&vec![0.0; form.free_parameters.len()]);
    let sampled = Sampled::of(&nominal.plant, data.scene.sample_time_s)?;
    let plain = NominalModel { spring: 0.0, damper: 0.0, ..nominal };
    let still = Trajectory { samples: Vec::new(), unexplained: Vec::new(), repeats: Vec::new() };
    let error = |&r: &usize| (r, simulation_error(&sampled, &plain, &[], &data.runs[r], &still, 0));
    Ok(data.fit_runs.iter().map(error).collect())
}

/// What repeats differ by around `plant`, lines taken out as around the plant of `data`.
pub(in crate::diagnose) fn repeats_around(data: &DiagnosisData, plant: &Plant) -> Result<Vec<Vec<f64>>, LtiError> {
    let mut white = data.repeats.clone();
    if *plant != data.form.given {
        let mut apart = errors(data, plant)?;
        for ((_, e), (_, given)) in apart.iter_mut().zip(errors(data, &data.form.given)?) {
            e.iter_mut().zip(given).for_each(|(e, g)| *e -= g);
        }
        let free = |n: usize| free_motions(&data.form.given.body, data.scene.sample_time_s, n).to_vec();
        let series = noise_series(&in_laps(&apart, &data.runs), &data.runs);
        let series = without_start(&series, &free, &|x| data.whitener.apply(x));
        for ((_, e), (_, more)) in white.iter_mut().zip(series) {
            e.iter_mut().zip(more).for_each(|(e, m)| *e += m);
        }
    }
    let colour = |(_, mut x): (usize, Vec<f64>)| {
        data.whitener.colour(&mut x);
        x
    };
    Ok(white.into_iter().map(colour).collect())
}
