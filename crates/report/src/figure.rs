//! One description of a plot that a control engineer recognises; it knows data and meaning, not pixels.
//!
//! In: plain columns. Out: [`Figure`], which [`super::svg`] draws and the page makes interactive.
//! Convention: a NaN is a gap in a line; every axis names its unit. Spec: `specs/report.md`.

use super::error::{ReportError, same_length};

/// A captioned column of panels.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What is shown, in a few words.
    pub title: String,
    /// What the reader should see in it, in one or two sentences.
    pub caption: String,
    /// All panels have the same x axis: only the lowest one is labelled, and they zoom together.
    pub share_x: bool,
    /// The panels from top to bottom.
    pub panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// One unit is as long on both axes, as a Nyquist plot needs it.
    pub equal_aspect: bool,
    /// Height as a share of the normal height of a panel; 1.0 is normal.
    pub height: f64,
    /// What is drawn, in this order.
    pub marks: Vec<Mark>,
}

/// An axis with its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity, without its unit.
    pub label: String,
    /// The unit; empty for a ratio.
    pub unit: String,
    /// How values become lengths.
    pub scale: Scale,
    /// First and last value shown; from the data when `None`.
    pub range: Option<(f64, f64)>,
    /// Where the tick marks stand.
    pub ticks: Ticks,
    /// Names of the places 0, 1, ...; where there are any, they stand instead of numbers.
    pub names: Vec<String>,
}

/// How values become lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// In proportion to the logarithm; values of zero or less are gaps.
    Log10,
}

/// Which steps between tick marks are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ticks {
    /// 1, 2 or 5 times a power of ten.
    Decimal,
    /// 1, 2, 5, 10, 20, 40, 60, ... decibels.
    Decibels,
    /// 15, 30, 45, 90, 180, ... degrees.
    Degrees,
    /// Whole numbers: things that are counted.
    Whole,
}

/// One thing in a panel.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// Data.
    Series(Series),
    /// A line that data must not cross, or that marks a place.
    Line(RuleLine),
    /// A shaded stretch of one axis.
    Region(Region),
    /// A circle in the units of the axes.
    Circle(Circle),
    /// Words at a place.
    Note(Note),
    /// A shaded rectangle with words in its middle.
    Tile(Tile),
}

/// The meaning of a colour; `palette.rs` has the colours themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Data, told apart by number; there are six.
    Data(u8),
    /// Something to compare with, in grey.
    Muted,
    /// A limit or anything that must be avoided.
    Limit,
    /// A marker or a reference line, in the colour of text.
    Plain,
}

/// Data of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name for the legend and the readout; equal names in one figure are one legend entry.
    pub name: String,
    /// Colour.
    pub ink: Ink,
    /// How the data are drawn.
    pub kind: Kind,
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) along: Option<Along>,
}

/// How the data of a series are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A polygon through the points.
    Solid,
    /// A dashed polygon.
    Dashed,
    /// Dots.
    Points,
    /// A bar from zero to each value, from `x + from` to `x + to` in units of the x axis.
    Bars {
        /// Left edge relative to x.
        from: f64,
        /// Right edge relative to x.
        to: f64,
    },
    /// A short horizontal stroke at each value, from `x + from` to `x + to`: the limit of a bar.
    Caps {
        /// Left end relative to x.
        from: f64,
        /// Right end relative to x.
        to: f64,
    },
    /// Each value is held until the next x.
    Stairs,
    /// The area between `y` and this upper edge: a confidence band.
    Band {
        /// The upper edge, one value for each x.
        upper: Vec<f64>,
    },
}

/// A parameter that runs along a curve, such as the frequency along a Nyquist curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Along {
    /// The quantity.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// One value for each point.
    pub values: Vec<f64>,
}

/// A straight line across a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleLine {
    /// The axis on which the line stands at one value.
    pub on: Direction,
    /// That value.
    pub at: f64,
    /// Words beside the line; may be empty.
    pub label: String,
    /// Colour.
    pub ink: Ink,
}

/// A shaded stretch of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The axis that is divided.
    pub on: Direction,
    /// Where the shade begins; may be minus infinity.
    pub from: f64,
    /// Where it ends; may be infinity.
    pub to: f64,
    /// Words inside; may be empty.
    pub label: String,
    /// Colour.
    pub ink: Ink,
}

/// A shaded rectangle with words in its middle: a cell of a matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Left and right edge.
    pub x: (f64, f64),
    /// Lower and upper edge.
    pub y: (f64, f64),
    /// How strong the shade is, 0 to 1.
    pub shade: f64,
    /// Words in its middle; may be empty.
    pub text: String,
    /// Colour of the shade.
    pub ink: Ink,
}

