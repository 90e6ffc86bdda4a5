//! Numerical methods without control meaning.
//!
//! In: plain slices. Out: plain numbers and small structs. Every method is deterministic.

pub mod golden;
pub mod least_squares;
pub mod levenberg;
pub mod peaks;
pub mod polynomial;
pub mod random;
