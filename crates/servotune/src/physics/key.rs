//! A key of a law: its name in plant files and reports, its unit, what the reader takes, and where the search begins.
//!
//! The one place of each: readers take ranges and defaults from here, the catalogue (`specs/effects.md`) is printed from here. A test holds the
//! ranges of the search against the grids.

use super::parameter::{Parameter, Unit};
use super::sample::MotionScene;
use crate::document::Need;

/// One key of a law.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name in plant files and reports.
    pub name: &'static str,
    /// Unit.
    pub unit: Unit,
    /// What it is.
    pub means: &'static str,
    /// Whether a plant file gives it.
    pub need: Need,
    /// The key in whose company alone it has a meaning.
    pub beside: Option<&'static str>,
    /// Values that a plant file may give.
    pub takes: Takes,
    /// What the search takes it from.
    pub prior: Prior,
}

/// Values that a plant file may give; all are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Takes {
    /// Any.
    Any,
    /// Above 0.
    Positive,
    /// Strictly between two numbers; the words say so.
    Between(f64, f64, &'static str),
    /// What the words say; it depends on the machine or on another key, and the law's own reader sees to it.
    Law(&'static str),
}

/// What the search takes a number from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// Nothing: a strength, estimated freely.
    Free,
    /// A scan of its size from one to the other; 0 stands for what this form lacks.
    Scan(ScanEnd, ScanEnd),
    /// These numbers, one by one.
    Points(&'static [f64]),
    /// What the words say.
    Words(&'static str),
}

/// An end of a scan, in measures of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScanEnd {
    /// So many of one.
    At(f64, Measure),
    /// The greatest of several.
    Greatest(&'static [(f64, Measure)]),
    /// The least of several.
    Least(&'static [(f64, Measure)]),
}

/// A measure of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The plain number, in the unit of the key.
    One,
    /// White noise of the sensor, rms.
    Noise,
    /// Largest distance from the middle of the positions.
    Travel,
    /// Its inverse.
    PerTravel,
    /// Largest speed.
    Speed,
    /// Largest command.
    Command,
    /// Largest change of the command from sample to sample, over the sample time.
    SteepestCommand,
    /// A sample time.
    Sample,
    /// The sample rate.
    SampleRate,
    /// Length of the longest record.
    Record,
    /// Its inverse, the width of a line.
    Line,
    /// Frequency of the spindle.
    Spindle,
}

impl Measure {
    /// Its size in a scene; 0 without a spindle.
    pub fn of(self, scene: &MotionScene) -> f64 {
        match self {
            Measure::One => 1.0,
            Measure::Noise => scene.noise,
            Measure::Travel => scene.travel,
            Measure::PerTravel => scene.travel.recip(),
            Measure::Speed => scene.speed,
            Measure::Command => scene.command,
            Measure::SteepestCommand => scene.command_step / scene.sample_time_s,
            Measure::Sample => scene.sample_time_s,
            Measure::SampleRate => scene.sample_time_s.recip(),
            Measure::Record => scene.duration_s,
            Measure::Line => scene.duration_s.recip(),
            Measure::Spindle => scene.spindle_hz.unwrap_or(0.0),
        }
    }

    fn times(self, by: f64) -> String {
        match self {
            Measure::One => format!("{by}"),
            Measure::Noise => format!("{by} noise"),
            Measure::Travel => format!("{by} travel"),
            Measure::PerTravel => format!("{by} / travel"),
            Measure::Speed => format!("{by} of the largest speed"),
            Measure::Command => format!("{by} of the largest command"),
            Measure::SteepestCommand => format!("{by} of the steepest command"),
            Measure::Sample => format!("{by} samples"),
            Measure::SampleRate => format!("{by} of the sample rate"),
            Measure::Record => format!("{by} records"),
            Measure::Line => format!("{by} / record"),
            Measure::Spindle => format!("{by} of the spindle"),
        }
    }
}

impl ScanEnd {
    /// Its size in a scene.
    pub fn of(self, scene: &MotionScene) -> f64 {
        let size = |(by, measure): &(f64, Measure)| by * measure.of(scene);
        match self {
            ScanEnd::At(by, measure) => by * measure.of(scene),
            ScanEnd::Greatest(all) => all.iter().map(size).fold(f64::NEG_INFINITY, f64::max),
            ScanEnd::Least(all) => all.iter().map(size).fold(f64::INFINITY, f64::min),
        }
    }

    /// In words.
    pub fn text(self) -> String {
        let list =
            |all: &[(f64, Measure)]| all.iter().map(|(by, measure)| measure.times(*by)).collect::<Vec<_>>().join(", ");
        match self {
            ScanEnd::At(by, measure) => measure.times(by),
            ScanEnd::Greatest(all) => format!("max({})", list(all)),
            ScanEnd::Least(all) => format!("min({})", list(all)),
        }
    }
}

impl Takes {
    /// What is expected, in words.
    pub fn text(self) -> &'static str {
        match self {
            Takes::Any => "a finite number",
            Takes::Positive => "a finite number above 0",
            Takes::Between(_, _, words) | Takes::Law(words) => words,
        }
    }

    /// Whether a number is taken, as far as that does not depend on the machine.
    pub fn takes(self, number: f64) -> bool {
        match self {
            Takes::Any | Takes::Law(_) => true,
            Takes::Positive => number.is_finite() && number > 0.0,
            Takes::Between(low, high, _) => number > low && number < high,
        }
    }
}

impl Prior {
    /// In words.
    pub fn text(self) -> String {
        match self {
            Prior::Free => "free".into(),
            Prior::Scan(from, to) => format!("{} to {}", from.text(), to.text()),
            Prior::Points(all) => all.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
            Prior::Words(words) => words.into(),
        }
    }
}

impl Key {
    /// A key that a file must give, any finite number, a free strength.
    pub const fn new(name: &'static str, unit: Unit, means: &'static str) -> Key {
        Key { name, unit, means, need: Need::Always, beside: None, takes: Takes::Any, prior: Prior::Free }
    }

    /// A key that reports make from the others.
    pub const fn reported(name: &'static str, unit: Unit, means: &'static str) -> Key {
        Key { need: Need::Reported, prior: Prior::Words(""), ..Key::new(name, unit, means) }
    }

    /// The same, not needed beside one of these.
    pub const fn unless(self, others: &'static [&'static str]) -> Key {
        Key { need: Need::Unless(others), ..self }
    }

    /// The same with a default.
    pub const fn or(self, default: f64) -> Key {
        Key { need: Need::Or(default), ..self }
    }

    /// The same with a default in words.
    pub const fn or_else(self, default: &'static str) -> Key {
        Key { need: Need::OrElse(default), ..self }
    }

    /// The same, without meaning but in the company of another.
    pub const fn beside(self, other: &'static str) -> Key {
        Key { beside: Some(other), ..self }
    }

    /// The same, above 0.
    pub const fn positive(self) -> Key {
        self.takes(Takes::Positive)
    }

    /// The same with values that it takes.
    pub const fn takes(self, takes: Takes) -> Key {
        Key { takes, ..self }
    }

    /// The same, scanned.
    pub const fn scan(self, from: ScanEnd, to: ScanEnd) -> Key {
        self.prior(Prior::Scan(from, to))
    }

    /// The same, tried at these numbers.
    pub const fn points(self, all: &'static [f64]) -> Key {
        self.prior(Prior::Points(all))
    }

    /// The same with what the search takes it from.
    pub const fn prior(self, prior: Prior) -> Key {
        Key { prior, ..self }
    }

    /// The parameter of this name.
    pub fn at(&self, value: f64) -> Parameter {
        Parameter::new(self.name, value, self.unit)
    }
}
