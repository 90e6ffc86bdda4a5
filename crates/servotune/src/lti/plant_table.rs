//! The keys of `[plant]` in plant.toml, as they stand in the file; unknown ones are refused by the reader, with their line.

use super::{Mode, PhysicsEntry};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// A root in the file: a number, or real and imaginary part.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "a root: a number, or [real part, imaginary part]")]
pub(super) enum Root {
    Real(f64),
    Complex([f64; 2]),
}

impl From<&Complex<f64>> for Root {
    fn from(r: &Complex<f64>) -> Root {
        if r.im == 0.0 { Root::Real(r.re) } else { Root::Complex([r.re, r.im]) }
    }
}

/// Numbers, or one of them in brackets of its own in each row, as a column is often written.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "numbers, or a matrix of one row or column")]
pub(super) enum Vector {
    Flat(Vec<f64>),
    Nested(Vec<Vec<f64>>),
}

impl Vector {
    /// The numbers in their order.
    pub fn flat(&self) -> Vec<f64> {
        match self {
            Vector::Flat(all) => all.clone(),
            Vector::Nested(rows) => rows.iter().flatten().copied().collect(),
        }
    }
}

/// D: 0, plain or in brackets.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "0, or absent: a plant answers no command at once")]
pub(super) enum Through {
    Plain(f64),
    Brackets(Vector),
}

/// One `[[plant.residue]]`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResidueTable {
    pub gain: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_rad_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    #[serde(default)]
    pub damping_ratio: f64,
}

/// `[plant]`: one form of the rational part, and what multiplies it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlantTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dc_gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub natural_frequency_rad_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub viscous_rate_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zeros_rad_s: Option<Vec<Root>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zeros_hz: Option<Vec<Root>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poles_rad_s: Option<Vec<Root>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poles_hz: Option<Vec<Root>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub numerator: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub denominator: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a: Option<Vec<Vec<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub d: Option<Through>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_rad_s: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_hz: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lead_rad_s: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lead_hz: Option<Vec<f64>>,
    // Required: a dead time left out would be read as none, and the margins come out too good.
    pub delay_s: f64,
    #[serde(default = "one")]
    pub resonance_gain: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residue: Option<Vec<ResidueTable>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<Mode>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<PhysicsEntry>,
}

fn one() -> f64 {
    1.0
}
