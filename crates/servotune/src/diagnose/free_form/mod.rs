//! Fourth floor of the diagnosis: a curve without a name, estimated beside the linear plant.

pub(super) mod curve;
pub(super) mod estimation;
pub(super) mod foretelling;
pub(super) mod gauge;
pub(super) mod left_out;
pub(super) mod likeness;
pub(super) mod shape;
pub(super) mod stretches;
pub(super) mod surface_likeness;
mod trial;
