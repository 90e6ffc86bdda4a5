//! The corrected model: the refitted plant with the effects as `[[plant.physics]]`.
//!
//! Where a bearing that sticks takes over the spring of the body, little or less than nothing of that spring is left; the body
//! then is a free inertia and the rest stands as a plain cable spring, of either sign.

use super::diagnosis_data::DiagnosisData;
use super::selected_effect::SelectedEffect;
use super::simulated_model::SimulatedModel;
use crate::diagnose::data::linear_form::{LinearForm, body_numbers};
use crate::diagnose::rules::FREE_BODY;
use crate::lti::{Body, PhysicsEntry, Plant};
use crate::physics::cable_spring::CableSpring;
use crate::physics::{LawSetting, MotionScene};

/// The plant and the effects that simulate it.
#[derive(Clone)]
pub struct Corrected {
    /// The plant, physics entries included.
    pub plant: Plant,
    /// The effects of the entries.
    pub effects: Vec<LawSetting>,
}

impl Corrected {
    /// It in simulation, with the lines that are each record's own.
    pub(in crate::diagnose) fn alone<'a>(&'a self, data: &'a DiagnosisData) -> SimulatedModel<'a> {
        SimulatedModel { lines: &data.lines, ..SimulatedModel::of(&self.plant, &self.effects, &data.scene) }
    }
}

/// The entry of an effect with named parameters.
pub(in crate::diagnose) fn entry(setting: &LawSetting, scene: &MotionScene) -> PhysicsEntry {
    let parameters = setting.parameters(scene).into_iter().map(|q| (q.name.to_owned(), q.value));
    PhysicsEntry { effect: setting.facts().name.into(), parameters: parameters.collect(), curve: None }
}

/// Makes the corrected model of a fit; `per_record` effects belong to records, not to the machine, and stay out.
pub fn corrected(form: &LinearForm, p: &[f64], chosen: &[SelectedEffect], scene: &MotionScene) -> Corrected {
    let mut plant = form.plant(p);
    let mut effects: Vec<LawSetting> = Vec::new();
    let mut entries = Vec::new();
    for c in chosen.iter().filter(|c| !c.setting.facts().per_record) {
        entries.push(entry(&c.setting, scene));
        effects.push(c.setting.clone());
    }
    let nominal = form.nominal(p);
    let (b, k0, c0) = body_numbers(&nominal.plant.body);
    let stiffness = k0 - nominal.spring * b * form.given.resonance_gain;
    if k0 > 0.0 && stiffness < FREE_BODY * k0 {
        let viscous = c0 - nominal.damper * b * form.given.resonance_gain;
        plant.body = Body::FreeInertia { acceleration_gain: b, viscous_rate_per_s: viscous.max(0.0) };
        let strength = stiffness / (b * form.given.resonance_gain);
        let spring = LawSetting::new(CableSpring { creep_time_s: None, centre: 0.0 }, vec![strength, 0.0]);
        entries.push(entry(&spring, scene));
        effects.push(spring);
    }
    plant.physics = entries;
    Corrected { plant, effects }
}
