//! One spiral write: the document of `simulate`.

use super::{AnswerError, Named, Say, restored};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::feedback::{DescribedLoop, DescribedPlant, ModelLoop, confirmed_margins, linear_crossover_hz, margins};
use servotune::lti::{DiscretePlant, Plant};
use servotune::pes::{PesFigures, Profile, context, figures, simulate, simulate_physical};

/// A write and its figures.
#[derive(Clone, Debug, Serialize)]
pub struct Simulated {
    /// Whether the loop is stable; at the size of the move where there is physics.
    pub stable: bool,
    /// Whether the command reached the output limit.
    pub limited: bool,
    /// Unit of the PES.
    pub position_unit: String,
    /// Of the PES (Hz).
    pub sample_rate_hz: f64,
    /// PES at the servo clock; empty where it did not stay finite.
    pub pes: Vec<f64>,
    /// Effects beyond linear that were simulated; absent without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<&'static str>,
    /// Absent where the record runs away.
    #[serde(flatten)]
    pub figures: Option<PesFigures>,
    /// The record as it came, finite or not.
    #[serde(skip)]
    pub record: Vec<f64>,
}

/// Simulates the write of a profile.
pub fn simulated(
    plant: Named<'_, Plant>,
    controller: Named<'_, Controller>,
    profile: &Profile,
    say: Say<'_>,
) -> Result<Simulated, AnswerError> {
    let sections = controller.value.sections();
    let sections = sections.map_err(|source| AnswerError::Controller { file: controller.file.into(), source })?;
    let sampled = DiscretePlant::of(plant.value, controller.value.sample_time_s)
        .map_err(|source| AnswerError::Plant { file: plant.file.into(), source })?;
    let judged = confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?;
    let physics = restored(plant, &context(profile, controller.value), say)?;
    let (run, stable) = match &physics {
        None => (simulate(plant.value, controller.value, profile)?, judged.stable),
        Some(physics) => {
            // A small limit cycle is no unstable loop: the describing functions are asked at the size of the move.
            let described = DescribedPlant::new(physics, linear_crossover_hz(&judged, &sections))?;
            let at_move = described.at_amplitude(profile.spiral.distance);
            let at_move = margins(&DescribedLoop::new(at_move, &sections)?);
            (simulate_physical(physics, controller.value, profile)?, at_move.stable)
        }
    };
    // The figures of a record that runs away say nothing; without an output limit it does not even stay finite.
    let finite = run.pes.iter().all(|p| p.is_finite());
    Ok(Simulated {
        stable,
        limited: run.limited,
        position_unit: plant.value.position_unit.clone(),
        sample_rate_hz: profile.pes.sample_rate_hz,
        pes: if finite { run.pes.clone() } else { Vec::new() },
        physics: physics.as_ref().map(|p| p.names()).unwrap_or_default(),
        figures: (stable && finite).then(|| figures(&run.pes, profile)),
        record: run.pes,
    })
}