/// One of the two axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The horizontal axis.
    X,
    /// The vertical axis.
    Y,
}

/// A circle in the units of the axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Circle {
    /// Centre (x, y).
    pub centre: (f64, f64),
    /// Radius; 0 is a dot.
    pub radius: f64,
    /// Shaded inside: a forbidden disc.
    pub filled: bool,
    /// Words for the legend; may be empty.
    pub label: String,
    /// Colour.
    pub ink: Ink,
}

/// Words at a place, with a dot at that place.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The place (x, y).
    pub at: (f64, f64),
    /// The words.
    pub text: String,
    /// Colour.
    pub ink: Ink,
}

impl Axis {
    /// A linear axis with decimal ticks and a range from the data.
    pub fn linear(label: &str, unit: &str) -> Self {
        Axis {
            label: label.to_owned(),
            unit: unit.to_owned(),
            scale: Scale::Linear,
            range: None,
            ticks: Ticks::Decimal,
            names: Vec::new(),
        }
    }

    /// A linear axis whose places 0, 1, ... have names.
    pub fn named<'a>(label: &str, names: impl IntoIterator<Item = &'a str>) -> Self {
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        let range = Some((-0.5, names.len().max(1) as f64 - 0.5));
        Axis { names, range, ..Axis::linear(label, "") }
    }

    /// A logarithmic frequency axis in Hz.
    pub fn frequency() -> Self {
        Axis { scale: Scale::Log10, ..Axis::linear("Frequency", "Hz") }
    }

    /// A linear axis in dB.
    pub fn decibels(label: &str) -> Self {
        Axis { ticks: Ticks::Decibels, ..Axis::linear(label, "dB") }
    }

    /// A linear axis in degrees.
    pub fn degrees(label: &str) -> Self {
        Axis { ticks: Ticks::Degrees, ..Axis::linear(label, "deg") }
    }

    /// A linear axis of things that are counted.
    pub fn counts(label: &str) -> Self {
        Axis { ticks: Ticks::Whole, ..Axis::linear(label, "") }
    }

    /// The label with its unit in brackets.
    pub fn text(&self) -> String {
        if self.unit.is_empty() { self.label.clone() } else { format!("{} ({})", self.label, self.unit) }
    }
}

impl Panel {
    /// An empty panel of normal height.
    pub fn new(x: Axis, y: Axis) -> Self {
        Panel { x, y, equal_aspect: false, height: 1.0, marks: Vec::new() }
    }

    /// The series among the marks.
    pub fn series(&self) -> impl Iterator<Item = &Series> {
        self.marks.iter().filter_map(|mark| match mark {
            Mark::Series(series) => Some(series),
            _ => None,
        })
    }
}

impl Series {
    /// A series from its columns; refuses columns of different length. NaN is a gap.
    pub fn new(name: &str, ink: Ink, kind: Kind, x: &[f64], y: &[f64]) -> Result<Self, ReportError> {
        same_length(name, "y", x.len(), y.len())?;
        if let Kind::Band { upper } = &kind {
            same_length(name, "the upper edge", x.len(), upper.len())?;
        }
        Ok(Series { name: name.to_owned(), ink, kind, x: x.to_vec(), y: y.to_vec(), along: None })
    }

    /// The same series with a parameter along it, shown by the readout.
    pub fn along(mut self, label: &str, unit: &str, values: &[f64]) -> Result<Self, ReportError> {
        same_length(&self.name, "the parameter", self.x.len(), values.len())?;
        self.along = Some(Along { label: label.to_owned(), unit: unit.to_owned(), values: values.to_vec() });
        Ok(self)
    }

    /// The number of points, gaps included.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }
}

impl From<Series> for Mark {
    fn from(series: Series) -> Self {
        Mark::Series(series)
    }
}

impl RuleLine {
    /// A vertical line with words at its top.
    pub fn vertical(at: f64, label: &str, ink: Ink) -> Mark {
        Mark::Line(RuleLine { on: Direction::X, at, label: label.to_owned(), ink })
    }

    /// A horizontal line with words at its right end.
    pub fn horizontal(at: f64, label: &str, ink: Ink) -> Mark {
        Mark::Line(RuleLine { on: Direction::Y, at, label: label.to_owned(), ink })
    }
}

impl Region {
    /// A shaded stretch of the x axis.
    pub fn of_x(from: f64, to: f64, label: &str, ink: Ink) -> Mark {
        Mark::Region(Region { on: Direction::X, from, to, label: label.to_owned(), ink })
    }

    /// A shaded stretch of the y axis.
    pub fn of_y(from: f64, to: f64, label: &str, ink: Ink) -> Mark {
        Mark::Region(Region { on: Direction::Y, from, to, label: label.to_owned(), ink })
    }
}
