//! The physics of a plant, made ready: refusals with the plant's name, what is left out said.

use super::{AnswerError, Named, Say};
use servotune::lti::Plant;
use servotune::physics::{Context, LawSetting, Restored, Share};

/// The physics of a plant, and its linear part. None where no entry acts.
pub fn restored(plant: Named<'_, Plant>, context: &Context, say: Say<'_>) -> Result<Option<Restored>, AnswerError> {
    let file = plant.file;
    let physics =
        Restored::of(plant.value, context).map_err(|source| AnswerError::Physics { file: file.into(), source })?;
    for name in &physics.left_out {
        say(&format!(
            "note: {}: [[plant.physics]] effect \"{name}\" belongs to the records, not to the machine: left out",
            file.display()
        ));
    }
    Ok((!physics.parts.is_empty()).then_some(physics))
}

/// The same for margins and tuning, which close a loop on what the sensor reads: refused where that does not tell where the arm is.
pub fn for_a_loop(plant: Named<'_, Plant>, context: &Context, say: Say<'_>) -> Result<Option<Restored>, AnswerError> {
    let physics = restored(plant, context, say)?;
    if let Some(physics) = &physics {
        physics.seen().map_err(|source| AnswerError::Physics { file: plant.file.into(), source })?;
    }
    Ok(physics)
}

/// Effects without a part in the loop's response: disturbances.
pub fn outside(physics: &Restored) -> Vec<&'static str> {
    let acts_from_outside = |s: &&LawSetting| s.response_share(&physics.scene, 1.0) == Share::Outside;
    physics.parts.iter().filter(acts_from_outside).map(|s| s.facts().name).collect()
}
