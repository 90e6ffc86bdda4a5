//! How an effect takes part in the loop's frequency response: not at all, linearly, or by its describing function.

use crate::lti::ModalTerm;
use nalgebra::Complex;

/// The part of an effect in the response from command to recorded position.
#[derive(Clone, Debug, PartialEq)]
pub enum Share {
    /// Its law runs over a cycle of this amplitude: the describing function.
    Cycle,
    /// Linear: the recorded position gains these terms of the delayed command (position_unit/s per command_unit).
    Terms(Vec<ModalTerm>),
    /// Linear: the recorded position is late by this (s).
    Delay(f64),
    /// Linear: added to its own input (command, acting command or position), as a share of it at this frequency.
    Ratio(Complex<f64>),
    /// A disturbance, or a swing whose mean is 0: it acts on the loop from outside.
    Outside,
    /// A reading that does not tell where the arm is: no loop is closed on it.
    Blind,
}
