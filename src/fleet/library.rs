//! Tables known so far: candidates for sharing, and starts for a slot's own.
//!
//! In: what the pilots found. Out: [`Library`].

use super::cluster::Level;
use crate::controller::Controller;
use crate::lti::{Plant, PlantFile};
use serde::{Deserialize, Serialize};

/// Tables and plants of the pilots.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Library {
    /// Candidates, the fleet's own table first.
    pub tables: Vec<Candidate>,
    /// Plants to start identification from.
    pub plants: Vec<PlantFile>,
    /// Groups of pilots that look alike, at several numbers of groups.
    pub levels: Vec<Level>,
}

/// A table that may be shared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The gains.
    pub gains: Controller,
    /// Where it came from: `today`, `pilot T001/S03`, `cluster 2`.
    pub origin: String,
}

impl Library {
    /// The plants, those that are none left out.
    pub fn plants(&self) -> Vec<Plant> {
        self.plants.iter().filter_map(|p| Plant::try_from(p.clone()).ok()).collect()
    }
}
