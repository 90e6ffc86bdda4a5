//! A resonance of the plant moves with the position of the arm, or with the amplitude of its own swing.
//!
//! w_j(x) = w_j (1 + c (x - x0)), damping ratio and modal mass constant: q' = p (1 + d) q + r/(1 + d) i with d = c (x - x0); the
//! column is the mode's share of the position with the shift minus that without. To first order this is (x - x0) c times
//! the plant's derivative by ln w_j.
//!
//! By amplitude: d = c A^2, A = 2 |q|, the backbone of a spring that hardens (c above 0) or softens (below). Of a spring k q (1 + b q^2) it is
//! c = 3 b/8 (Duffing; Nayfeh, Mook 1979, section 2.3). The square, because every restoring force that is smooth and odd begins with it; joints that
//! slip lose damping with |A| first, which is `modal_damping`.
//!
//! Or, where the resonance is a stage of a chain, its pole and zero move together (`physics::stage`).

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, Prior, ScanEnd, Takes};
use super::pair::{Pair, Turn};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::stage::{Next, Stage};
use nalgebra::Complex;
use std::cell::Cell;

/// The mode that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeShift {
    /// Its number in `plant.modes`, counted from 0.
    pub mode: usize,
    /// What its frequency goes by.
    pub goes: ShiftGoes,
    /// How its part of the motion is formed.
    pub form: ModeForm,
}

/// What the frequency of a mode goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShiftGoes {
    /// The position of the arm.
    ByPosition {
        /// Share by which the frequency grows over the position (1/position_unit).
        shift_per_position: f64,
        /// Position at which it is the plant's (position_unit).
        centre: f64,
    },
    /// The amplitude of the mode's own swing.
    ByAmplitude {
        /// Share by which the frequency grows over the square of the amplitude (1/position_unit²).
        shift_per_amplitude_squared: f64,
    },
}

impl ShiftGoes {
    /// The frequency over the plant's, at a position and an amplitude (position_unit).
    fn factor(self, x: f64, amplitude: f64) -> f64 {
        let shift = match self {
            ShiftGoes::ByPosition { shift_per_position, centre } => shift_per_position * (x - centre),
            ShiftGoes::ByAmplitude { shift_per_amplitude_squared: c } => c * amplitude * amplitude,
        };
        1.0 + shift.clamp(-LARGEST, LARGEST)
    }

    /// The position that counts; one for all where none does.
    fn place(self, from: &Sample, to: &Sample) -> f64 {
        if self.by_amplitude() { 0.0 } else { 0.5 * (from.x + to.x) }
    }

    fn by_amplitude(self) -> bool {
        matches!(self, ShiftGoes::ByAmplitude { .. })
    }
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
    .unless(&["shift_per_amplitude_squared"])
    .scan(ScanEnd::At(1e-3, Measure::PerTravel), ScanEnd::At(0.1, Measure::PerTravel));
const CENTRE: Key = Key::new("centre", Unit::Position, "where it has the frequency of the plant, x0")
    .or_else("the middle of the stroke")
    .beside("shift_per_position")
    .prior(Prior::Words("the middle of the positions"));
const SHIFT_AT_TRAVEL: Key =
    Key::reported("shift_at_travel", Unit::Ratio, "relative shift at the travel").beside("shift_per_position");
const SHIFT_PER_AMPLITUDE_SQUARED: Key = Key::new(
    "shift_per_amplitude_squared",
    Unit::PerPositionSquared,
    "c of a shift with the amplitude A of the mode's own swing: c A^2; above 0 it hardens, below it softens",
)
.unless(&["shift_per_position"])
.prior(Prior::Words(
    "a shift of 0.01 to 30 at the amplitude that the largest command would reach as a tone at the mode",
));
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
    equation: "w_j(x) = w_j (1 + d), in the modal form q' = p (1 + d) q + r/(1 + d) i, d = c (x - x0), or c A^2 with A = 2 |q|; d within 0.5",
    keys: &[MODE, SHIFT_PER_POSITION, CENTRE, SHIFT_AT_TRAVEL, SHIFT_PER_AMPLITUDE_SQUARED, STAGE, MODE_HZ],
    source: "R. Tóth, Modeling and Identification of Linear Parameter-Varying Systems, 2010; by amplitude: A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979",
    says: "a vibration of the arm changes its frequency over the stroke or with its own size",
    confused_with: &["unmodelled_resonance", "modal_damping", "time_base_drift", "torque_factor_rolloff"],
    experiment: "the same multisine around the vibration in three or more zones of the stroke",
    band_hz: [200.0, 12000.0],
};

/// Largest share by which a frequency is let move.
const LARGEST: f64 = 0.5;

/// Place and current, and the coordinates that they lead to.
type Ahead = ([f64; 2], [Complex<f64>; 2]);

struct Shifted {
    pair: Option<Pair>,
    /// The step without the shift.
    plain: Option<Turn>,
    goes: ShiftGoes,
    step: f64,
    /// The modal coordinate with the shift and without.
    q: [Complex<f64>; 2],
    /// The next ones under a shift and a current: asked for by the column and by the step.
    ahead: Cell<Option<Ahead>>,
}

impl Shifted {
    fn of(pair: Option<Pair>, goes: ShiftGoes, step: f64) -> Shifted {
        let plain = pair.map(|p| Turn::of(p.pole, p.residue, step));
        Shifted { pair, plain, goes, step, q: [Complex::new(0.0, 0.0); 2], ahead: Cell::new(None) }
    }

