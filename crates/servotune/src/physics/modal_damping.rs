//! The damping of a resonance grows with its amplitude, as in bolted joints.
//!
//! zeta_j(A) = zeta_j (1 + g A), A the amplitude of the mode's share of the position: q' = (Re p (1 + g |2 q|) + j Im p) q + r i (a
//! complex modal coordinate carries its amplitude; micro-slip of joints, Segalman 2005). The column is the share with the
//! growing damping minus that without.
//!
//! Or, where the resonance is a stage of a chain and its damper feels the stage's rate: zeta_j (1 + g |q1|), q1 the rate of the
//! stage's deflection over w_j (`physics::stage`).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Prior};
use super::mode_shift::{MODE, MODE_HZ, ModeForm, STAGE, mode};
use super::pair::{Pair, Turn};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::stage::{Next, Stage};
use nalgebra::Complex;
use std::cell::Cell;

/// The mode whose damping grows.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalDamping {
    /// Its number in `plant.modes`, counted from 0.
    pub mode: usize,
    /// Share by which its damping grows over its amplitude (1/position_unit); below 0 where it falls.
    pub growth: f64,
    /// How its part of the motion is formed.
    pub form: ModeForm,
}

const GROWTH: Key = Key::new("growth", Unit::PerPosition, "g").prior(Prior::Words("0.3 to 1000 over the amplitude that the largest command as a tone would reach, and -0.3 to -100; of a stage 0.3 to 300"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "modal_damping",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "zeta_j(A) = zeta_j (1 + g A), A = |2 q_j|, in the modal form q' = (Re p (1 + g A) + j Im p) q + r i; or A = |q1|, the rate of a stage",
    keys: &[MODE, GROWTH, STAGE, MODE_HZ],
    source: "D. J. Segalman, A Four-Parameter Iwan Model for Lap-Type Joints, Journal of Applied Mechanics 72(5), 2005",
    says: "a vibration of the arm is damped differently when it is large, as where a joint slips",
    confused_with: &["unmodelled_resonance", "mode_shift", "current_saturation"],
    experiment: "the same multisine around the vibration at three amplitudes over a decade",
    band_hz: [200.0, 12000.0],
};

/// Range of the factor on the damping: it never falls to nothing and never stiffens the step.
const FACTOR: [f64; 2] = [0.02, 50.0];

struct Joint {
    pair: Option<Pair>,
    /// The step without the growing damping.
    plain: Option<Turn>,
    growth: f64,
    step: f64,
    /// The modal coordinate with it and without.
    q: [Complex<f64>; 2],
    /// The next ones under a current: asked for by the column and by the step.
    ahead: Cell<Option<(f64, [Complex<f64>; 2])>>,
}

impl Joint {
    fn of(pair: Option<Pair>, growth: f64, step: f64) -> Joint {
        let plain = pair.map(|p| Turn::of(p.pole, p.residue, step));
        Joint { pair, plain, growth, step, q: [Complex::new(0.0, 0.0); 2], ahead: Cell::new(None) }
    }

    fn next(&self, from: &Sample) -> [Complex<f64>; 2] {
        if let Some((_, next)) = self.ahead.get().filter(|(i, _)| *i == from.i) {
            return next;
        }
        let (Some(pair), Some(plain)) = (self.pair, self.plain) else { return self.q };
        let damped = |amplitude: f64| {
            let by = (1.0 + self.growth * amplitude).clamp(FACTOR[0], FACTOR[1]);
            Turn::of(Complex::new(pair.pole.re * by, pair.pole.im), pair.residue, self.step)
        };
        // Amplitude at the start, then at the middle of both ends: second order in the step.
        let amplitude = 2.0 * self.q[0].norm();
        let guess = damped(amplitude).after(self.q[0], from.i);
        let middle = 0.5 * (amplitude + 2.0 * guess.norm());
        let next = [damped(middle).after(self.q[0], from.i), plain.after(self.q[1], from.i)];
        self.ahead.set(Some((from.i, next)));
        next
    }
}

impl Law for Joint {
    fn columns(&self, from: &Sample, _to: &Sample, out: &mut [f64]) {
        let q = self.next(from);
        out[0] = 2.0 * (q[0].re - q[1].re);
    }

    fn commit(&mut self, from: &Sample, _to: &Sample) {
        self.q = self.next(from);
        self.ahead.set(None);
    }
}

/// The damper of one stage of a chain.
struct Damper {
    stage: Stage,
    growth: f64,
}

impl Damper {
    fn next(&self, from: &Sample) -> Next {
        self.stage.next(from.i, 0.0, |s, x| {
            let damping = |rate: f64| s.damping * (1.0 + self.growth * rate).clamp(FACTOR[0], FACTOR[1]);
            let rate = s.moved[1].abs();
            let guess = s.moved_by(s.w_rad_s, damping(rate), x);
            s.moved_by(s.w_rad_s, damping(0.5 * (rate + guess[1].abs())), x)
        })
    }
}

impl Law for Damper {
    fn columns(&self, from: &Sample, _to: &Sample, out: &mut [f64]) {
        out[0] = self.stage.change(&self.next(from));
    }

    fn commit(&mut self, from: &Sample, _to: &Sample) {
        let next = self.next(from);
        self.stage.take(from.i, next);
    }
}

impl Parametric for ModalDamping {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<ModalDamping> {
        let mut all = Vec::new();
        let at = |mode, growth, form| ModalDamping { mode, growth, form };
        for (j, pair) in Pair::all(scene) {
            // The amplitude that the largest command as a tone at the mode would reach; real excitation stays below it.
            let reach = scene.command * pair.residue.norm() / pair.pole.re.abs();
            if reach > 0.0 && reach.is_finite() {
                all.extend(logarithmic(0.3, 1000.0, 10).into_iter().map(|g| at(j, g / reach, ModeForm::Modal)));
                all.extend(logarithmic(0.3, 100.0, 6).into_iter().map(|g| at(j, -g / reach, ModeForm::Modal)));
            }
            // The same of a stage: the body's answer at the mode, raised by it.
            let Some(m) = scene.plant.modes.get(j) else { continue };
            let reach = scene.command * scene.acceleration_gain().abs()
                / (2.0 * m.pole_damping_ratio * m.pole_rad_s * m.pole_rad_s);
            if reach > 0.0 && reach.is_finite() {
                all.extend(logarithmic(0.3, 300.0, 7).into_iter().map(|g| at(j, g / reach, ModeForm::Stage)));
            }
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.growth)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.mode, usize::from(self.form == ModeForm::Stage)]
    }

    fn member(&self) -> usize {
        self.mode
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        if self.form == ModeForm::Stage
            && let Some(stage) = Stage::of(scene, self.mode)
        {
            return Box::new(Damper { stage, growth: self.growth });
        }
        Box::new(Joint::of(Pair::of(scene, self.mode), self.growth, scene.sample_time_s))
    }

    fn parameters(&self, _strengths: &[f64], scene: &MotionScene) -> Vec<Parameter> {
        let mut all =
            vec![MODE.at(self.mode as f64), GROWTH.at(self.growth), STAGE.at(f64::from(self.form == ModeForm::Stage))];
        if let Some(pair) = Pair::of(scene, self.mode) {
            all.push(MODE_HZ.at(pair.pole.norm() / std::f64::consts::TAU));
        }
        all
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(ModalDamping, Vec<f64>), PhysicsError> {
        let form = ModeForm::of(given.or(&STAGE)?);
        Ok((ModalDamping { mode: mode(given, scene)?, growth: given.need(&GROWTH)?, form }, vec![1.0]))
    }
}
