//! A curve without a name, as `diagnosis.json` carries it.

use super::likeness::Likeness;
use crate::lti::CurveKnot;
use serde::Serialize;
use std::collections::BTreeMap;

/// The curve as diagnosis.json carries it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FreeFormFound {
    /// The part of the machine.
    pub port: &'static str,
    /// What it goes over.
    pub argument: &'static str,
    /// Unit of the argument.
    pub argument_unit: String,
    /// Unit of the values.
    pub unit: String,
    /// The curve with its band at 95 %.
    pub knots: Vec<CurveKnot>,
    /// Share of what the better linear model leaves beyond the noise that the curve explains, on the records that were not used, or on
    /// the fitted ones where there are no others.
    pub explained_share: f64,
    /// One plain sentence.
    pub says: String,
    /// The named law that it is most like.
    pub like: Likeness,
    /// Error of the parts of the fitted records that were left out in turn (rms): best linear plant, with the curve.
    pub left_out: [f64; 2],
    /// The same for the best curve of every port that was tried.
    pub ports: BTreeMap<String, f64>,
}
