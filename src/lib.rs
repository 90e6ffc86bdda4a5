//! Servo identification, margins, PES simulation, gain tuning and mismatch diagnosis for spiral servo-track writers.
//!
//! What data does: recording and swept sine → response → plant model → loop → PES and margins → gains → table → report.
//! One direction, one room per step; the order of the modules below is the order in which to read them.

pub mod units;

pub mod document;
pub mod numeric;

pub mod frf;
pub mod lti;

pub mod controller;

pub mod feedback;

pub mod pes;

pub mod tune;