    fn next(&self, from: &Sample, to: &Sample) -> [Complex<f64>; 2] {
        let (Some(pair), Some(plain)) = (self.pair, self.plain) else { return self.q };
        let x = self.goes.place(from, to);
        let under = [x, from.i];
        if let Some((_, next)) = self.ahead.get().filter(|(u, _)| *u == under) {
            return next;
        }
        let shifted = |amplitude: f64| {
            let by = self.goes.factor(x, amplitude);
            Turn::of(pair.pole * by, pair.residue / by, self.step).after(self.q[0], from.i)
        };
        let amplitude = 2.0 * self.q[0].norm();
        let mut next = [shifted(amplitude), plain.after(self.q[1], from.i)];
        if self.goes.by_amplitude() {
            // Amplitude at the start, then at the middle of both ends: second order in the step.
            next[0] = shifted(0.5 * (amplitude + 2.0 * next[0].norm()));
        }
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
    goes: ShiftGoes,
}

impl Sliding {
    fn next(&self, from: &Sample, to: &Sample) -> Next {
        let at = self.goes.place(from, to);
        self.stage.next(from.i, at, |s, x| {
            let shifted = |amplitude: f64| s.moved_by(s.w_rad_s * self.goes.factor(at, amplitude), s.damping, x);
            if !self.goes.by_amplitude() {
                return shifted(0.0);
            }
            let [amplitude, _] = s.amplitudes(s.moved, x);
            let [_, after] = s.amplitudes(shifted(amplitude), x);
            shifted(0.5 * (amplitude + after))
        })
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

    fn grid(scene: &MotionScene) -> Vec<ModeShift> {
        if scene.travel <= 0.0 {
            return Vec::new();
        }
        let each = |mode: usize, goes: ShiftGoes| {
            [ModeForm::Modal, ModeForm::Stage].map(move |form| ModeShift { mode, goes, form })
        };
        let mut all = Vec::new();
        for (j, pair) in Pair::all(scene) {
            for s in logarithmic(1e-3, 0.1, 6).into_iter().flat_map(|s| [s, -s]) {
                let goes = ShiftGoes::ByPosition { shift_per_position: s / scene.travel, centre: scene.centre };
                all.extend(each(j, goes));
            }
            // The amplitude that the largest command as a tone at the mode would reach; real excitation stays below it.
            let reach = scene.command * pair.residue.norm() / pair.pole.re.abs();
            if reach > 0.0 && reach.is_finite() {
                for s in logarithmic(0.01, 30.0, 5).into_iter().flat_map(|s| [s, -s]) {
                    all.extend(each(j, ShiftGoes::ByAmplitude { shift_per_amplitude_squared: s / (reach * reach) }));
                }
            }
        }
        all
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        match &mut self.goes {
            ShiftGoes::ByPosition { shift_per_position, centre } => vec![Some(shift_per_position), Some(centre)],
            ShiftGoes::ByAmplitude { shift_per_amplitude_squared } => vec![Some(shift_per_amplitude_squared), None],
        }
    }

    fn choices(&self) -> Vec<usize> {
        vec![self.mode, usize::from(self.form == ModeForm::Stage)]
    }

    fn class(&self) -> Vec<usize> {
        vec![self.member(), usize::from(self.form == ModeForm::Stage)]
    }

    /// The mode, and whether its own swing moves it.
    fn member(&self) -> usize {
        2 * self.mode + usize::from(self.goes.by_amplitude())
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        if self.form == ModeForm::Stage
            && let Some(stage) = Stage::of(scene, self.mode)
        {
            return Box::new(Sliding { stage, goes: self.goes });
        }
        Box::new(Shifted::of(Pair::of(scene, self.mode), self.goes, scene.sample_time_s))
    }

    fn parameters(&self, _strengths: &[f64], scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![MODE.at(self.mode as f64)];
        match self.goes {
            ShiftGoes::ByPosition { shift_per_position, centre } => all.extend([
                SHIFT_PER_POSITION.at(shift_per_position),
                CENTRE.at(centre),
                SHIFT_AT_TRAVEL.at(shift_per_position * scene.travel),
            ]),
            ShiftGoes::ByAmplitude { shift_per_amplitude_squared } => {
                all.push(SHIFT_PER_AMPLITUDE_SQUARED.at(shift_per_amplitude_squared))
            }
        }
        all.push(STAGE.at(f64::from(self.form == ModeForm::Stage)));
        if let Some(pair) = Pair::of(scene, self.mode) {
            all.push(MODE_HZ.at(pair.pole.norm() / std::f64::consts::TAU));
        }
        all
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(ModeShift, Vec<f64>), PhysicsError> {
        let mode = mode(given, scene)?;
        let form = ModeForm::of(given.or(&STAGE)?);
        // Beside a shift over the position one by amplitude is a key that has no meaning.
        let goes = match given.get(&SHIFT_PER_AMPLITUDE_SQUARED)? {
            Some(shift_per_amplitude_squared) if !given.has(&SHIFT_PER_POSITION) => {
                ShiftGoes::ByAmplitude { shift_per_amplitude_squared }
            }
            _ => ShiftGoes::ByPosition {
                shift_per_position: given.need(&SHIFT_PER_POSITION)?,
                centre: given.or_else(&CENTRE, scene.centre)?,
            },
        };
        Ok((ModeShift { mode, goes, form }, vec![1.0]))
    }
}

/// The number of a mode that the plant has, counted from 0 as in `plant.modes`.
pub(super) fn mode(given: &Given, scene: &MotionScene) -> Result<usize, PhysicsError> {
    let found = given.need(&MODE)?;
    if found.fract() == 0.0 && found >= 0.0 && Pair::of(scene, found as usize).is_some() {
        return Ok(found as usize);
    }
    Err(given.refused(&MODE, found))
}
