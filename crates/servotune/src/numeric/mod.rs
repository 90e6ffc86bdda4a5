//! Numerics without control meaning: roots, minima, least squares, splines, spectra, random numbers.
//!
//! In: plain slices. Out: plain numbers and small structs. Every method is deterministic.

pub mod brent;
pub mod dense;
pub mod digits;
pub mod golden;
pub mod interval;
pub mod least_squares;
pub mod levenberg;
pub mod peaks;
pub mod polynomial;
pub mod powers;
pub mod random;
pub mod root;
pub mod simplex;
pub mod spectrum;
pub mod spline;
pub mod statistics;
pub mod twofold;
pub mod unwrap;
pub mod wide;
