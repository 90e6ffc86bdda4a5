//! The limit of performance: how low the DFT of the PES can go under any linear controller.
//!
//! In: a plant, a spec, the feed-forward that stays. Out: a lower bound that no loop of a stated class can beat, and how far given
//! gains are from it. Method: on the finite write only the first taps of the Youla parameter count, and every demand kept is convex in them;
//! the solver's multipliers prove the bound. Spec: `specs/performance_limit.md`.

mod admitted;
mod basis;
mod branch;
pub(super) mod cone;
mod cuts;
mod enclosure;
mod energy;
mod factor;
mod floor;
mod form;
mod gains;
mod horizon;
mod logs;
mod programme;
mod span;
mod structure;
mod taps;
mod tie;
mod whole;

pub use gains::{GainsBound, GainsSettings, gains_bound};
pub use horizon::LimitPlant;
pub use programme::{Bound, Figures, Limit, LimitSettings, LimitWork, Standing, Verdict, limit, standing};
pub use whole::{StructureBound, StructureSettings, structure_bound};

use crate::lti::LtiError;
use crate::pes::PesError;
use thiserror::Error;

/// Why no limit can be computed.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum LimitError {
    /// The write is none.
    #[error(transparent)]
    Write(#[from] PesError),
    /// The plant is none.
    #[error("plant: {0}")]
    Plant(#[from] LtiError),
    /// The write is too long.
    #[error(
        "{taps} controller samples from the start of the move to the end of pes.window: expected at most {limit}; let the window end earlier or start the move later"
    )]
    Horizon { taps: usize, limit: usize },
    /// A pulse response ends before the write does.
    #[error("the pulse response has {found} samples: expected at least {expected}, the end of the window")]
    PulseLength { found: usize, expected: usize },
    /// A pulse response says nothing between the controller's samples.
    #[error(
        "a servo sample lies {offset_s} s after a controller sample: a pulse response needs pes.sample_rate_hz on the controller's samples; give a plant model"
    )]
    ServoClock { offset_s: f64 },
    /// Nothing is to be made small.
    #[error("no bin of the window lies in 600 to 3000 Hz: nothing is to be made small; lengthen pes.window")]
    NoBins,
    /// A limit of performance speaks of linear plants.
    #[error(
        "the plant has the effect \"{effect}\": a limit of performance speaks of linear plants; remove [[plant.physics]]"
    )]
    Physics { effect: String },
    /// The solver gave up in the first round.
    #[error(
        "the convex programme of {taps} taps (controller samples of the write) was not solved; expected a sample time far below the write's duration, and a plant's gain and noise within some orders of its size; look at sample_time_s, and at the units of plant and profile"
    )]
    NotSolved { taps: usize },
}
