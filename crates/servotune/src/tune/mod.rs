//! Tuning: the smallest objective under margins, curves, limits on write and step, ranges and command effort.
//!
//! In: machines (models or measured responses), `spec.toml`, optionally the controller to start from. Out: an [`Outcome`]:
//! the tuned controller, or the limits in conflict and the smallest relaxation; a gain table that ties it to its inputs.
//! Convention: requirements are wanted ([`Requirement`]), then found ([`FoundFigures`]), then judged ([`Judged`]); spec: `specs/tuning.md`.

mod bounds;
mod confidence;
mod ending;
mod exact_loop;
mod feedback_tuning;
mod feedforward;
mod found;
mod from_table;
mod gain_table;
mod gain_table_keys;
mod judge;
mod limits;
mod linear;
mod loop_rows;
mod machine;
mod margin_rows;
mod neighbours;
mod objective;
mod outcome;
mod parameters;
mod pareto;
mod physical;
mod placement;
mod polish;
mod problem;
mod quadratic;
mod record_figures;
mod requirements;
mod row;
mod score;
mod search;
mod section_slope;
mod settings;
mod simplex;
mod spec;
mod spec_error;
mod spec_keys;
mod starts;
mod step_figures;
mod structure;
mod tune_error;
mod tuning;
mod watch;
mod write_figures;

pub use bounds::{Bounds, Ranges};
pub use confidence::margin_intervals;
pub use from_table::{polish_table, table_with_most_room};
pub use gain_table::{CrossingRow, GainTable, GainTableError, InputDigest, Provenance, Summary};
pub use gain_table_keys::GAIN_TABLE_KEYS;
pub use judge::{Judgement, judge};
pub use limits::{HarmonicLimit, Limits, MarginLimits, MoveLimits};
pub use linear::{CandidateSlopes, LimitSlope};
pub use machine::{Machine, Route};
pub use objective::{Disturbance, Minimise, Objective};
pub use outcome::{AtBound, Infeasible, Outcome, Reached, RelaxedLimit, SearchWork, Tuned};
pub use parameters::{DERIVATIVE_FILTER, Parameters, TunedNumber};
pub use pareto::{ParetoPoint, ParetoSettings, pareto};
pub use physical::{
    PhysicalJudgement, PhysicalTuning, TUNED_AMPLITUDES, equivalent_responses, judge_physical, tune_physical,
};
pub use problem::{TuningProblem, TuningWork, ranges};
pub use requirements::{CurveFound, FoundFigures, Judged, JudgedLimit, MET, Requirement, Side, What};
pub use score::Score;
pub use settings::TuneSettings;
pub use spec::{GUARD, Search, Spec};
pub use spec_error::SpecError;
pub use spec_keys::SPEC_KEYS;
pub use structure::{ControllerKind, FixedOrSearched, Structure};
pub use tune_error::TuneError;
pub use tuning::{sample_time_s, tune, tune_from, tune_jointly, tune_watched};
pub use watch::{SearchStep, SearchWatch, unwatched};
