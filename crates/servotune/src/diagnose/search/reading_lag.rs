//! The given plant behind a lag of its reading: no balance of torques along recorded motion shows what filters the record itself.

use super::clearing::{Fitted, Tried};
use super::torque_balance::with_freedom;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::plain_fit::laws_descended;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::rules::{CLEARED_BETTER, LAG_INSTEAD};
use crate::numeric::digits::said;
use crate::physics::{AnyLaw, LawSetting, effect, sensor_lag};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Samples above which a lag of the reading is no mere delay.
const LAG_SAMPLES: f64 = 4.0;

impl Tried<'_> {
    /// The given plant behind the lag of its reading that leaves least.
    fn lagging(&self) -> Option<(f64, DiagnosisData, Model)> {
        let (ground, bare) = self.model(&self.own.form.given, None);
        let behind = |law: AnyLaw| {
            let setting = LawSetting::fixed(law);
            let lag = SelectedEffect { setting, continuous: Vec::new(), range: Vec::new(), step: 0 };
            let model = Model { chosen: vec![with_freedom(lag, &self.own.scene)], ..bare.clone() };
            let left = self.left(&ground, &model);
            left.is_finite().then_some((left, model))
        };
        let grid = effect(sensor_lag::FACTS.name)?.grid(&self.own.scene);
        let tried: Vec<(f64, Model)> = grid.into_par_iter().filter_map(behind).collect();
        let (left, model) = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((left, ground, model))
    }

    /// The same with the body fitted.
    pub(super) fn filtered(&self) -> Option<Fitted> {
        let (left, ground, model) = self.lagging()?;
        let fitted = self.fitted(&ground, &model).unwrap_or(model);
        Some(Fitted { left: self.left(&ground, &fitted).min(left), ground, model: fitted, curve: false })
    }

    /// What is said where such a lag alone explains nearly all that a linear refit does; `given` and `linear` are what these leave (rms).
    pub(super) fn lag_instead(&self, given: f64, linear: f64, size_of: &dyn Fn(f64) -> f64) -> Option<String> {
        if linear > CLEARED_BETTER * given {
            return None;
        }
        let (_, ground, model) = self.lagging()?;
        let model = laws_descended(&ground, &model, &self.whole)?;
        let left = size_of(self.left(&ground, &model));
        let share = (given * given - left * left) / (given * given - linear * linear);
        let time_s = model.chosen.first()?.setting.law.number(0)?;
        let slow = time_s > LAG_SAMPLES * self.own.scene.sample_time_s;
        (slow && share > LAG_INSTEAD).then(|| {
            format!(
                "one number explains {} % of what a linear refit does: the given plant behind a first-order low-pass of {} Hz (time constant {} s); look for a filter in the sensor or \
                 the drive before the plant is changed (sensor_lag, amplifier_lag)",
                said(100.0 * share, 3),
                said(1.0 / (TAU * time_s), 3),
                said(time_s, 3),
            )
        })
    }
}
