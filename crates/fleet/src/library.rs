//! Tables known so far: candidates for sharing, and starts for a slot's own.
//!
//! In: what the pilots found. Out: [`Library`].

use super::look::{Level, nearest};
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::lti::{Plant, PlantFile};

/// Tables and plants of the pilots.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Library {
    /// Candidates: the fleet's own table, those that were grown to be shared, pilots' own; then the tables of groups, from `grouped` on.
    pub tables: Vec<Candidate>,
    /// Plants to start identification from.
    pub plants: Vec<PlantFile>,
    /// How many were grown; they follow the fleet's own.
    pub grown: usize,
    /// Index of the first table of a group. These are for comparison: each is looked at in the slots of its group only.
    pub grouped: usize,
    /// Index of the first table grown on the rest, after those of groups; 0 where there is none yet.
    #[serde(skip)]
    pub rest: usize,
    /// Groups of pilots that look alike, at several numbers of groups.
    pub levels: Vec<Level>,
}

/// A table that may be shared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The gains.
    pub gains: Controller,
    /// Where it came from: `today`, `grown 1`, `pilot T001/S03`, `group 2 of 4`.
    pub origin: String,
}

impl Library {
    /// Indices of the tables of groups.
    pub fn groups(&self) -> std::ops::Range<usize> {
        self.grouped..if self.rest > 0 { self.rest } else { self.tables.len() }
    }

    /// The candidates to be looked at in a slot that looks so: all that may be shared, and the table of its own group at each number of groups.
    pub fn looked_at(&self, look: &[f64]) -> Vec<usize> {
        let own = self.levels.iter().filter_map(|l| l.candidates[nearest(look, &l.centres)?]);
        (0..self.grouped).chain(own).collect()
    }

    /// The plants, those that are none left out.
    pub fn plants(&self) -> Vec<Plant> {
        self.plants.iter().filter_map(|p| Plant::try_from(p.clone()).ok()).collect()
    }
}
