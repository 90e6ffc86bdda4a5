//! Tuning: the smallest DFT of the PES under margins, limits, bounds and command effort.
//!
//! In: machines (models or measured responses), `spec.toml`, optionally the controller to start from. Out: an [`Outcome`]:
//! the tuned controller, or the limits in conflict and the smallest relaxation; a gain table that ties it to its inputs.
//! Convention: requirements are wanted ([`Requirement`]), then found ([`Found`]), then judged ([`Judged`]); spec: `specs/tuning.md`.

mod bench;
mod confidence;
mod convex_concave;
mod from_table;
mod gain_table;
mod judge;
mod limit;
mod linear;
mod machine;
mod neighbours;
mod outcome;
mod parameters;
mod pareto;
mod physical;
mod polish;
mod quadratic;
mod requirements;
mod search;
mod spec;
mod starts;
mod tuning;

pub use bench::{Bench, Desk, Score};
pub use confidence::margin_intervals;
pub use from_table::{polish_table, roomiest_table};
pub use gain_table::{CrossingRow, GainTable, GainTableError, InputDigest, Provenance, Summary};
pub use judge::{Proof, judge};
pub use limit::{
    Bound, Figures, GainsBound, GainsSettings, Limit, LimitError, LimitPlant, LimitSettings, LimitWork, Standing,
    StructureBound, StructureSettings, Verdict, gains_bound, limit, standing, structure_bound,
};
pub use machine::{Hold, Machine, Route};
pub use outcome::{AtBound, Infeasible, Outcome, RelaxedLimit, Tuned, Work};
pub use parameters::{Parameter, Parameters};
pub use pareto::{ParetoPoint, ParetoSettings, pareto};
pub use physical::{
    PhysicalProof, PhysicalTuning, TUNED_AMPLITUDES, equivalent_responses, judge_physical, tune_physical,
};
pub use polish::PolishMethod;
pub use requirements::{Found, Judged, JudgedLimit, Requirement, Side, What};
pub use spec::{Bounds, HarmonicLimit, Limits, MarginLimits, Search, Spec, SpecError};
pub use tuning::{TuneError, TuneSettings, tune, tune_jointly};
