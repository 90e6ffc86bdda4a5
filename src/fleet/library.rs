//! Tables known so far: candidates for sharing, and starts for a slot's own.
//!
//! In: what the pilots found. Out: [`Library`], scored on a slot without building anything for each candidate.

use super::Evidence;
use crate::controller::Controller;
use crate::lti::Plant;
use crate::lti::PlantFile;
use crate::tune::{Bench, Desk, Parameters, Spec, TuneError};
use serde::{Deserialize, Serialize};

/// Tables and plants of the pilots.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Library {
    /// Candidates, the fleet's own table first.
    pub tables: Vec<Candidate>,
    /// Plants to start identification from.
    pub plants: Vec<PlantFile>,
}

/// A table that may be shared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The gains.
    pub gains: Controller,
    /// Where it came from: `today`, `pilot T001/S03`, `cluster 2`.
    pub origin: String,
}

/// What one candidate scores in one slot, by the search's grid: the largest violation over all cases, and the objective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quick {
    pub violation: f64,
    pub objective: f64,
}

impl Library {
    /// The plants, those that are none left out.
    pub fn plants(&self) -> Vec<Plant> {
        self.plants.iter().filter_map(|p| Plant::try_from(p.clone()).ok()).collect()
    }
}

/// A slot's cases made ready for many tables of one shape.
pub(super) struct Scored {
    bench: Bench,
    desk: Desk,
}

impl Scored {
    pub fn new(evidence: &Evidence, spec: &Spec, base: &Controller) -> Result<Scored, TuneError> {
        // Bounds so wide that no table is moved by them.
        let mut open = spec.clone();
        let b = &mut open.search.bounds;
        let wide = |range: &mut [f64; 2]| *range = [range[0] * 1e-6, range[1] * 1e6];
        [&mut b.kp, &mut b.ki_per_s, &mut b.kd_s].into_iter().for_each(wide);
        (b.lowpass_hz, b.notch_hz) = ([1.0, 1e6], [1.0, 1e6]);
        let parameters = Parameters::of(&open, Some(base), base.sample_time_s);
        let bench = Bench::new(&evidence.machines(), spec, parameters)?;
        let desk = bench.desk();
        Ok(Scored { bench, desk })
    }

    /// The score of a table of the fleet's shape.
    pub fn quick(&mut self, gains: &Controller) -> Quick {
        let x = self.bench.parameters().vector(gains);
        let s = self.bench.score(&x, &mut self.desk);
        Quick { violation: s.violation, objective: s.objective }
    }
}
