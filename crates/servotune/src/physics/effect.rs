//! What every effect beyond the linear plant says of itself, and how it acts.
//!
//! An effect is a law with a few strengths (linear) and numbers of its own (a sliding length, a period, a limit; [`Parametric`]). In motion
//! the law gives columns; strengths times columns, summed, enter the loop at one place ([`Entry`]).

use super::key::Key;
use super::parameter::Parameter;
use super::sample::{MotionScene, Sample};
use super::share::Share;
use crate::document::Need;
use std::collections::BTreeMap;
use thiserror::Error;

/// The part of the machine that an effect belongs to, as the report names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Port {
    /// Between controller and coil current.
    Amplifier,
    /// Torque on the arm.
    Torque,
    /// Arm, coil, base: between torque and head.
    Structure,
    /// Encoder and its electronics.
    Sensor,
    /// Disk and spindle.
    Disk,
    /// Clocks and logs.
    Time,
    /// The control law as it runs.
    Controller,
}

/// Where an effect's columns enter the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Added to the command before the plant's delay (command_unit), a value per sample.
    Command,
    /// Added to the command that acts on the body, after the delay (command_unit), the mean over a sample interval.
    Torque,
    /// Added to the position as recorded (position_unit), a value per sample.
    Position,
}

/// What is known of an effect before any record is seen.
#[derive(Debug)]
pub struct Facts {
    /// Name from the contract's list.
    pub name: &'static str,
    /// The part of the machine.
    pub port: Port,
    /// Where the columns enter.
    pub entry: Entry,
    /// Number of columns, each with one strength; at most [`COLUMNS`].
    pub columns: usize,
    /// Whether the strengths are 1 by definition (a saturation is there or not; its limit is a number of its law).
    pub fixed: bool,
    /// Whether the strengths differ from record to record (a mains line starts at another phase each time).
    pub per_record: bool,
    /// The law, written out.
    pub equation: &'static str,
    /// Keys of its entry in a plant file, all of them, in the order of the catalogue; none where it has no law.
    pub keys: &'static [Key],
    /// Where the law is from: authors, title, year.
    pub source: &'static str,
    /// One plain sentence for the factory floor.
    pub says: &'static str,
    /// Effects that the same records may not tell from this one.
    pub confused_with: &'static [&'static str],
    /// The experiment that tells them apart.
    pub experiment: &'static str,
    /// The frequencies where it mostly acts (Hz), as a start for the report's `where`.
    pub band_hz: [f64; 2],
}

/// Most columns of one effect.
pub const COLUMNS: usize = 6;

/// Why a physics entry of a plant file cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum PhysicsError {
    /// The library has no such effect.
    #[error("effect `{effect}`: not in the library; known: {known}")]
    Unknown { effect: String, known: String },
    /// A parameter is missing.
    #[error("effect `{effect}`: parameter `{parameter}` is missing")]
    Missing { effect: &'static str, parameter: &'static str },
    /// A parameter has no meaning here.
    #[error("effect `{effect}`: parameter `{parameter}` is unknown; expected {expected}")]
    Parameter { effect: String, parameter: String, expected: String },
    /// A parameter is no number.
    #[error("effect `{effect}`: {parameter} = {found}; expected a finite number")]
    Finite { effect: &'static str, parameter: String, found: f64 },
    /// A parameter is out of its range.
    #[error("effect `{effect}`: {parameter} = {found}; expected {expected}")]
    Range { effect: &'static str, parameter: &'static str, found: f64, expected: &'static str },
    /// The plant is no second-order body or free inertia with resonance pairs.
    #[error(
        "effect `{effect}`: acts on a second-order body or a free inertia; the plant has {poles} poles beside its resonance pairs"
    )]
    Body { effect: String, poles: usize },
    /// A curve's keys make none.
    #[error("effect `{effect}`: {what}")]
    Curve { effect: String, what: String },
    /// No loop can be closed on what the sensor reads.
    #[error(
        "effect `{effect}`: the reading turns round and does not tell where the arm is; margins and tuning need one that does"
    )]
    Blind { effect: &'static str },
    /// The effect is one of data or statistics and cannot be simulated.
    #[error(
        "effect `{effect}`: found in records, but not one that a simulation can carry; take its entry out of the plant file"
    )]
    NotSimulated { effect: &'static str },
}

/// Named parameters of one physics entry, taken out one by one.
pub struct Given<'a> {
    effect: &'static str,
    parameters: &'a BTreeMap<String, f64>,
}

