//! A play whose masses rattle, found under an observer: no simulation over a whole record repeats what depends on the smallest start.
//!
//! In: a diagnosis that ended without a name, or at a part of the structure, and what its linear plants leave in open loop. Out: the finding, and a plant
//! that was fitted beside what the observer saw. A resonance under the same observer is the rival; held-out records must agree.
//! Spec: `specs/mismatch.md`.

use super::finding::{Estimate, Finding, Verdict};
use super::judgement::{Judgement, Later};
use super::localisation::place;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::play_ground::{FittedPlay, LOADS, PlayGround, Side, readings};
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::errors;
use crate::diagnose::rules::{
    Answer, Consulted, PLAY_CLEARLY, PLAY_HELD_OUT, PLAY_LEAST, PLAY_TOUCHES, PLAY_UNDOUBTED, asked,
};
use crate::lti::{PhysicsEntry, Plant};
use crate::physics::backlash::{Backlash, Contact, FACTS};
use crate::physics::{LawSetting, Parametric, PlayObserver, Port, Readings};
use std::collections::BTreeMap;

/// Shortest record.
const SHORTEST: usize = 64;
/// Linear plants that the search sets out from: those that leave least.
const PLANTS: usize = 2;
/// Rounds of plant and play after one another.
const ROUNDS: usize = 3;
/// What the observer errs by: it takes a kink for its mean (shares of gap and frequency).
const FORM: [f64; 2] = [0.06, 0.12];
/// The load's share where nothing tells it: the value, and the range.
const LOAD: f64 = 0.2;
const LOAD_RANGE: [f64; 2] = [0.0, 0.5];

/// A play under the observer.
pub(in crate::diagnose) struct ObservedPlay {
    finding: Finding,
    remark: String,
    consulted: Vec<Consulted>,
    /// The plant beside it, with the play.
    corrected: Corrected,
}

/// What a plant leaves of every run in open loop.
fn left(data: &DiagnosisData, made: &Corrected) -> Vec<Vec<f64>> {
    let every: Vec<&Run> = data.runs.iter().collect();
    errors(&SimulatedModel::of(&made.plant, &made.effects, &data.scene), &every, None)
}

/// The plant that is fitted to what the records hold beside the play.
fn beside(data: &DiagnosisData, rest: &[Vec<f64>], play: &PlayObserver, iterations: usize) -> Option<Corrected> {
    let t = data.scene.sample_time_s;
    let cleared = |(run, rest): (&Run, &Vec<f64>)| {
        let added = play.follow(&readings(run, rest, 0..run.len(), t), t).added;
        let position = run.position.iter().zip(&added).map(|(y, q)| y - q).collect();
        Run { position, ..run.clone() }
    };
    let runs = data.runs.iter().zip(rest).map(cleared).collect();
    let ground = DiagnosisData::new(&data.form.given, runs, t, data.scene.spindle_hz).ok()?;
    let (ground, linear) = refit(ground, iterations);
    Some(corrected(&ground.form, &linear.refitted.p, &[], &ground.scene))
}

/// A play with the plant beside it.
struct Found {
    ground: PlayGround,
    plant: Corrected,
    /// What that plant leaves of every run (position_unit).
    rest: Vec<Vec<f64>>,
    play: FittedPlay,
}

