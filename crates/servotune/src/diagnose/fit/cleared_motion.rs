//! Motion of runs cleared of what a model adds in the sensor, and errors of models along it.
//!
//! In: runs and a model. Out: the motion that its laws act on, made in the same way for runs that were fitted and for any other; errors (position_unit).

use super::diagnosis_data::DiagnosisData;
use super::equation_error_fit::simulation_error;
use super::model::Model;
use super::regressors::{Drive, drive, raw_columns};
use super::selected_effect::SelectedEffect;
use super::trajectory::{Smoother, Trajectory, acting};
use crate::diagnose::data::linear_form::{NominalModel, Sampled, body_numbers, free_motions, free_scales};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::NuisanceBasis;
use crate::lti::LtiError;
use crate::numeric::least_squares::Qr;
use crate::physics::{Entry, Port, Sample};

impl DiagnosisData {
    /// The motion anew for a model that was found: what the sensor adds is taken out of the position, because laws act on where
    /// the arm is and not on what the encoder says; and the torques of the model help the smoother.
    pub fn corrected(mut self, p: &[f64], chosen: &[SelectedEffect]) -> DiagnosisData {
        let nominal = self.form.nominal(p);
        let Ok(sampled) = Sampled::of(&nominal.plant, self.scene.sample_time_s) else { return self };
        let every: Vec<&SelectedEffect> = chosen.iter().collect();
        let mut means = self.means.clone();
        let own = means.iter_mut().zip(&self.trajectories).enumerate();
        let known: Vec<Vec<f64>> =
            own.map(|(i, (run, motion))| self.clear(run, motion, i, (&nominal, &sampled), &every)).collect();
        self.smooth(&nominal, &sampled, &means, &known);
        self
    }

    /// Takes what laws add in the sensor out of a run's position; the torque (command_unit) of the plant's spring and damper and of the laws along
    /// its motion.
    fn clear(
        &self,
        run: &mut Run,
        motion: &Trajectory,
        record: usize,
        (nominal, sampled): (&NominalModel, &Sampled),
        chosen: &[&SelectedEffect],
    ) -> Vec<f64> {
        let arm = nominal.arm_over_record();
        let holds = |s: &Sample| arm * (nominal.spring * s.x + nominal.damper * s.v);
        let mut torque: Vec<f64> = motion.samples.iter().map(holds).collect();
        for c in chosen {
            let facts = c.setting.facts();
            let sensed = facts.entry == Entry::Position && matches!(facts.port, Port::Sensor | Port::Disk);
            if !sensed && facts.entry == Entry::Position {
                continue;
            }
            let raw = raw_columns(&c.setting.law, &self.scene, motion);
            for (column, s) in raw.iter().zip(c.own(record)) {
                // A command reaches the arm late, like the one it is added to.
                let late = (facts.entry == Entry::Command).then(|| acting(&sampled.delayed, column, 0.0));
                let column = late.as_ref().unwrap_or(column);
                if sensed {
                    run.position.iter_mut().zip(column).for_each(|(y, v)| *y -= s * v);
                } else {
                    torque.iter_mut().zip(column).for_each(|(w, v)| *w += s * v);
                }
            }
        }
        torque
    }

    /// The error of a model on any run along its motion, effects of each record's own left out: the recorded motion, cleared of what that model adds in
    /// the sensor where it is told of it.
    fn raw_along(&self, run: &Run, model: &Model, cleared: bool) -> Result<(NominalModel, Vec<f64>), LtiError> {
        let nominal = self.form.nominal(&model.refitted.p);
        let sampled = Sampled::of(&nominal.plant, self.scene.sample_time_s)?;
        let lasting: Vec<&SelectedEffect> = model.chosen.iter().filter(|c| !c.setting.facts().per_record).collect();
        let spindle_hz = self.scene.spindle_hz.unwrap_or(0.0);
        let smoothed = |run: &Run, known: Vec<f64>| {
            let (alone, known) = (std::slice::from_ref(run), [known]);
            let smoother = Smoother::of(&nominal.plant, &sampled.delayed, self.levels.sensor_rms, alone, &known);
            smoother.smooth(run, &known[0], &sampled.delayed, spindle_hz)
        };
        let mut motion = [smoothed(run, Vec::new())];
        if cleared {
            let mut clear = run.clone();
            let known = self.clear(&mut clear, &motion[0], 0, (&nominal, &sampled), &lasting);
            motion = [smoothed(&clear, known)];
        }
        let drives: Vec<Drive> = lasting.iter().map(|c| drive(&c.setting.law, &self.scene, &motion)).collect();
        let parts: Vec<(&Drive, &[f64])> =
            drives.iter().zip(lasting.iter().map(|c| &c.setting.strengths[..])).collect();
        let e = simulation_error(&sampled, &nominal, &parts, run, &motion[0], 0);
        Ok((nominal, e))
    }

    /// The whitened error of a model on any run along its motion, with `own` columns of the record taken out.
    pub fn along(&self, run: &Run, model: &Model, own: &[Vec<f64>]) -> Result<Vec<f64>, LtiError> {
        let (_, mut e) = self.raw_along(run, model, true)?;
        let mut basis = NuisanceBasis::default();
        for mut c in own.iter().cloned() {
            self.whitener.apply(&mut c);
            basis.add_local(0, c);
        }
        self.whitener.apply(&mut e);
        basis.project(&mut e);
        Ok(e)
    }

    /// The constant torque on a run beside command and laws (command_unit): what the error along the recorded motion asks for.
    pub fn constant_torque(&self, run: &Run, model: &Model) -> Result<f64, LtiError> {
        let (nominal, mut e) = self.raw_along(run, model, false)?;
        let (t, n, body) = (self.scene.sample_time_s, run.len(), &self.form.given.body);
        self.whitener.apply(&mut e);
        let mut free = free_motions(body, t, n);
        free.iter_mut().for_each(|c| self.whitener.apply(c));
        let mut qr = Qr::default();
        qr.factor(n, 3, |a| a.chunks_exact_mut(n).zip(&free).for_each(|(a, c)| a.copy_from_slice(c)));
        let acceleration = qr.solve(&mut e)[2] * free_scales(body, t, n)[2];
        let gain = body_numbers(&nominal.plant.body).0 * nominal.plant.resonance_gain;
        Ok(acceleration * nominal.arm_over_record() / gain - run.before)
    }
}