impl<'a> Given<'a> {
    /// The parameters of `effect`.
    pub fn new(effect: &'static str, parameters: &'a BTreeMap<String, f64>) -> Given<'a> {
        Given { effect, parameters }
    }

    /// A parameter that must be there.
    pub fn need(&self, key: &Key) -> Result<f64, PhysicsError> {
        self.get(key)?.ok_or(PhysicsError::Missing { effect: self.effect, parameter: key.name })
    }

    /// A parameter that may be there.
    pub fn get(&self, key: &Key) -> Result<Option<f64>, PhysicsError> {
        match self.parameters.get(key.name) {
            Some(found) if !key.takes.takes(*found) => Err(self.refused(key, *found)),
            found => Ok(found.copied()),
        }
    }

    /// A parameter with the default of its key; one that must be there where that is no number.
    pub fn or(&self, key: &Key) -> Result<f64, PhysicsError> {
        if let Need::Or(number) = key.need { self.or_else(key, number) } else { self.need(key) }
    }

    /// A parameter with a default that depends on the machine.
    pub fn or_else(&self, key: &Key, default: f64) -> Result<f64, PhysicsError> {
        Ok(self.get(key)?.unwrap_or(default))
    }

    /// The refusal of what a parameter was found to be.
    pub fn refused(&self, key: &Key, found: f64) -> PhysicsError {
        PhysicsError::Range { effect: self.effect, parameter: key.name, found, expected: key.takes.text() }
    }

    /// Whether a parameter was given.
    pub fn has(&self, key: &Key) -> bool {
        self.parameters.contains_key(key.name)
    }
}

/// Share of a number that its law is taken to hold to, where the effect does not say.
const FORM: f64 = 0.002;

/// What an effect is drawn over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownOver {
    /// Time.
    Time,
    /// Position, a function of it.
    Position,
    /// Position, a loop: it remembers where the motion turned round.
    Loop,
    /// Velocity.
    Velocity,
    /// Output over input of the amplifier.
    Input,
    /// Torque per command over position.
    FactorOverPosition,
    /// Torque per command over time.
    FactorOverTime,
    /// Angle of the spindle.
    Spindle,
}

/// A law with numbers of its own: what its file gives. `library` makes one type of all of them.
pub trait Parametric: Clone + PartialEq + std::fmt::Debug + Sized {
    /// What is known beforehand.
    fn known() -> &'static Facts;

