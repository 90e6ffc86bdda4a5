//! Third floor of the diagnosis: motion, regressors, and models fitted by equation error and by output error.

mod cleared_motion;
pub(super) mod corrected_model;
pub(super) mod coupling;
pub(super) mod diagnosis_data;
mod differing_repeats;
pub(super) mod equation_error_fit;
pub(super) mod fit_inputs;
pub(super) mod fitted_model;
mod free_numbers;
mod lagged_regression;
pub(super) mod model;
pub(super) mod output_error_fit;
pub(super) mod output_error_problem;
pub(super) mod plain_fit;
pub(super) mod play_ground;
mod quantisation;
pub(super) mod regressors;
pub(super) mod repeats_around;
pub(super) mod selected_effect;
pub(super) mod shock;
pub(super) mod simulated_model;
pub(super) mod simulation;
mod slopes;
pub(super) mod trajectory;
