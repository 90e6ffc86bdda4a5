//! What a plant looks like to a loop, and which of several looks is nearest.
//!
//! In: plants. Out: ln |P| and phase over the compared frequencies. Spec: `specs/fleet.md`.

use serde::{Deserialize, Serialize};
use servotune::lti::{FrequencyResponse, Plant};
use servotune::numeric::unwrap::unwrap;
use std::f64::consts::TAU;

/// Frequencies at which plants are compared (Hz): the decade around the crossover, and on to the modes that limit it.
pub(super) const COMPARED_HZ: [f64; 2] = [150.0, 3000.0];

pub(super) const COMPARED: usize = 24;

/// One number of groups.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Centre of each group in [`looks`].
    pub centres: Vec<Vec<f64>>,
    /// Candidate of each group in the library; none where nothing was found for it.
    pub candidates: Vec<Option<usize>>,
}

/// What a plant looks like to a loop: ln |P| and phase (rad) over the compared frequencies.
pub fn looks(plant: &Plant) -> Vec<f64> {
    let step = (COMPARED_HZ[1] / COMPARED_HZ[0]).powf(1.0 / (COMPARED - 1) as f64);
    let value: Vec<_> = (0..COMPARED).map(|i| plant.at(TAU * COMPARED_HZ[0] * step.powi(i as i32))).collect();
    let phase = unwrap(&value.iter().map(|v| v.arg()).collect::<Vec<f64>>());
    value.iter().zip(phase).flat_map(|(v, phase)| [v.norm().ln(), phase]).collect()
}

pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// The centre nearest to a look; of equals the first.
pub fn nearest(look: &[f64], centres: &[Vec<f64>]) -> Option<usize> {
    (0..centres.len())
        .min_by(|&a, &b| distance(look, &centres[a]).total_cmp(&distance(look, &centres[b])).then(a.cmp(&b)))
}