/// The play beside one of some linear plants, with the grounds of all: plant and play after one another until neither gains.
fn found(data: &DiagnosisData, plants: &[Plant], iterations: usize) -> Option<(Found, Vec<PlayGround>)> {
    let mut begun: Vec<(PlayGround, Vec<Vec<f64>>, Corrected)> = Vec::new();
    for plant in plants {
        let plant = Corrected { plant: plant.clone(), effects: vec![] };
        let rest = left(data, &plant);
        if let Some(ground) = PlayGround::of(data, &rest)
            && begun.iter().all(|(g, ..)| g.rest != ground.rest)
        {
            begun.push((ground, rest, plant));
        }
    }
    begun.sort_by(|a, b| a.0.rest.total_cmp(&b.0.rest));
    begun.truncate(PLANTS);
    let plays = begun.iter().enumerate().flat_map(|(i, (ground, ..))| {
        [Side::Before, Side::Behind].into_iter().filter_map(move |s| ground.fitted(s).map(|play| (i, play)))
    });
    let (at, play) = plays.min_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))?;
    let (ground, rest, plant) = begun.swap_remove(at);
    let mut grounds: Vec<PlayGround> = begun.into_iter().map(|b| b.0).collect();
    let mut best = Found { ground, plant, rest, play };
    for _ in 0..ROUNDS {
        let Some(plant) = beside(data, &best.rest, &best.play.observer, iterations) else { break };
        let rest = left(data, &plant);
        let Some(ground) = PlayGround::of(data, &rest) else { break };
        let Some(play) = ground.settled(best.play.side, &best.play.observer) else { break };
        if play.deviance >= best.play.deviance {
            grounds.push(ground);
            break;
        }
        grounds.push(std::mem::replace(&mut best, Found { ground, plant, rest, play }).ground);
    }
    Some((best, grounds))
}

/// Looks for a play under the observer, beside linear plants; none where a resonance follows the records as well.
pub(in crate::diagnose) fn observed_play(
    data: &DiagnosisData,
    plants: &[Plant],
    iterations: usize,
) -> Option<ObservedPlay> {
    if data.runs.iter().any(|r| r.len() < SHORTEST) {
        return None;
    }
    let (best, grounds) = found(data, plants, iterations)?;
    let (own, play) = (&best.ground, &best.play);
    let rivals: Vec<[f64; 2]> = grounds
        .iter()
        .chain([own])
        .filter_map(|g| g.fitted(Side::Resonance).map(|r| [r.deviance, g.held_out(&r.observer)]))
        .collect();
    let least = |at: usize| rivals.iter().map(|r| r[at]).fold(f64::INFINITY, f64::min);
    let (samples, held) = (PlayGround::samples(&own.fit), PlayGround::samples(&own.held));
    let gain = least(0) - play.deviance;
    let contact = |r: &Readings| play.observer.follow(r, own.sample_time_s).touching * r.rest.len() as f64;
    let touching = own.fit.iter().map(contact).sum::<f64>() / samples;
    let crossed = asked!(touching, PLAY_TOUCHES: touching > PLAY_TOUCHES && touching < 1.0 - PLAY_TOUCHES);
    let agrees = match held == 0.0 {
        true => true.into(),
        false => {
            let by = (least(1) - own.held_out(&play.observer)) / held;
            asked!(by * samples / gain, PLAY_HELD_OUT: by > PLAY_HELD_OUT * gain / samples)
        }
    };
    let clear = asked!(gain, > PLAY_LEAST) & asked!(gain / samples, PLAY_CLEARLY: gain > PLAY_CLEARLY * samples);
    // Numbers at an end follow any drift; a load that hides does so too, unless no resonance comes near.
    let ends = Answer::from(!own.at_end(play));
    let ends = if play.hides_load() { ends & asked!(gain / samples, > PLAY_UNDOUBTED) } else { ends };
    let found = clear & crossed & agrees & ends;
    found.yes.then(|| ObservedPlay { consulted: found.consulted, ..told(data, &best, gain, touching) })
}

/// The play as its law has it, with the share of the distance that the encoder reads.
fn law(play: &FittedPlay) -> (Backlash, f64) {
    let o = &play.observer;
    let (gap, load, read) = match play.side {
        Side::Before => {
            let load = if play.hides_load() { LOAD } else { play.load() };
            (o.gap / load, load, load)
        }
        _ => (o.gap / (1.0 - LOAD), LOAD, LOAD - 1.0),
    };
    let contact = Contact { hz: o.contact_hz, damping_ratio: o.damping_ratio, drive: 1.0 / (1.0 - load) };
    (Backlash { gap, contact: Some(contact) }, read)
}

