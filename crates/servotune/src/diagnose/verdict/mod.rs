//! Sixth floor of the diagnosis: findings, judgement on hold-out records, and what is offered and recorded next.

mod clock;
pub(super) mod confirmation;
pub(super) mod decision;
pub(super) mod diagnosed;
pub(super) mod diagnosis_json;
pub(super) mod facts;
pub(super) mod finding;
pub(super) mod fit_report;
mod gain_modulation;
pub(super) mod held_out;
pub(super) mod judgement;
mod law_names;
mod line_finding;
mod linear_change;
mod localisation;
pub(super) mod log_checks;
mod log_finding;
pub(super) mod missing_curve;
pub(super) mod naming;
pub(super) mod next_experiment;
pub(super) mod noise_finding;
pub(super) mod observed_play;
pub(super) mod offered_models;
pub(super) mod outcome;
pub(super) mod run_out;
mod search_findings;
mod shock_finding;
