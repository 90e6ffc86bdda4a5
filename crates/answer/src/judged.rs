//! The margins of a plant model, with its physics where it has any.

use super::{AnswerError, Named, Say, for_a_loop, outside};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::feedback::{
    Amplitudes, DescribedMargins, DescribedPlant, Margins, ModelLoop, confirmed_margins, described_margins,
    linear_crossover_hz,
};
use servotune::lti::{DiscretePlant, Plant};
use servotune::physics::Context;

/// Margins of a plant with physics; the flattened ones are the worst over the amplitudes.
#[derive(Serialize)]
pub struct Described {
    /// At every amplitude.
    #[serde(flatten)]
    pub margins: DescribedMargins,
    /// Names of the effects.
    pub physics: Vec<&'static str>,
    /// Disturbances: not in the margins.
    pub outside: Vec<&'static str>,
    /// Margins of the linear plant alone.
    pub linear: Margins,
}

/// The document of `margins --plant`.
#[derive(Serialize)]
#[serde(untagged)]
pub enum ModelMargins {
    /// Of a linear plant.
    Linear(Box<Margins>),
    /// Of one with physics.
    Described(Box<Described>),
}

impl ModelMargins {
    /// Whether the loop is stable, at every amplitude where there are several.
    pub fn stable(&self) -> bool {
        match self {
            ModelMargins::Linear(m) => m.stable,
            ModelMargins::Described(d) => d.margins.worst.stable,
        }
    }
}

/// At what sizes of motion and command the physics is described.
pub fn model_context(controller: &Controller, amplitudes: &Amplitudes) -> Context {
    let usual = Context::default();
    Context {
        sample_time_s: controller.sample_time_s,
        travel: usual.travel.max(amplitudes.high),
        command: controller.output_limit.unwrap_or(usual.command),
        ..usual
    }
}

/// Margins of the loop of a plant and a controller.
pub fn model_margins(
    plant: Named<'_, Plant>,
    controller: Named<'_, Controller>,
    amplitudes: &Amplitudes,
    say: Say<'_>,
) -> Result<ModelMargins, AnswerError> {
    let sections = controller.value.sections();
    let sections = sections.map_err(|source| AnswerError::Controller { file: controller.file.into(), source })?;
    let of_plant = |source| AnswerError::Plant { file: plant.file.into(), source };
    let physics = for_a_loop(plant, &model_context(controller.value, amplitudes), say)?;
    let sampled = DiscretePlant::of(plant.value, sections.sample_time_s).map_err(of_plant)?;
    let linear = confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?;
    let Some(physics) = physics else { return Ok(ModelMargins::Linear(Box::new(linear))) };
    let outside = outside(&physics);
    for name in &outside {
        say(&format!(
            "note: {}: effect \"{name}\" acts on the loop from outside: the margins are without it",
            plant.file.display()
        ));
    }
    let described = DescribedPlant::new(&physics, linear_crossover_hz(&linear, &sections)).map_err(of_plant)?;
    let margins = described_margins(&described, &sections, amplitudes)?;
    Ok(ModelMargins::Described(Box::new(Described { margins, physics: physics.names(), outside, linear })))
}
