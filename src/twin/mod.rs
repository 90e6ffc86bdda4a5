//! Made-up machines with a known truth, for the demo, tests and benches.
//!
//! In: a seed. Out: plants, measured responses, studies that compare estimates with the truth.

pub mod plants;
pub mod study_identify;
