//! What repeats differ by around other plants than the one that the diagnosis set out from.
//!
//! In: the diagnosis data, plants. Out: for each plant one series (position_unit) a repeat, noise only. Repeats answer to other commands because the
//! controller hears other noise; a plant that is off leaves its error of that answer in the difference.

use super::diagnosis_data::DiagnosisData;
use super::equation_error_fit::linear_error;
use crate::diagnose::data::linear_form::{LinearForm, Sampled};
use crate::diagnose::noise::repeats::{in_laps, noise_of, noise_series, values, without_start};
use crate::diagnose::noise::torque_noise::Differences;
use crate::diagnose::rules::HEARD_BETTER;
use crate::lti::{LtiError, Plant};
use crate::numeric::statistics::rms;
use crate::physics::MotionScene;

/// What repeats differ by around each of some plants, each plant once, lines taken out as around the plant of `data`; nothing without repeats.
pub(in crate::diagnose) fn repeats_around(
    data: &DiagnosisData,
    plants: impl IntoIterator<Item = Plant>,
) -> Result<Vec<Differences>, LtiError> {
    let mut out: Vec<Differences> = Vec::new();
    if data.repeats.is_empty() {
        return Ok(out);
    }
    let own = errors(data, &data.heard)?;
    for plant in plants {
        if out.iter().any(|d| d.plant == plant) {
            continue;
        }
        let mut apart = errors(data, &plant)?;
        for ((_, e), (_, own)) in apart.iter_mut().zip(&own) {
            e.iter_mut().zip(own).for_each(|(e, o)| *e -= o);
        }
        let series = noise_series(&in_laps(&apart, &data.runs), &data.runs);
        let moved = without_start(&series, &|n| data.starts(n), &|x| data.whitener.apply(x));
        let mut series = data.repeats.clone();
        for ((_, x), (_, moved)) in series.iter_mut().zip(&moved) {
            x.iter_mut().zip(moved).for_each(|(x, m)| *x += m);
            data.whitener.colour(x);
        }
        out.push(Differences { plant, series: values(&series) });
    }
    Ok(out)
}

impl DiagnosisData {
    /// Whether what repeats differ by may be told anew. A free body is left alone: what its repeats differ by is mostly drift. So is a log on a
    /// lattice: repeats that round alike differ by too little.
    fn may_be_heard_anew(&self) -> bool {
        !self.repeats.is_empty() && self.grid.is_none() && self.is_sprung()
    }

    /// The same with the noise as repeats show it around another plant, where they differ less by it; none where they do not.
    pub fn heard_around(&self, plant: &Plant) -> Option<DiagnosisData> {
        if !self.may_be_heard_anew() || self.heard == *plant {
            return None;
        }
        let (t, spindle_hz) = (self.scene.sample_time_s, self.scene.spindle_hz);
        let heard = DiagnosisData::new(plant, self.runs.clone(), t, spindle_hz).ok()?;
        let scene = MotionScene { plant: self.scene.plant.clone(), ..heard.scene.clone() };
        let same = DiagnosisData { form: self.form.clone(), scene, foretold: self.foretold.clone(), ..heard };
        (same.repeats_rms < HEARD_BETTER * self.repeats_rms).then_some(same)
    }

    /// The same with the noise as repeats show it around a model with laws, `left` being what it leaves of every fit run in plain simulation, where
    /// they differ less by it; none where they do not. A law answers the other noise in each repeat, and a linear plant leaves that in their difference.
    pub fn heard_through(&self, left: &[Vec<f64>]) -> Option<DiagnosisData> {
        if !self.may_be_heard_anew() {
            return None;
        }
        let own: Vec<(usize, Vec<f64>)> = self.fit_runs.iter().copied().zip(left.iter().cloned()).collect();
        let series = noise_series(&in_laps(&own, &self.runs), &self.runs);
        let free = |n: usize| self.starts(n);
        let rms = rms(&values(&without_start(&series, &free, &|_| {})).concat());
        if rms.is_nan() || rms >= HEARD_BETTER * self.repeats_rms {
            return None;
        }
        let (levels, whitener, repeats) =
            noise_of(&series, &free, &self.form.given.body, self.scene.sample_time_s, true);
        Some(DiagnosisData { levels, whitener, repeats, repeats_rms: rms, ..self.clone() })
    }
}

/// Errors of the fit runs around a plant.
fn errors(data: &DiagnosisData, plant: &Plant) -> Result<Vec<(usize, Vec<f64>)>, LtiError> {
    let form = LinearForm::new(plant, data.scene.sample_time_s);
    let nominal = form.nominal(&vec![0.0; form.free_parameters.len()]);
    let sampled = Sampled::of(&nominal.plant, data.scene.sample_time_s)?;
    Ok(data.fit_runs.iter().map(|&r| (r, linear_error(&sampled, &nominal, &data.runs[r]))).collect())
}
