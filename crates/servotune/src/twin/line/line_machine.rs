//! A machine of the line: what the factory sees of it, and what it is.

use super::Truth;
use crate::gate::features::RawMachine;

/// One machine of the line.
#[derive(Clone, Debug, PartialEq)]
pub struct LineMachine {
    /// What the factory has of it. Machines of an unknown kind have no label.
    pub record: RawMachine,
    /// Words in its log; they are no features.
    pub words: Vec<(String, String)>,
    /// What it is.
    pub truth: Truth,
}
