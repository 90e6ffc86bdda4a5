//! Slopes of the simulation error in the linear parameters and in the strengths of the effects.
//!
//! In: a fit, its linear parameters and what its effects' laws give. Out: for each of them the slope of the error of every mean run, not yet
//! whitened. A linear parameter moves few terms of the plant: the answers are kept term by term. Spring, damper and strengths enter
//! linearly: their slope is one answer.

use super::fit_inputs::Fit;
use super::regressors::{Drive, Entering, entering};
use crate::diagnose::data::linear_form::{FreeParameter, NominalModel, Sampled};
use crate::lti::TermAnswers;
use crate::physics::Entry;

/// Everything that the slopes at one point share.
pub(in crate::diagnose) struct Slopes<'a> {
    fit: &'a Fit<'a>,
    p: &'a [f64],
    nominal: NominalModel,
    sampled: Sampled,
    drives: &'a [(&'a Drive, &'a [f64])],
    records: Vec<Answers>,
}

/// One mean run.
struct Answers {
    /// To command and command effects.
    command: TermAnswers,
    /// To the torques of effects.
    effects: Option<TermAnswers>,
    /// To spring and damper of the nominal.
    body: Option<TermAnswers>,
    /// The answer of all three.
    sum: Vec<f64>,
}

impl Answers {
    fn of(
        fit: &Fit,
        nominal: &NominalModel,
        sampled: &Sampled,
        drives: &[(&Drive, &[f64])],
        segment: usize,
    ) -> Answers {
        let run = &fit.means[segment];
        let Entering { command, torque, .. } = entering(drives, run, segment, None);
        let body = (nominal.spring != 0.0 || nominal.damper != 0.0)
            .then(|| TermAnswers::of(&sampled.direct, &nominal.torque(&fit.trajectories[segment].samples)));
        let command = TermAnswers::of(&sampled.delayed, &command);
        let effects = torque.map(|w| TermAnswers::of(&sampled.direct, &w));
        let mut made = Answers { command, effects, body, sum: Vec::new() };
        made.sum = made.under(sampled, 1.0, run.len());
        made
    }

    /// The position under another plant, its spring and damper `body` times as strong.
    fn under(&self, sampled: &Sampled, body: f64, len: usize) -> Vec<f64> {
        let mut y = vec![0.0; len];
        self.command.add(&sampled.delayed, 1.0, &mut y);
        if let Some(w) = &self.effects {
            w.add(&sampled.direct, 1.0, &mut y);
        }
        if let Some(w) = &self.body {
            w.add(&sampled.direct, body, &mut y);
        }
        y
    }
}

