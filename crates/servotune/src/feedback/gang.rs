//! The gang of four: every way a signal goes round the loop.

use nalgebra::Complex;

/// Responses of the closed loop at one frequency (Åström & Murray, Feedback Systems, ch. 12).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GangOfFour {
    /// S = 1/(1 + PC): from reference to error, from disturbance at the output to the output.
    pub sensitivity: Complex<f64>,
    /// T = PC/(1 + PC): from reference to position.
    pub complementary: Complex<f64>,
    /// PS: from a disturbance at the plant input to the position (position_unit per command_unit).
    pub load: Complex<f64>,
    /// CS: from sensor noise to the command (command_unit per position_unit), sign left out.
    pub noise: Complex<f64>,
}

/// The four from the plant's and the controller's response at one frequency.
///
/// ```
/// use nalgebra::Complex;
/// let one = Complex::new(1.0, 0.0);
/// let four = servotune::feedback::gang_of_four(one, one);
/// assert_eq!(four.sensitivity + four.complementary, one);
/// ```
pub fn gang_of_four(plant: Complex<f64>, controller: Complex<f64>) -> GangOfFour {
    let l = plant * controller;
    let s = 1.0 / (1.0 + l);
    GangOfFour { sensitivity: s, complementary: l * s, load: plant * s, noise: controller * s }
}
