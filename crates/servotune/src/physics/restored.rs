//! The physics of a plant file made ready: entries by name into effects with their numbers.
//!
//! In: a plant with `[[plant.physics]]` tables and what is known of the motion. Out: effects, settings, the scene they act
//! in, and the entries that no simulation can carry, by name. Spec: `specs/mismatch.md`, "Use".

use super::effect::{Given, PhysicsError};
use super::free_form;
use super::library::{Effect, LawSetting, curves, data_facts, effect, library};
use super::sample::MotionScene;
use super::share::Share;
use crate::document::Need;
use crate::lti::{Body, PhysicsEntry, Plant};

/// What a plant file does not say of the machine and its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Context {
    /// Sample time (s).
    pub sample_time_s: f64,
    /// Spindle frequency (Hz), where there is a spindle.
    pub spindle_hz: Option<f64>,
    /// Largest distance from the middle of the stroke (position_unit).
    pub travel: f64,
    /// Largest speed (position_unit/s).
    pub speed: f64,
    /// Largest command (command_unit).
    pub command: f64,
    /// White noise of the position sensor, rms (position_unit).
    pub noise: f64,
    /// Length of the record (s).
    pub duration_s: f64,
}

/// Half a stroke of a servo writer (position_unit), where no move says more.
const TRAVEL: f64 = 15.0;

impl Default for Context {
    fn default() -> Self {
        let (sample_time_s, travel) = (39.6e-6, TRAVEL);
        Context { sample_time_s, spindle_hz: None, travel, speed: 350.0, command: 10.0, noise: 0.0, duration_s: 1.0 }
    }
}

/// A plant's physics, ready to be simulated.
#[derive(Clone)]
pub struct Restored {
    /// Effects with their numbers, in the order of the file.
    pub parts: Vec<LawSetting>,
    /// The machine they act in: the linear plant, without physics entries.
    pub scene: MotionScene,
    /// Entries that belong to the records (statistics, clocks, logs): no law, left out.
    pub left_out: Vec<&'static str>,
}

impl Restored {
    /// The physics of `plant`; unknown effects and unknown or missing parameters are refused by name.
    pub fn of(plant: &Plant, context: &Context) -> Result<Restored, PhysicsError> {
        let scene = MotionScene {
            plant: Plant { physics: Vec::new(), ..plant.paired() },
            sample_time_s: context.sample_time_s,
            spindle_hz: context.spindle_hz,
            travel: context.travel,
            centre: 0.0,
            speed: context.speed,
            command: context.command,
            command_step: context.command,
            noise: context.noise,
            duration_s: context.duration_s,
            session_s: context.duration_s,
            indexed: false,
            warm: false,
        };
        let mut restored = Restored { parts: Vec::new(), scene, left_out: Vec::new() };
        for entry in &plant.physics {
            if entry.effect == free_form::FACTS.name {
                bodied(entry, &restored.scene.plant)?;
                restored.parts.push(LawSetting::fixed(free_form::restored(entry)?));
                continue;
            }
            if entry.curve.is_some() {
                let what = "found a curve; expected named parameters, a curve is effect `free_form`".into();
                return Err(PhysicsError::Curve { effect: entry.effect.clone(), what });
            }
            match effect(&entry.effect) {
                Some(e) => {
                    bodied(entry, &restored.scene.plant)?;
                    restored.parts.push(setting(e, entry, &restored.scene)?);
                }
                None => match data_facts().iter().find(|f| f.name == entry.effect) {
                    Some(facts) => restored.left_out.push(facts.name),
                    None => {
                        let laws = library().iter().chain(curves()).map(|e| e.facts().name);
                        let known: Vec<&str> = laws.chain([free_form::FACTS.name]).collect();
                        return Err(PhysicsError::Unknown { effect: entry.effect.clone(), known: known.join(", ") });
                    }
                },
            }
        }
        Ok(restored)
    }

    /// Names of the effects that act, in the order of the file.
    pub fn names(&self) -> Vec<&'static str> {
        self.parts.iter().map(|s| s.facts().name).collect()
    }

    /// Refuses a plant whose sensor does not tell where the arm is: margins and tuning close a loop on it.
    pub fn seen(&self) -> Result<(), PhysicsError> {
        let blind = self.parts.iter().find(|s| s.response_share(&self.scene, 1.0) == Share::Blind);
        blind.map_or(Ok(()), |s| Err(PhysicsError::Blind { effect: s.facts().name }))
    }

    /// Effects as [`super::SimulatedMachine::new`] takes them.
    pub fn effects(&self) -> Vec<&LawSetting> {
        self.parts.iter().collect()
    }
}

/// Refuses a plant without the body that laws act on.
fn bodied(entry: &PhysicsEntry, plant: &Plant) -> Result<(), PhysicsError> {
    match &plant.body {
        Body::Rational(r) => Err(PhysicsError::Body { effect: entry.effect.clone(), poles: r.poles.len() }),
        _ => Ok(()),
    }
}

fn setting(e: &'static dyn Effect, entry: &PhysicsEntry, scene: &MotionScene) -> Result<LawSetting, PhysicsError> {
    let name = e.facts().name;
    if let Some((parameter, found)) = entry.parameters.iter().find(|(_, v)| !v.is_finite()) {
        return Err(PhysicsError::Finite { effect: name, parameter: parameter.clone(), found: *found });
    }
    let setting = e.setting_of(&Given::new(name, &entry.parameters), scene)?;
    // What an effect reports of a setting is what it understands, and a default says nothing.
    let known: Vec<&str> = setting.parameters(scene).iter().map(|p| p.name).collect();
    let says =
        |k: &str, v: f64| !e.facts().keys.iter().any(|key| key.name == k && matches!(key.need, Need::Or(d) if d == v));
    let unknown = |(k, v): &(&String, &f64)| !known.contains(&k.as_str()) && says(k, **v);
    match entry.parameters.iter().find(unknown) {
        Some((parameter, _)) => {
            let (effect, parameter) = (name.to_owned(), parameter.clone());
            Err(PhysicsError::Parameter { effect, parameter, expected: known.join(", ") })
        }
        None => Ok(setting),
    }
}
