//! Numerical tools without any control meaning.

pub mod spectrum;
pub mod unwrap;
