//! A resonance of the plant moves with the position of the arm.
//!
//! w_j(x) = w_j (1 + c (x - x0)), damping ratio and modal mass constant: q' = p (1 + d) q + r/(1 + d) i with d = c (x - x0); the
//! column is the mode's share of the position with the shift minus that without. To first order this is (x - x0) c times
//! the plant's derivative by ln w_j.
//!
//! Or, where the resonance is a stage of a chain, its pole and zero move together (`physics::stage`).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Bound, Key, Measure, Prior, Takes};
use super::pair::{Pair, Turn};
use super::parameter::{Parameter, Unit};
use super::sample::{Sample, Scene, logarithmic};
use super::stage::{Next, Stage};
use nalgebra::Complex;
use std::cell::Cell;

/// The mode that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeShift {
    /// Its number in `plant.modes`, counted from 0.
    pub mode: usize,
    /// Share by which its frequency grows over the position (1/position_unit).
    pub shift_per_position: f64,
    /// Position at which it has the plant's frequency (position_unit).
    pub centre: f64,
    /// How its part of the motion is formed.
    pub form: ModeForm,
}

/// How a mode's part of the motion is formed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeForm {
    /// A term of the modal form: the sum of modes.
    Modal,
    /// A stage of a chain: the product of stages.
    Stage,
}

impl ModeForm {
    /// The form that files name by this number: 0 is modal.
    pub(super) fn of(stage: f64) -> ModeForm {
        if stage == 0.0 { ModeForm::Modal } else { ModeForm::Stage }
    }
}

pub(super) const MODE: Key = Key::new("mode", Unit::Ratio, "its number in `plant.modes`, from 0")
    .takes(Takes::Law("the number of one of plant.modes, counted from 0, with a damping ratio below 1"))
    .prior(Prior::Words("every mode of the plant that rings"));
const SHIFT_PER_POSITION: Key = Key::new("shift_per_position", Unit::PerPosition, "c, of either sign")
    .scan(Bound::At(1e-3, Measure::PerTravel), Bound::At(0.1, Measure::PerTravel));
const CENTRE: Key = Key::new("centre", Unit::Position, "where it has the frequency of the plant, x0")
    .or_else("the middle of the stroke")
    .prior(Prior::Words("the middle of the positions"));
const SHIFT_AT_TRAVEL: Key = Key::reported("shift_at_travel", Unit::Ratio, "relative shift at the travel");
pub(super) const STAGE: Key =
    Key::new("stage", Unit::Ratio, "0: a term of the modal form; else a stage of a chain").or(0.0).points(&[0.0, 1.0]);
pub(super) const MODE_HZ: Key = Key::reported("mode_hz", Unit::Hertz, "frequency of the mode");

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "mode_shift",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 1,
    fixed: true,
    per_record: false,
    equation: "w_j(x) = w_j (1 + c (x - x0)), in the modal form q' = p (1 + d) q + r/(1 + d) i, d = c (x - x0)",
    keys: &[MODE, SHIFT_PER_POSITION, CENTRE, SHIFT_AT_TRAVEL, STAGE, MODE_HZ],
    source: "R. Tóth, Modeling and Identification of Linear Parameter-Varying Systems, 2010",
    says: "a vibration of the arm changes its frequency over the stroke",
    confused_with: &["unmodelled_resonance", "modal_damping", "time_base_drift", "torque_factor_rolloff"],
    experiment: "the same multisine around the vibration in three or more zones of the stroke",
    band_hz: [200.0, 12000.0],
};

/// Largest share by which a frequency is let move.
const LARGEST: f64 = 0.5;

/// Shift and current, and the coordinates that they lead to.
type Ahead = ([f64; 2], [Complex<f64>; 2]);

struct Shifted {
    pair: Option<Pair>,
    /// The step without the shift.
    plain: Option<Turn>,
    slope: f64,
    centre: f64,
    step: f64,
    /// The modal coordinate with the shift and without.
    q: [Complex<f64>; 2],
    /// The next ones under a shift and a current: asked for by the column and by the step.
    ahead: Cell<Option<Ahead>>,
}

impl Shifted {
    fn of(pair: Option<Pair>, slope: f64, centre: f64, step: f64) -> Shifted {
        let plain = pair.map(|p| Turn::of(p.pole, p.residue, step));
        Shifted { pair, plain, slope, centre, step, q: [Complex::new(0.0, 0.0); 2], ahead: Cell::new(None) }
    }

