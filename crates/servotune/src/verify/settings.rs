//! How tight a proof is to be, and how much work it may take.

/// Settings of a proof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifySettings {
    /// Relative width of Ms, disk and delay margin.
    pub relative: f64,
    /// Width of angles (rad).
    pub angle_rad: f64,
    /// Width of ln|L| at a phase crossing.
    pub ln_size: f64,
    /// Cells looked at before the proof is given up.
    pub cells: usize,
}

impl Default for VerifySettings {
    /// Ms to 1e-4, phase to 0.003 deg, gain to 5e-4 dB.
    fn default() -> Self {
        VerifySettings { relative: 1e-4, angle_rad: 5e-5, ln_size: 5e-5, cells: 400_000 }
    }
}