/// The finding, what is said beside it, and the plant with the play.
fn told(data: &DiagnosisData, best: &Found, gain: f64, touching: f64) -> ObservedPlay {
    let (law, read) = law(&best.play);
    let (position, command) = (&best.plant.plant.position_unit, &best.plant.plant.command_unit);
    let spread = best.ground.spread(&best.play);
    // Parameters by the places of their logarithms; what the observer does not tell stands in its range.
    let off = |places: &[usize], form: f64| {
        let squares = spread.as_ref().map_or(0.25, |s| places.iter().map(|&i| s[i] * s[i]).sum());
        1.96 * f64::sqrt(squares).hypot(form)
    };
    let behind = best.play.side == Side::Behind;
    let hidden = behind || best.play.hides_load();
    let parameters: BTreeMap<String, Estimate> = law
        .parameters(&[read], &data.scene)
        .into_iter()
        .map(|p| {
            let by = match p.name {
                "gap" if hidden => off(&[4], FORM[0]),
                "gap" => off(&[4, 5], FORM[0]),
                "contact_hz" => off(&[0], FORM[1]),
                "damping_ratio" => off(&[1], FORM[1]),
                "encoder_behind" => 0.0,
                _ => off(if hidden { &[] } else { &[5] }, FORM[0]),
            };
            let [mut low, mut high] = [p.value * (-by).exp(), p.value * by.exp()];
            if hidden {
                // What is read behind the play is the gap less the load's share of it, before it that share, and nothing tells the share.
                let range = if behind { LOAD_RANGE } else { LOADS };
                let [one, other] = range.map(|load| if behind { 1.0 - load } else { load });
                let read = best.play.observer.gap;
                [low, high] = match p.name {
                    "gap" => [read / one.max(other) * (-by).exp(), read / one.min(other) * by.exp()],
                    "load_share" => range,
                    "drive_ratio" => range.map(|s| 1.0 / (1.0 - s)),
                    _ => [low, high],
                };
            }
            (p.name.to_owned(), Estimate { value: p.value, low, high, unit: p.unit.text(position, command) })
        })
        .collect();
    let t = data.scene.sample_time_s;
    let signal = data.stack.series(|i| {
        let first = data.stack.segments[i].runs[0];
        let all = readings(&data.runs[first], &best.rest[first], 0..data.runs[first].len(), t);
        let mut added = best.play.observer.follow(&all, t).added;
        data.whitener.apply(&mut added);
        added
    });
    let mut corrected = best.plant.clone();
    let entries = parameters.iter().map(|(name, e)| (name.clone(), e.value)).collect();
    corrected.plant.physics.push(PhysicsEntry { effect: FACTS.name.into(), parameters: entries, curve: None });
    corrected.effects.push(LawSetting::new(law, vec![read]));
    let side = if behind { "behind the play" } else { "on the driven side of it" };
    let finding = Finding {
        effect: FACTS.name.into(),
        family: vec![FACTS.name.into()],
        port: FACTS.port,
        p_value: (-0.5 * gain).exp().max(1e-300),
        says: format!("The encoder sits {side}: {}.", FACTS.says),
        parameters,
        place: place(data, &data.stack, &signal),
    };
    let remark = format!(
        "the play was found under an observer that the recorded positions correct: its masses touch {:.0} % of the time and rattle, and no simulation over a whole record repeats that (what stands above of laws on held-out records is of such simulations); a resonance under the same observer is {gain:.0} units of twice the log-likelihood worse",
        100.0 * touching
    );
    ObservedPlay { finding, remark, consulted: Vec::new(), corrected }
}

/// Whether a diagnosis leaves room for a play: nothing was named, or a part of the structure.
pub(in crate::diagnose) fn open_to_play(judged: &Judgement) -> bool {
    match judged.verdict {
        Verdict::LocatedUnexplained | Verdict::Undecidable => true,
        Verdict::Named | Verdict::Family => judged.findings.iter().any(|f| f.port == Port::Structure),
        _ => false,
    }
}

impl ObservedPlay {
    /// The judgement with it in the place of what was said, and the plant beside it.
    pub(in crate::diagnose) fn entered(self, judged: Judgement) -> (Judgement, Corrected) {
        let judged = judged.after(Later::Instead(self.finding), self.consulted).said(Some(self.remark));
        (judged, self.corrected)
    }
}
