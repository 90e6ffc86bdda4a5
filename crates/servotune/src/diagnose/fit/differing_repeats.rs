//! What repeats tell of an amplifier by differing: the controller makes other commands of other noise, and a law that does not answer
//! in proportion to the command adds to the difference.
//!
//! The mean over repeats and what they differ by are independent under white noise, so that gains of both add up.

use super::diagnosis_data::DiagnosisData;
use super::regressors::columns_along;
use super::selected_effect::SelectedEffect;
use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::repeat_difference::Difference;
use crate::diagnose::noise::repeats::{noise_series, without_start};
use crate::numeric::least_squares::dot;
use crate::physics::{AnyLaw, Entry, Sample};

impl Difference {
    /// What the law takes of the sum of squares, its strength being 1.
    pub fn gain(&self) -> f64 {
        2.0 * self.along - self.square
    }

    /// The differences of a law among the repeats; zero where it answers in proportion to the command.
    pub fn of(data: &DiagnosisData, sampled: &Sampled, law: &AnyLaw) -> Difference {
        let mut sum = Difference::default();
        if !law.effect().is_hard_nonlinearity() || law.facts().entry != Entry::Command {
            return sum;
        }
        for (s, motion) in data.stack.segments.iter().zip(&data.trajectories).filter(|(s, _)| s.runs.len() > 1) {
            let answer = |(&run, own): (&usize, &Vec<Sample>)| {
                let column = columns_along(law, &data.scene, own, &motion.turned).swap_remove(0);
                let mut y = vec![0.0; s.len];
                sampled.delayed.add_response(&column, &mut y);
                (run, y)
            };
            let answers: Vec<(usize, Vec<f64>)> = s.runs.iter().zip(&motion.repeats).map(answer).collect();
            if answers.iter().all(|(_, y)| y.iter().all(|v| *v == 0.0)) {
                continue;
            }
            // Scaled like the records' own differences, of which one in so many is no information.
            let apart = noise_series(&answers, &data.runs);
            let apart = without_start(&apart, &|n| data.starts(n), &|x| data.whitener.apply(x));
            let repeats = s.runs.len() as f64;
            let by = (repeats - 1.0) / repeats * s.weight * s.weight / repeats;
            for (run, law) in &apart {
                let Some((_, recorded)) = data.repeats.iter().find(|(r, e)| r == run && e.len() == law.len()) else {
                    continue;
                };
                sum.along += by * dot(law, recorded);
                sum.square += by * dot(law, law);
            }
        }
        sum
    }
}

/// What all effects of a model take of what repeats differ by.
pub fn differing(data: &DiagnosisData, chosen: &[SelectedEffect], p: &[f64]) -> f64 {
    if !chosen.iter().any(|c| c.effect().is_hard_nonlinearity()) {
        return 0.0;
    }
    let Ok(sampled) = Sampled::of(&data.form.nominal(p).plant, data.scene.sample_time_s) else { return 0.0 };
    chosen.iter().map(|c| Difference::of(data, &sampled, &c.setting.law).gain()).sum()
}
