//! A curve as it stands in a physics entry of the plant file: knots with the ends of their intervals.

use serde::{Deserialize, Serialize};

/// One point of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurveKnot {
    /// The argument; over position and velocity the position.
    pub at: f64,
    /// The velocity (position_unit/s) of a curve over both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<f64>,
    /// The value there.
    pub value: f64,
    /// Lower end of the value's interval, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

/// A curve; what port and argument mean belongs to the physics room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurveEntry {
    /// The part of the machine that it describes.
    pub port: String,
    /// What it goes over.
    pub argument: String,
    /// Unit of its values.
    pub unit: String,
    /// Its points, the argument ascending; over two arguments the position outermost.
    pub knots: Vec<CurveKnot>,
}
