//! Numerics without control meaning: roots, minima, least squares, spectra, random numbers.

pub mod random;
pub mod root;
