//! Why a case cannot be diagnosed.

use crate::controller::ControllerError;
use crate::lti::LtiError;
use thiserror::Error;

/// Why a case cannot be diagnosed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum DiagnoseError {
    #[error(transparent)]
    Plant(#[from] LtiError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// Controller and records run at different rates.
    #[error(
        "sample time {controller_s} s in the controller, {records_s} s in the records: expected the same within 0.1 %"
    )]
    SampleTime { controller_s: f64, records_s: f64 },
    /// The plant holds physics already.
    #[error(
        "the plant holds [[plant.physics]] effect \"{effect}\": a diagnosis starts from a linear plant; remove the table, and the effect is found again if it is there"
    )]
    Physics { effect: String },
    /// The plant is no second-order body or free inertia with resonance pairs.
    #[error(
        "the plant has {poles} poles beside its resonance pairs, real or unstable ones among them: a diagnosis starts from a second-order body or a free inertia; give the machine's own body, and a lag as [[plant.physics]] is found again if it is there"
    )]
    Body { poles: usize },
    /// The plant's simulation has nothing to do with the record.
    #[error(
        "record `{record}`: the plant as given simulates an error of {ratio:.1e} times the recorded motion; expected a model of this machine: check the units, the gains, the sample rate and the modes of the plant, or fit it anew (`servotune response`, `servotune identify`)"
    )]
    Unlike { record: String, ratio: f64 },
    /// Nothing can be computed of these records under this plant.
    #[error(
        "{what} comes out as {found}: these records cannot be diagnosed under this plant; check the sample rate, the units, and the modes of the plant against half the sample rate"
    )]
    NotFinite { what: &'static str, found: f64 },
    /// Further inputs are not those that the case names.
    #[error(
        "record `{record}`: {found} further inputs of finite numbers as long as the position; expected {expected}, one for each name in `further_inputs`"
    )]
    Further { record: String, found: usize, expected: usize },
    /// Nothing moves.
    #[error("record `{record}`: the command never changes; expected a record in which the machine is driven")]
    Still { record: String },
}
