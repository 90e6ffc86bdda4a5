//! First floor of the diagnosis: records made ready, the given plant's linear form, and what the logs show before any model is fitted.

pub(super) mod checks;
pub(super) mod excerpt;
pub(super) mod lap;
pub(super) mod linear_form;
pub(super) mod log_filter;
pub(super) mod plant_check;
pub(super) mod reading_fold;
pub(super) mod reading_limits;
pub(super) mod repeat_difference;
pub(super) mod run;
pub(super) mod slip;
pub(super) mod stacked_records;
pub(super) mod thinned;
pub(super) mod time_shift;
pub(super) mod turning_points;
pub(super) mod wrapped;