    fn next(&self, from: &Sample, to: &Sample) -> [Complex<f64>; 2] {
        let (Some(pair), Some(plain)) = (self.pair, self.plain) else { return self.q };
        let by = 1.0 + (self.slope * (0.5 * (from.x + to.x) - self.centre)).clamp(-LARGEST, LARGEST);
        let under = [by, from.i];
        if let Some((_, next)) = self.ahead.get().filter(|(u, _)| *u == under) {
            return next;
        }
        let shifted = Turn::of(pair.pole * by, pair.residue / by, self.step);
        let next = [shifted.after(self.q[0], from.i), plain.after(self.q[1], from.i)];
        self.ahead.set(Some((under, next)));
        next
    }
}

impl Law for Shifted {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let q = self.next(from, to);
        out[0] = 2.0 * (q[0].re - q[1].re);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.q = self.next(from, to);
        self.ahead.set(None);
    }
}

/// One stage of a chain that moves.
struct Sliding {
    stage: Stage,
    slope: f64,
    centre: f64,
}

impl Sliding {
    fn next(&self, from: &Sample, to: &Sample) -> Next {
        let by = 1.0 + (self.slope * (0.5 * (from.x + to.x) - self.centre)).clamp(-LARGEST, LARGEST);
        self.stage.next(from.i, by, |s, x| s.moved_by(s.w_rad_s * by, s.damping, x))
    }
}

impl Law for Sliding {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.stage.change(&self.next(from, to));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        let next = self.next(from, to);
        self.stage.take(from.i, next);
    }
}

impl Parametric for ModeShift {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &Scene) -> Vec<ModeShift> {
        if scene.travel <= 0.0 {
            return Vec::new();
        }
        let shifts = logarithmic(1e-3, 0.1, 6);
        let both = |s: f64| [ModeForm::Modal, ModeForm::Stage].into_iter().flat_map(move |f| [(s, f), (-s, f)]);
        let each = |mode: usize| {
            let all = shifts.iter().flat_map(move |&s| both(s));
            let centre = scene.centre;
            all.map(move |(s, form)| ModeShift { mode, shift_per_position: s / scene.travel, centre, form })
        };
        Pair::all(scene).into_iter().flat_map(|(j, _)| each(j)).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.shift_per_position), Some(&mut self.centre)]
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.mode, usize::from(self.form == ModeForm::Stage)]
    }

    fn member(&self) -> usize {
        self.mode
    }

    fn in_motion(&self, scene: &Scene) -> Box<dyn Law> {
        let (slope, centre) = (self.shift_per_position, self.centre);
        if self.form == ModeForm::Stage
            && let Some(stage) = Stage::of(scene, self.mode)
        {
            return Box::new(Sliding { stage, slope, centre });
        }
        Box::new(Shifted::of(Pair::of(scene, self.mode), slope, centre, scene.sample_time_s))
    }

    fn parameters(&self, _strengths: &[f64], scene: &Scene) -> Vec<Parameter> {
        let mut all = vec![
            MODE.at(self.mode as f64),
            SHIFT_PER_POSITION.at(self.shift_per_position),
            CENTRE.at(self.centre),
            SHIFT_AT_TRAVEL.at(self.shift_per_position * scene.travel),
            STAGE.at(f64::from(self.form == ModeForm::Stage)),
        ];
        if let Some(pair) = Pair::of(scene, self.mode) {
            all.push(MODE_HZ.at(pair.pole.norm() / std::f64::consts::TAU));
        }
        all
    }

    fn setting_of(given: &Given, scene: &Scene) -> Result<(ModeShift, Vec<f64>), PhysicsError> {
        let mode = mode(given, scene)?;
        let form = ModeForm::of(given.or(&STAGE)?);
        let (shift_per_position, centre) = (given.need(&SHIFT_PER_POSITION)?, given.or_else(&CENTRE, scene.centre)?);
        Ok((ModeShift { mode, shift_per_position, centre, form }, vec![1.0]))
    }
}

/// The number of a mode that the plant has, counted from 0 as in `plant.modes`.
pub(super) fn mode(given: &Given, scene: &Scene) -> Result<usize, PhysicsError> {
    let found = given.need(&MODE)?;
    if found.fract() == 0.0 && found >= 0.0 && Pair::of(scene, found as usize).is_some() {
        return Ok(found as usize);
    }
    Err(given.refused(&MODE, found))
}
