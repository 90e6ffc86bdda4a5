//! Measured frequency responses: what a sweep says, before any model.
//!
//! In: sweep files. Out: [`Frf`], the response on its own ascending grid.
//! Convention: `specs/conventions.md`; files: `specs/frf.md`.

mod response;

pub use response::{Frf, FrfShapeError};
