//! Diagnose: where simulation and recordings differ, what physics was left out, and whether the model now fits.
pub mod bench;
pub mod columns;
pub mod linear;
pub mod refit;
pub mod run;
pub mod scan;
pub mod select;
pub mod stack;
pub mod trajectory;
pub mod whiten;
