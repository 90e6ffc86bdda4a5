//! How the search chooses.

use crate::diagnose::rules::{EXPLAINS, FALSE_ALARM};

/// How the search decides.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectSettings {
    /// Most effects at once.
    pub most: usize,
    /// Candidates that are refitted in full after each scan.
    pub refits: usize,
    /// Chance of a false name over the whole search.
    pub false_alarm: f64,
    /// Share of the error in excess of noise that each further effect must explain.
    pub share: f64,
    /// Iterations of each refit.
    pub iterations: usize,
    /// Draws of the parametric bootstrap; 0 for none.
    pub bootstrap: usize,
    /// Whether laws are fitted by simulation before one is taken, where none comes near the noise.
    pub by_simulation: bool,
}

impl Default for SelectSettings {
    fn default() -> SelectSettings {
        SelectSettings {
            most: 4,
            refits: 5,
            false_alarm: FALSE_ALARM,
            share: EXPLAINS,
            iterations: 8,
            bootstrap: 0,
            by_simulation: true,
        }
    }
}
