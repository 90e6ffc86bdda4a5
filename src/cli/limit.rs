//! `servotune limit`: the lowest DFT that any linear controller could reach, and the gap of given gains.

use super::limit_arguments::LimitArguments;
use super::{Ending, Failure, Screen, load};
use crate::controller::Controller;
use crate::document::{FileSet, check_target, write_text};
use crate::lti::Plant;
use crate::report::limit::{limit_sentences, limit_table};
use crate::tune::{
    GainsBound, GainsSettings, Limit, LimitError, LimitPlant, LimitSettings, Machine, Spec, Standing, StructureBound,
    StructureSettings, TuneError, TuneSettings, Verdict, gains_bound, limit, standing, structure_bound, tune,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    limit: &'a Limit,
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<&'a Standing>,
    /// The best gains that a wide search found in the spec's structure: evidence, no bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    best_in_structure: Option<&'a Standing>,
    /// What all numbers of the structure together could still do: a global search with a bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    whole_structure: Option<&'a StructureBound>,
    /// The same of the PID gains alone, the filters as they stand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pid_gains_alone: Option<&'a GainsBound>,
}

impl<'a> Document<'a> {
    fn of(
        limit: &'a Limit,
        gains: Option<&'a Standing>,
        best_in_structure: Option<&'a Standing>,
        within: Option<&'a Within>,
    ) -> Document<'a> {
        let (whole_structure, pid_gains_alone) = (within.map(|w| &w.structure), within.map(|w| &w.alone));
        Document { schema: "servotune.limit/1", limit, gains, best_in_structure, whole_structure, pid_gains_alone }
    }

    fn text(&self) -> Result<String, Failure> {
        Ok(serde_json::to_string_pretty(self).map_err(|source| Failure::Json { source })? + "\n")
    }
}

/// The bounds of what the structure of given gains could do.
struct Within {
    structure: StructureBound,
    alone: GainsBound,
}

impl Within {
    fn of(plant: &Plant, gains: &Controller, spec: &Spec) -> Result<Within, TuneError> {
        let machine = Machine::Model(plant);
        Ok(Within {
            structure: structure_bound(&machine, gains, spec, &StructureSettings::default())?,
            alone: gains_bound(&machine, gains, spec, &GainsSettings::default())?,
        })
    }
}

/// The standing of the best gains that a search from many starts finds in the spec's structure.
fn searched(
    plant: &Plant,
    seen: &LimitPlant,
    spec: &Spec,
    gains: Option<&Controller>,
    sample_time_s: f64,
    starts: usize,
) -> Result<Standing, Failure> {
    let wide = TuneSettings { sample_time_s, starts, ..TuneSettings::default() };
    let best = tune(&Machine::Model(plant), spec, gains, &wide)?;
    Ok(standing(seen, best.controller(), spec)?)
}

/// How far a gain table is from the best possible, as `tune --gap` writes it beside the table.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Gap {
    /// The document that `limit --gains` would write.
    pub file: PathBuf,
    /// The gaps in sentences.
    pub says: String,
}

/// Starts of the search that a table is compared with.
const STARTS: usize = 24;

/// Bounds what any loop of the class could do for this plant, searches the spec's structure from many starts, and adds both to the files written beside
/// the table (`gains.limit.json`).
pub(super) fn beside(
    gains: &Path,
    controller: &Controller,
    plant: &Plant,
    spec: &Spec,
    files: &mut FileSet,
    screen: &mut Screen,
) -> Result<Gap, Failure> {
    let t = controller.sample_time_s;
    let seen = LimitPlant::of_model(plant, t).map_err(LimitError::from)?;
    screen.say("how far from the best possible: bounds and search, a few minutes");
    let settings = LimitSettings { alone: 0, ..LimitSettings::default() };
    let bound = limit(&seen, t, controller.feedforward.as_ref(), spec, &settings)?;
    let own = standing(&seen, controller, spec)?;
    let best = searched(plant, &seen, spec, Some(controller), t, STARTS)?;
    let within = Within::of(plant, controller, spec)?;
    let file = gains.with_extension("limit.json");
    files.write(&file, Document::of(&bound, Some(&own), Some(&best), Some(&within)).text()?);
    let (structure, alone) = (Some(&within.structure), Some(&within.alone));
    Ok(Gap { file, says: limit_sentences(&bound, Some(&own), Some((&best, STARTS)), structure, alone) })
}

pub(super) fn run(a: &LimitArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    a.out.as_deref().map_or(Ok(()), check_target)?;
    let plant = load::plant(&a.plant)?;
    if let Some(p) = plant.physics.first() {
        return Err(LimitError::Physics { effect: p.effect.clone() }.into());
    }
    let spec = Spec::read(&a.spec).map_err(TuneError::from)?;
    let gains = a.gains.as_ref().map(|file| load::controller(file)).transpose()?;
    let t = gains.as_ref().map_or(a.sample_time_s, |g| g.sample_time_s);
    let seen = LimitPlant::of_model(&plant, t).map_err(LimitError::from)?;
    let settings = LimitSettings { rounds: a.rounds, alone: a.alone, tail: a.tail, ..LimitSettings::default() };
    let forward = gains.as_ref().and_then(|g| g.feedforward.as_ref());
    let found = limit(&seen, t, forward, &spec, &settings)?;
    let figures = gains.as_ref().map(|g| standing(&seen, g, &spec)).transpose()?;
    let searched = match a.search {
        0 => None,
        starts => Some(searched(&plant, &seen, &spec, gains.as_ref(), t, starts)?),
    };
    let within = gains.as_ref().map(|g| Within::of(&plant, g, &spec)).transpose()?;
    let document = Document::of(&found, figures.as_ref(), searched.as_ref(), within.as_ref());
    if let Some(file) = &a.out {
        write_text(file, &document.text()?)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    let mut text = limit_table(&found, figures.as_ref(), &plant.position_unit)?.text();
    let (structure, alone) = (within.as_ref().map(|w| &w.structure), within.as_ref().map(|w| &w.alone));
    text += &limit_sentences(&found, figures.as_ref(), searched.as_ref().map(|s| (s, a.search)), structure, alone);
    screen.result(&document, &text)?;
    Ok(if found.verdict == Verdict::Impossible { Ending::Rejected } else { Ending::Accepted })
}
