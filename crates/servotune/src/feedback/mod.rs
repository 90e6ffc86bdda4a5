//! The loop: one open loop, cut at the plant input, and everything judged from it.
//!
//! In: a sampled plant (or a measured response) and the firmware's sections. Out: crossings, margins, Nyquist count, poles,
//! the gang of four. Convention: L = P C, negative feedback, S = 1/(1 + L), T = L/(1 + L); spec: `specs/margins.md`.
//!
//! ```text
//!        r ──►(+)── e ──► C(z) ──►(+)── u ──► P(z) ──┬──► y
//!              ▲ -                  ▲ d              │
//!              └────────────────────┴── (loop is cut at u) ◄──┘
//! ```

mod amplitudes;
mod bandwidth;
mod crossing;
mod cubic;
mod curve;
mod curve_limit;
mod described;
mod events;
mod gang;
mod grid;
mod judge;
mod loop_power;
mod margins;
mod measured;
mod model_grid;
mod nyquist;
mod open_loop;
mod piece;
mod poles;
mod refine;
mod sampled;
mod section_gradients;
mod sweep_plan;
mod trace;

pub use crate::numeric::interval::Interval;
pub use amplitudes::{AmplitudeRow, Amplitudes, DescribedMargins, LimitCycle, described_margins, linear_crossover_hz};
pub use bandwidth::{BANDWIDTH_LEVEL, closed_loop_bandwidth};
pub use crossing::Crossing;
pub use curve::{ResponseCurve, hold};
pub use curve_limit::{CurveLimit, CurveSide, Excess, Magnitude};
pub use described::{Described, DescribedLoop, DescribedPlant};
pub use events::{Event, GRAZE, Graze, QuickMargins};
pub use gang::{GangOfFour, gang_of_four};
pub use grid::frequency_grid;
pub use loop_power::{LoopPower, PowerWork, quadrature};
pub use margins::{Margins, margins};
pub use measured::{LoopVerdict, MarginIntervals, MeasuredLoop, MeasuredMargins, measured_margins};
pub use nyquist::{NyquistCount, nyquist_count};
pub use open_loop::{FeedbackError, ModelLoop, OpenLoop, angle_from_rest};
pub use poles::{closed_loop_poles, confirmed_margins};
pub use sampled::{LoopOnGrid, SampledPlant};
pub use section_gradients::SectionGradients;
pub use sweep_plan::{PlanSettings, SweepPlan, Tone, sweep_plan};
pub use trace::Trace;
