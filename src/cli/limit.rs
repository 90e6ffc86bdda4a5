//! `servotune limit`: the lowest DFT that any linear controller could reach, and the gap of given gains.

use super::limit_arguments::LimitArguments;
use super::{Ending, Failure, Screen, load};
use crate::document::write_text;
use crate::report::limit::{limit_sentences, limit_table};
use crate::tune::{
    Limit, LimitError, LimitPlant, LimitSettings, Machine, Spec, Standing, TuneError, TuneSettings, Verdict, limit,
    standing, tune,
};
use serde::Serialize;

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    limit: &'a Limit,
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<&'a Standing>,
    /// The best gains that a wide search found in the spec's structure: evidence, no bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    best_in_structure: Option<&'a Standing>,
}

pub(super) fn run(a: &LimitArguments, screen: &mut Screen) -> Result<Ending, Failure> {
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
        starts => {
            let wide = TuneSettings { sample_time_s: t, starts, ..TuneSettings::default() };
            let best = tune(&Machine::Model(&plant), &spec, gains.as_ref(), &wide)?;
            Some(standing(&seen, best.controller(), &spec)?)
        }
    };
    let document = Document {
        schema: "servotune.limit/1",
        limit: &found,
        gains: figures.as_ref(),
        best_in_structure: searched.as_ref(),
    };
    if let Some(file) = &a.out {
        let text = serde_json::to_string_pretty(&document).map_err(|source| Failure::Json { source })?;
        write_text(file, &(text + "\n"))?;
        screen.say(&format!("wrote {}", file.display()));
    }
    let mut text = limit_table(&found, figures.as_ref(), &plant.position_unit)?.text();
    text += &limit_sentences(&found, figures.as_ref(), searched.as_ref().map(|s| (s, a.search)));
    screen.result(&document, &text)?;
    Ok(if found.verdict == Verdict::Impossible { Ending::Rejected } else { Ending::Accepted })
}
