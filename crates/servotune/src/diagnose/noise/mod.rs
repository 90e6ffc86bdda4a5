//! Second floor of the diagnosis: what noise does by itself, its spectrum, its lines and the chances that it gives.

pub(super) mod chance;
pub(super) mod lines;
pub(super) mod repeats;
pub(super) mod torque_noise;
pub(super) mod whitening;
