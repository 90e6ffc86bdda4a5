//! Fifth floor of the diagnosis: which effects the model lacks.

mod backward_elimination;
mod bootstrap;
pub(super) mod bootstrap_chance;
pub(super) mod candidate;
pub(super) mod cleared_plant;
pub(super) mod clearing;
pub(super) mod curve_balance;
mod drift_test;
mod far_from_noise;
mod reading_lag;
pub(super) mod residual_effect;
mod residual_screen;
mod rival;
pub(super) mod rival_model;
mod scan;
pub(super) mod select;
pub(super) mod select_settings;
pub(super) mod selection;
pub(super) mod shortlist;
mod step_scan;
pub(super) mod torque_balance;