impl<'a> Slopes<'a> {
    /// At linear parameters `p`, the effects' laws and strengths as given; none where these parameters make no plant.
    pub fn at(fit: &'a Fit<'a>, p: &'a [f64], drives: &'a [(&'a Drive, &'a [f64])]) -> Option<Slopes<'a>> {
        let nominal = fit.form.nominal(p);
        let sampled = Sampled::of(&nominal.plant, fit.scene.sample_time_s).ok()?;
        let records = (0..fit.means.len()).map(|i| Answers::of(fit, &nominal, &sampled, drives, i)).collect();
        Some(Slopes { fit, p, nominal, sampled, drives, records })
    }

    /// The slope in linear parameter `i`, of every mean run; by a difference over `step` where it does not enter linearly.
    pub fn free_parameter(&self, i: usize, step: f64) -> Vec<Vec<f64>> {
        let mut moved = self.p.to_vec();
        moved[i] += step;
        let there = self.fit.form.nominal(&moved);
        let here = &self.nominal;
        if matches!(self.fit.form.free_parameters[i], FreeParameter::Stiffness | FreeParameter::Viscous) {
            let [spring, damper] = [there.spring - here.spring, there.damper - here.damper].map(|d| -d / step);
            let less = NominalModel { spring, damper, ..there };
            let along = self.fit.trajectories.iter();
            return along.map(|t| self.answer(Entry::Torque, &less.torque(&t.samples))).collect();
        }
        // Gain and modes weigh spring and damper alike.
        let weigh = |c: &NominalModel| c.arm_over_record() * if c.spring != 0.0 { c.spring } else { c.damper };
        let body = if weigh(here) != 0.0 { weigh(&there) / weigh(here) } else { 1.0 };
        let Ok(sampled) = Sampled::of(&there.plant, self.fit.scene.sample_time_s) else {
            return self.records.iter().map(|r| vec![0.0; r.sum.len()]).collect();
        };
        let one = |r: &Answers| {
            let mut y = r.under(&sampled, body, r.sum.len());
            y.iter_mut().zip(&r.sum).for_each(|(y, base)| *y = (base - *y) / step);
            y
        };
        self.records.iter().map(one).collect()
    }

    /// The slope in strength `place` of an effect, of every mean run.
    pub fn strength(&self, (effect, place): (usize, usize)) -> Vec<Vec<f64>> {
        let (drive, strengths) = &self.drives[effect];
        let one = |(segment, run): (usize, &crate::diagnose::data::run::Run)| {
            let own = drive.own(strengths, segment);
            // The strengths of another record move nothing here.
            let column = place.checked_sub(strengths.len() - own.len()).and_then(|j| drive.segments[segment].get(j));
            match column {
                Some(column) => self.answer(drive.entry, &column.iter().map(|v| -v).collect::<Vec<f64>>()),
                None => vec![0.0; run.len()],
            }
        };
        self.fit.means.iter().enumerate().map(one).collect()
    }

    fn answer(&self, entry: Entry, column: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; column.len()];
        match entry {
            Entry::Command => self.sampled.delayed.add_response(column, &mut y),
            Entry::Torque => self.sampled.direct.add_response(column, &mut y),
            Entry::Position => y.copy_from_slice(column),
        }
        y
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::diagnose::data::run::Run;
    use crate::diagnose::data::run::tests::run_at;
    use crate::diagnose::fit::diagnosis_data::DiagnosisData;
    use crate::diagnose::fit::regressors::drive;
    use crate::diagnose::fit::selected_effect::SelectedEffect;
    use crate::numeric::random::Random;
    use crate::physics::dead_band::DeadBand;
    use crate::physics::offset_drift::OffsetDrift;
    use crate::physics::pivot_friction::{Loading, PivotFriction};
    use crate::physics::{AnyLaw, LawSetting};
    use crate::twin::recording::{multisine, record, scene, stroke};
    use crate::twin::{MachineClass, nominal_controller, paper_machine};

    const SAMPLES: usize = 600;

    fn run(group: usize, seed: u64) -> Run {
        let plant = paper_machine(MachineClass::Tunable).unwrap();
        let controller = nominal_controller().unwrap();
        let scene = scene(&plant, controller.sample_time_s, 5.0, SAMPLES, 3e-3);
        let reference = stroke(SAMPLES, SAMPLES / 10, SAMPLES / 3, 2.0 + group as f64);
        let excitation = multisine(SAMPLES, 40, 0.03);
        let mut random = Random::new(seed);
        let rows = record(&scene, &[], &controller, &reference, &excitation, &mut random).unwrap();
        let column = |i: usize| -> Vec<f64> { rows.iter().map(|r| r[i]).collect() };
        let (command, excitation) = (column(2), column(1));
        Run {
            name: format!("r{seed}"),
            group,
            reference: Some(column(0)),
            input: command.iter().zip(&excitation).map(|(u, d)| u + d).collect(),
            command,
            excitation,
            ..run_at(column(3))
        }
    }

    /// An error whose square is no number is far off; an empty one would count as nothing left, and a model that runs away as the best.
    #[test]
    fn an_error_beyond_any_square_is_infinite_and_as_long_as_the_record() {
        let plant = paper_machine(MachineClass::Tunable).unwrap();
        let controller = nominal_controller().unwrap();
        let scene = scene(&plant, controller.sample_time_s, 5.0, SAMPLES, 3e-3);
        let run = Run { position: vec![1e200; SAMPLES], rested: false, ..run(0, 1) };
        let judged = crate::diagnose::fit::simulated_model::SimulatedModel {
            plant: &plant,
            effects: Vec::new(),
            own: Vec::new(),
            lines: &[],
            fit: None,
            scene: &scene,
        };
        let errors = crate::diagnose::fit::simulation::errors(&judged, &[&run], None);
        assert_eq!(errors[0].len(), SAMPLES);
        assert!(errors[0].iter().all(|e| *e == f64::INFINITY), "{:?}", &errors[0][..3]);
    }

    fn chosen(law: impl Into<AnyLaw>, strengths: &[f64]) -> SelectedEffect {
        let setting = LawSetting::new(law, strengths.to_vec());
        let count = setting.law.numbers().len();
        SelectedEffect { setting, continuous: vec![false; count], range: vec![[0.1, 10.0]; count], step: 0 }
    }

    /// Against central differences of the simulation error, which is made without any of this.
    #[test]
    fn slopes_are_those_of_the_simulation_error() {
        let plant = paper_machine(MachineClass::Tunable).unwrap();
        let t = nominal_controller().unwrap().sample_time_s;
        let runs = vec![run(0, 1), run(0, 2), run(1, 3), run(1, 4)];
        let data = DiagnosisData::new(&plant, runs, t, None).unwrap();
        let laws = || {
            vec![
                chosen(PivotFriction::of(2.5, Loading::Dahl), &[0.012]),
                chosen(DeadBand { half_width: 0.01, gain_inside: None }, &[1.0]),
                chosen(OffsetDrift, &[1e-4, 2e-4]),
            ]
        };
        let mut random = Random::new(9);
        let p: Vec<f64> = data.form.free_parameters.iter().map(|_| 0.01 * random.normal()).collect();
        let fit = data.fit(laws());
        let made: Vec<_> = laws().iter().map(|c| drive(&c.setting.law, fit.scene, fit.trajectories)).collect();
        let settings = laws();
        let drives: Vec<_> = made.iter().zip(&settings).map(|(d, c)| (d, &c.setting.strengths[..])).collect();
        let slopes = Slopes::at(&fit, &p, &drives).unwrap();
        let close = |found: &[Vec<f64>], up: &[Vec<f64>], down: &[Vec<f64>], step: f64, what: &str| {
            for (f, (u, d)) in found.iter().zip(up.iter().zip(down)) {
                let size = f.iter().fold(1e-12, |m: f64, v| m.max(v.abs()));
                for (f, (u, d)) in f.iter().zip(u.iter().zip(d)) {
                    let difference = (u - d) / (2.0 * step);
                    // One-sided against central: the curvature over the step.
                    assert!((f - difference).abs() < 2e-3 * size, "{what}: {f} {difference} of {size}");
                }
            }
        };
        for (i, free_parameter) in data.form.free_parameters.iter().enumerate() {
            let moved = |by: f64| {
                let mut to = p.clone();
                to[i] += by;
                fit.errors(&to)
            };
            close(&slopes.free_parameter(i, 1e-5), &moved(1e-5), &moved(-1e-5), 1e-5, &format!("{free_parameter:?}"));
        }
        for (e, place) in [(0, 0), (2, 0), (2, 1)] {
            let moved = |by: f64| {
                let mut all = laws();
                all[e].setting.strengths[place] += by;
                data.fit(all).errors(&p)
            };
            let step = 1e-4;
            close(&slopes.strength((e, place)), &moved(step), &moved(-step), step, "strength");
        }
    }
}
