//! What a refit works on.

use super::selected_effect::SelectedEffect;
use super::trajectory::Trajectory;
use crate::diagnose::data::linear_form::LinearForm;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::StackedRecords;
use crate::diagnose::noise::lines::Line;
use crate::diagnose::noise::whitening::Whitener;
use crate::physics::MotionScene;

/// What a refit works on.
pub struct Fit<'a> {
    /// The form of the linear plant.
    pub form: &'a LinearForm,
    /// The mean run of every segment of the stack.
    pub means: &'a [Run],
    /// The motion behind each.
    pub trajectories: &'a [Trajectory],
    /// The filter.
    pub whitener: &'a Whitener,
    /// How they are stacked.
    pub stack: &'a StackedRecords,
    /// Lines of a phase of their own in every record.
    pub lines: &'a [Line],
    /// Machine and size of its motion.
    pub scene: &'a MotionScene,
    /// Effects in the model.
    pub chosen: Vec<SelectedEffect>,
}