    /// The same of this one, where it differs from one to the other: a curve at one port.
    fn facts(&self) -> &'static Facts {
        Self::known()
    }

    /// Points of the search; one where there is nothing to search, none where these records leave the law without meaning (no spindle, for
    /// instance).
    fn grid(scene: &MotionScene) -> Vec<Self>;

    /// Its numbers that are measures (lengths, times, frequencies), in an order of its own; none at the place of one that this form of the law
    /// has not. A law has as many places in every form.
    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        Vec::new()
    }

    /// What is chosen and not measured: a form, a mode, a harmonic; 0 for the plainest.
    fn choices(&self) -> Vec<usize> {
        Vec::new()
    }

    /// What two laws must share for the search to go from one to the other by their numbers.
    fn class(&self) -> Vec<usize> {
        self.choices()
    }

    /// Which of several things of one kind it is, that may stand in the place of another: a mode of several, a shape of a field.
    fn member(&self) -> usize {
        0
    }

    /// Numbers and choices that this form is told by.
    fn told(&self) -> usize {
        let numbers = self.clone().numbers_mut().into_iter().flatten().filter(|n| **n != 0.0).count();
        numbers + self.choices().iter().filter(|c| **c != 0).count()
    }

    /// The law at rest.
    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law>;

    /// The parameters as reports name them.
    fn parameters(&self, strengths: &[f64], scene: &MotionScene) -> Vec<Parameter>;

    /// The law and its strengths from named parameters; the inverse of [`Parametric::parameters`].
    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(Self, Vec<f64>), PhysicsError>;

    /// Whether a machine can be so: a drag takes energy, it gives none. `errors` are the standard errors of the strengths, empty
    /// where they are not known yet.
    fn is_possible(&self, _strengths: &[f64], _errors: &[f64]) -> bool {
        true
    }

    /// Whether it is a drag. Any two of them are ends of one law, told apart by a length alone.
    fn is_drag() -> bool {
        false
    }

    /// Whether it goes by a clock of its own, so that records which were not fitted may find it elsewhere.
    fn has_own_clock() -> bool {
        false
    }

    /// What it is drawn over.
    fn shown_over() -> ShownOver {
        ShownOver::Time
    }

    /// Share of the least value of number `place` on the grid down to which a simulation still tells it, where it tells more than the
    /// recorded motion does: noise of the sensor hides how dry a drag is, and a simulation has none.
    fn finer_simulated(_place: usize) -> Option<f64> {
        None
    }

    /// Whether it falls into a single record at a time of its own: a push.
    fn is_single_event() -> bool {
        false
    }

    /// Whether it is a wave over the position, with a period of its own that no other law's form has.
    fn is_wave_over_position() -> bool {
        false
    }

    /// Whether it is a tone of one frequency, which a narrow band of noise looks like.
    fn is_tone() -> bool {
        false
    }

    /// Whether strengths of each record's own must not follow the motion: what comes anew with every repeat of one move is made by the move.
    fn independent_of_motion() -> bool {
        false
    }

    /// Whether every machine of this kind has it to some degree: a coil in a magnet gap, an arm on a bearing.
    fn is_on_every_machine() -> bool {
        false
    }

    /// Whether a machine may have several that differ in their first number: lines, modes, pushes.
    fn may_occur_several_times() -> bool {
        false
    }

    /// Whether it answers small differences of a command or a motion out of proportion, by a limit or a turn: repeats then differ by more than
    /// the linear answer to their commands, and their mean is not what it does to their mean.
    fn is_hard_nonlinearity() -> bool {
        false
    }

    /// Whether stiffness or damping of the body change with the amplitude of the motion under it, or stand beside what does so: friction, springs.
    fn acts_on_body() -> bool {
        false
    }

    /// Whether what it adds to stiffness or damping is another at another amplitude; false of a plain spring.
    fn changes_with_amplitude() -> bool {
        Self::acts_on_body()
    }

    /// Length over which a drag turns round (position_unit), where it is a spring before it slides.
    fn presliding_length(&self) -> Option<f64> {
        None
    }

    /// Steepest torque over position of a law that the motion meets (command_unit per position_unit); 0 where it is no stiffer than a machine.
    /// It decides how finely a simulation steps.
    fn stiffness(&self, _strengths: &[f64]) -> f64 {
        0.0
    }

    /// Share by which a number may be off because no machine follows a law to the letter; long records make intervals narrower than that.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        FORM
    }

    /// Numbers that the search takes in steps and the last fit as measures: place and range. They are above 0.
    fn measured_in_last_fit(&self) -> Vec<(usize, [f64; 2])> {
        Vec::new()
    }

    /// Fuller forms of it to be tried once it stands as it is: with what a plain form leaves out, each with the least and the greatest of
    /// every number between which a fit moves it.
    fn fuller(&self, _scene: &MotionScene) -> Vec<(Self, Vec<[f64; 2]>)> {
        Vec::new()
    }

    /// The law that does the same thing and is possible, where this one is not: a wave of twice its period carried by its second harmonic.
    fn equivalent(&self) -> Option<Self> {
        None
    }

    /// Motions of its own over `n` samples that a record may begin in, in the recorded position: what still rings from the move before.
    fn free_motions(&self, _scene: &MotionScene, _n: usize) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// Time constant (s) of what a command before the record has left in it, where that is no motion of the body.
    fn memory_time_s(&self) -> Option<f64> {
        None
    }

    /// Its part in the loop's response at `w_rad_s`, sampled as the law samples it.
    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Cycle
    }
}

/// A law in motion. Columns are per unit of strength.
pub trait Law: Send {
    /// The columns from one sample to the next, without a change of state: the mean over the interval for
    /// [`Entry::Torque`], the value at `to` for the others.
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]);

    /// Takes the step for good.
    fn commit(&mut self, _from: &Sample, _to: &Sample) {}

    /// Goes a way without a turn, before the record begins (position_unit): for what remembers ways and not time.
    fn went(&mut self, _way: f64) {}

    /// Goes along all turns before a record to where it begins, scaled from the recorded position to the arm's.
    fn led(&mut self, turned: &[f64], begins: f64, scale: f64) {
        let next = turned.iter().skip(1).chain([&begins]);
        turned.iter().zip(next).for_each(|(from, to)| self.went(scale * (to - from)));
    }
}
