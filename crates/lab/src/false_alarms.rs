//! How often the diagnosis raises an alarm where nothing is wrong: cases on which nothing acts, drawn from a seed, each diagnosed by the whole program.
//!
//! In: a seed and a number of cases. Out: a page, its rows, and the counts that the table of decision rules carries. A part of the cases is told
//! more than the others or less: a spindle and the noise of a sound machine, no controller, no repeats.

use super::false_alarms_page::{document, page};
use super::false_alarms_said::{EXACT, LOST, NO_REPEATS, Said};
use super::sealed::{SAMPLES, SealedCase, of_kind};
use super::sealed_draw::{Drawn, Made, STAGE_SOUND};
use super::{Study, StudyError};
use rayon::prelude::*;
use servotune::controller::Controller;
use servotune::diagnose::{DiagnoseSettings, diagnose};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, NominalNoise};
use std::sync::Mutex;

/// Cases, unless told.
const COUNT: usize = 260;
/// Kinds of the cases, in turn.
const KINDS: [&str; 5] = ["sound", "linear_off", "sound", "linear_off", STAGE_SOUND];
/// What the program is told beside the plant, in turn after each round of kinds.
const TOLD: [Told; 4] = [Told::Usual, Told::Sheet, Told::NoController, Told::NoRepeats];

/// What the program is told beside the plant.
#[derive(Clone, Copy)]
enum Told {
    /// The controller and repeats.
    Usual,
    /// Those, the spindle's speed and the noise of a sound machine.
    Sheet,
    /// Repeats, no controller.
    NoController,
    /// The controller, no repeats.
    NoRepeats,
}

impl Told {
    fn says(self) -> &'static str {
        match self {
            Told::Usual => "controller, repeats",
            Told::Sheet => "controller, repeats, spindle, noise",
            Told::NoController => "repeats",
            Told::NoRepeats => NO_REPEATS,
        }
    }
}

/// A case on which nothing acts, as the program is given it.
struct Null {
    id: String,
    kind: &'static str,
    model: &'static str,
    told: Told,
    case: Case,
    plant: Plant,
    controller: Option<Controller>,
    settings: DiagnoseSettings,
}

impl Null {
    /// The case at a place; none where its machine cannot be made.
    fn at(seed: u64, place: usize) -> Option<Null> {
        let (kind, told) = (KINDS[place % KINDS.len()], TOLD[place / KINDS.len() % TOLD.len()]);
        let SealedCase { drawn, made: (mut case, plant, controller), .. } = of_kind(kind, seed, place, SAMPLES)?;
        let mut settings = DiagnoseSettings::default();
        match told {
            Told::Sheet => {
                // Below the streams of the machines themselves.
                let hz = Random::stream(seed, place as u64).between(80.0, 200.0);
                case.spindle_hz = Some(hz / drawn.scale.time);
                let rms = match &drawn.made {
                    Made::Arm(trial) => trial.machine.noise,
                    Made::Stage(stage, _) => stage.noise,
                };
                settings.noise = NominalNoise { encoder_rms: Some(rms * drawn.scale.position), windage_rms: None };
            }
            Told::NoRepeats => {
                let mut met = Vec::new();
                case.records.retain(|(entry, _)| {
                    let first = !met.contains(&entry.repeat_group);
                    met.push(entry.repeat_group.clone());
                    first
                });
            }
            Told::Usual | Told::NoController => {}
        }
        let model = match (kind, drawn.fitted()) {
            ("linear_off", _) => "off",
            (_, false) => EXACT,
            (_, true) if lost(&plant, &drawn) => LOST,
            (_, true) => "fitted",
        };
        let controller = (!matches!(told, Told::NoController)).then_some(controller);
        Some(Null { id: format!("n{place:03}_{kind}"), kind, model, told, case, plant, controller, settings })
    }

    fn said(&self) -> Said {
        let made = diagnose(&self.case, &self.plant, self.controller.as_ref(), &self.settings, |_| {});
        Said::of([&self.id, self.kind, self.model, self.told.says()], made)
    }
}

/// Whether the fit of the given model came to nothing: its gain has the other sign, or errs by more than a factor of two.
fn lost(plant: &Plant, drawn: &Drawn) -> bool {
    let found = match plant.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s, .. } => dc_gain * natural_frequency_rad_s.powi(2),
        Body::FreeInertia { acceleration_gain, .. } => acceleration_gain,
        _ => return true,
    };
    let own = match &drawn.made {
        Made::Arm(trial) => trial.machine.body[0],
        Made::Stage(stage, _) => stage.body[0],
    };
    let scale = &drawn.scale;
    let ratio = found * scale.command * scale.time.powi(2) / (scale.position * own);
    !(0.5..=2.0).contains(&ratio)
}

fn said_at(seed: u64, place: usize) -> Option<Said> {
    Null::at(seed, place).map(|null| null.said())
}

/// The line of the case at a place of a seed: verdict, findings, the law that the plant was cleared of; none where its machine cannot be made.
pub fn false_alarm_line(seed: u64, place: usize) -> Result<Option<String>, StudyError> {
    Ok(said_at(seed, place).map(|said| serde_json::to_string(&said)).transpose()?)
}

/// Diagnoses cases on which nothing acts, each line said as it is known.
pub fn false_alarms(seed: u64, count: Option<usize>, say: &mut (dyn FnMut(&str) + Send)) -> Result<Study, StudyError> {
    let say = Mutex::new(say);
    let one = |place: usize| -> Result<Option<Said>, StudyError> {
        // A case is made when its turn comes: all at once would fill the memory.
        let Some(said) = said_at(seed, place) else { return Ok(None) };
        if let Ok(mut say) = say.lock() {
            say(&serde_json::to_string(&said)?);
        }
        Ok(Some(said))
    };
    let all = (0..count.unwrap_or(COUNT)).into_par_iter().filter_map(|place| one(place).transpose());
    written(seed, &all.collect::<Result<Vec<Said>, StudyError>>()?)
}

/// The page of the lines that a run printed: one that was ended early has lines too.
pub fn false_alarms_of_lines(seed: u64, lines: &str) -> Result<Study, StudyError> {
    let lines = lines.lines().filter(|l| l.starts_with('{'));
    let mut all: Vec<Said> = lines.map(serde_json::from_str).collect::<Result<_, _>>()?;
    all.sort_by(|a, b| a.id.cmp(&b.id));
    written(seed, &all)
}

fn written(seed: u64, all: &[Said]) -> Result<Study, StudyError> {
    let mut study = Study::default();
    study.page("mismatch/false_alarms.md", page(seed, all));
    study.page("mismatch/false_alarms.json", document(seed, all)?);
    Ok(study)
}
