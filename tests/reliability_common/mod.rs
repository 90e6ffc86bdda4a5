//! The healthy machine and its sweeps, which the tests of what a hostile trial found spoil.
#![allow(dead_code, clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::frf::{FrfError, ReadSettings, Sweep, read_bytes};
use servotune::lti::Plant;
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, paper_machine};
use std::f64::consts::TAU;

pub const HEALTHY: &str = include_str!("../../specs/machines/healthy.toml");
pub const NOMINAL: &str = include_str!("../../specs/controllers/nominal.toml");
pub const PAPER: &str = include_str!("../../specs/limits/paper.toml");
pub const SPIRAL: &str = include_str!("../../specs/profiles/spiral.toml");

pub fn healthy() -> Plant {
    paper_machine(MachineClass::Healthy).unwrap()
}

/// Rows (Hz, dB, deg) of the healthy machine.
pub fn rows(points: usize, noise: f64) -> Vec<[f64; 3]> {
    let frf = measure(&healthy(), &log_grid(40.0, 5000.0, points), noise, &mut Random::new(3)).unwrap();
    let one = |(w, v): (&f64, &Complex<f64>)| [w / TAU, 20.0 * v.norm().log10(), v.arg().to_degrees()];
    frf.w_rad_s().iter().zip(frf.value()).map(one).collect()
}

pub fn bod(rows: &[[f64; 3]]) -> String {
    let head = "Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n".to_owned();
    rows.iter().fold(head, |t, [f, m, p]| t + &format!("{f}\t{m}\t{p}\n"))
}

pub fn read(text: &str, settings: &ReadSettings) -> Result<Sweep, FrfError> {
    read_bytes("sweep", text.as_bytes(), settings)
}
