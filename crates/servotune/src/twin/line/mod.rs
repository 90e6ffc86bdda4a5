//! A production line: drives of the four classes, and machines of kinds that no class knows, each measured as the factory does.
//!
//! In: a seed and counts. Out: [`LineMachine`]s with what the factory sees ([`crate::gate::features::RawMachine`]) and the truth behind it ([`Truth`]).
//! Physics makes every number: a plant with its fault, a spiral write under the one controller, a swept sine with noise, a log.
//! Why the faults are as large as they are: `specs/gate_twin.md`. Bytes equal for any number of threads.

mod files;
mod line_machine;
mod log;
mod measure;
mod truth;
mod unknown;
mod unknown_kind;

pub use files::{MachineFiles, machine_files};
pub use line_machine::LineMachine;
pub use truth::Truth;
pub use unknown_kind::UnknownKind;

pub(super) use measure::measured;

use super::{MachineClass, TwinError};
use crate::numeric::random::Random;
use rayon::prelude::*;

/// How many drives of which class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineSettings {
    /// Fixes every draw.
    pub seed: u64,
    /// Drives of each class, in the paper's order.
    pub counts: [usize; 4],
}

impl Default for LineSettings {
    /// The paper's 486 drives, section 2.9.
    fn default() -> Self {
        LineSettings { seed: 1, counts: [198, 106, 78, 104] }
    }
}

impl LineSettings {
    /// `total` drives in the paper's proportions, every class at least once where there are four or more.
    pub fn of_total(seed: u64, total: usize) -> LineSettings {
        let paper = LineSettings::default().counts;
        let all: usize = paper.iter().sum();
        let mut counts = paper.map(|c| (c * total / all).max(usize::from(total >= 4)));
        // What rounding leaves over is healthy, as most machines are.
        let given: usize = counts.iter().sum();
        counts[0] = (counts[0] + total).saturating_sub(given);
        LineSettings { seed, counts }
    }
}

/// Stream of the order of the machines; the machines' own streams count from 0.
const ORDER: u64 = u64::MAX - 1;
/// Streams of one unknown kind.
const KIND_STREAMS: u64 = 1_000_000;

/// The line, its classes in random order so that an id tells nothing.
pub fn line(settings: &LineSettings) -> Result<Vec<LineMachine>, TwinError> {
    let mut classes: Vec<MachineClass> = Vec::new();
    for (class, count) in MachineClass::ALL.into_iter().zip(settings.counts) {
        classes.extend(std::iter::repeat_n(class, count));
    }
    let mut order = Random::stream(settings.seed, ORDER);
    for i in (1..classes.len()).rev() {
        classes.swap(i, (order.uniform() * (i + 1) as f64) as usize);
    }
    classes
        .par_iter()
        .enumerate()
        .map(|(i, class)| {
            let mut random = Random::stream(settings.seed, i as u64);
            let truth = Truth::of_class(*class, &mut random)?;
            measure::measured(format!("L{:04}", i + 1), truth, &mut random)
        })
        .collect()
}

/// `count` machines of a kind that no class knows.
pub fn unknown_line(kind: UnknownKind, seed: u64, count: usize) -> Result<Vec<LineMachine>, TwinError> {
    (0..count as u64)
        .into_par_iter()
        .map(|i| {
            let mut random = Random::stream(seed, (kind as u64 + 1) * KIND_STREAMS + i);
            let truth = Truth::unknown(kind, &mut random)?;
            measure::measured(format!("U_{}_{:04}", kind.name(), i + 1), truth, &mut random)
        })
        .collect()
}
