//! The physics of a plant file, made ready for a command: refusals with the file's name, what is left out said.

use super::{Failure, Screen};
use servotune::lti::Plant;
use servotune::physics::{Context, Restored, Share};
use std::path::Path;

/// The physics of a plant, and its linear part. None where no entry acts.
pub(super) fn restored(
    file: &Path,
    plant: &Plant,
    context: &Context,
    screen: &mut Screen,
) -> Result<Option<Restored>, Failure> {
    let physics = Restored::of(plant, context).map_err(|source| Failure::Physics { file: file.into(), source })?;
    for name in &physics.left_out {
        screen.say(&format!(
            "note: {}: [[plant.physics]] effect \"{name}\" belongs to the records, not to the machine: left out",
            file.display()
        ));
    }
    Ok((!physics.parts.is_empty()).then_some(physics))
}

/// Effects without a part in the loop's response: disturbances.
pub(super) fn outside(physics: &Restored) -> Vec<&'static str> {
    let acts_from_outside = |(e, s): &&(&'static dyn servotune::physics::Effect, servotune::physics::Setting)| {
        e.share(s, &physics.scene, 1.0) == Share::Outside
    };
    physics.parts.iter().filter(acts_from_outside).map(|(e, _)| e.facts().name).collect()
}

/// Says which effects margins cannot see.
pub(super) fn say_outside(file: &Path, physics: &Restored, screen: &mut Screen) {
    for name in outside(physics) {
        screen.say(&format!(
            "note: {}: effect \"{name}\" acts on the loop from outside: the margins are without it",
            file.display()
        ));
    }
}
