//! The gate: which machines are worth tuning.
pub mod features;
