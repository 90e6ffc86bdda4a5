//! A sealed set whose laws are of other forms than the library's: drawn from a seed, its digests published before the program is run on it.
//!
//! In: a seed and a number of cases. Out: digests, or one page with the score and a line for each case.

use super::foreign::{Foreign, SOUND};
use super::foreign_stage::{BARE, Stage};
use super::foreign_trial::{Model, Trial};
use super::sealed_draw::{Drawn, Made, WHOLE, draw, kind};
use super::sealed_page::page;
use super::sealed_row::{Outcome, Row, outcome};
use super::{Study, StudyError, sealed_folder};
use rayon::prelude::*;
use servotune::controller::Controller;
use servotune::diagnose::{DiagnoseSettings, Diagnosis, FitFigures, diagnose};
use servotune::document::sha256_hex;
use servotune::lti::Plant;
use servotune::recording::{Case, Role};
use std::sync::Mutex;
use std::time::Instant;

/// Samples of a record of the set.
pub(super) const SAMPLES: usize = 2400;
/// Draws that are tried for a place: some machines cannot be identified or held by their controller.
const DRAWS: u64 = 8;

/// A case ready for the program.
pub struct SealedCase {
    id: String,
    pub(super) drawn: Drawn,
    pub(super) made: (Case, Plant, Controller),
}

impl SealedCase {
    /// Everything that the program is given, as a digest.
    fn digest(&self) -> String {
        let mut bytes = format!("{:?}{:?}", self.made.1, self.made.2).into_bytes();
        for (entry, r) in &self.made.0.records {
            bytes.extend(entry.file.to_string_lossy().as_bytes());
            let reference = r.reference.as_deref().unwrap_or_default();
            for v in [&r.command[..], &r.position, &r.excitation, reference].concat() {
                bytes.extend(v.to_le_bytes());
            }
        }
        sha256_hex(&bytes)
    }

    /// Squares of what acts in the positions of the fitted records, over the sensor's noise, against the same machine without it.
    fn lambda(&self) -> f64 {
        let (bare, noise) = match &self.drawn.made {
            Made::Arm(t) => {
                let machine = Foreign { body: t.nominal, delay: t.machine.delay, noise: t.machine.noise, ..SOUND };
                (Trial { machine, model: Model::Exact, ..**t }.case("bare"), t.machine.noise)
            }
            Made::Stage(s, _) => match (Stage { body: s.body, noise: s.noise, ..BARE }).made("bare", None) {
                Ok(made) => (made.0, s.noise),
                Err(_) => return f64::NAN,
            },
        };
        let fits = self.made.0.records.iter().zip(&bare.records).filter(|(a, _)| a.0.role == Role::Fit);
        let of = |(a, b): (&(_, servotune::recording::Record), &(_, servotune::recording::Record))| -> f64 {
            let pairs = a.1.position.iter().zip(&b.1.position);
            pairs.map(|(y, z)| ((y / self.drawn.scale.position - z) / noise).powi(2)).sum()
        };
        fits.map(of).sum()
    }
}

/// The cases of a set, those that cannot be made left out.
pub fn sealed_set(seed: u64, count: usize, samples: usize) -> Vec<SealedCase> {
    at_places(seed, samples, (0..count).collect())
}

fn at_places(seed: u64, samples: usize, places: Vec<usize>) -> Vec<SealedCase> {
    places.into_par_iter().filter_map(|place| of_kind(kind(place), seed, place, samples)).collect()
}

/// The case of a kind that is drawn for a place; none where no draw can be made.
pub(super) fn of_kind(kind: &'static str, seed: u64, place: usize, samples: usize) -> Option<SealedCase> {
    (0..DRAWS).find_map(|again| made(kind, seed, place, samples, again))
}

/// Name of a case of this kind at a place.
fn name(kind: &str, place: usize) -> String {
    format!("s{place:03}_{}", kind.replace('+', "_"))
}

fn made(kind: &'static str, seed: u64, place: usize, samples: usize, again: u64) -> Option<SealedCase> {
    let drawn = draw(kind, seed, place, samples, again);
    let id = name(kind, place);
    let made = match &drawn.made {
        Made::Arm(trial) => trial.made(&id),
        Made::Stage(stage, size) => stage.made(&id, *size),
    };
    // One whose loop does not hold, or whose response no model of this form fits, is drawn again.
    let (case, plant, controller) = made.ok()?;
    let most = 1e3 * drawn.scale.position;
    let holds = |y: &f64| y.is_finite() && y.abs() < most;
    let (case, plant, controller) = drawn.scale.applied((case, plant, controller));
    plant.check().ok()?;
    let sound = case.records.iter().all(|(_, r)| r.position.iter().all(holds));
    sound.then_some(SealedCase { made: (case, plant, controller), id, drawn })
}

impl SealedCase {
    /// Name in the set.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// What the program is given.
    pub fn given(&self) -> &(Case, Plant, Controller) {
        &self.made
    }

    /// Whether anything acts beside the linear part.
    fn acts(&self) -> bool {
        !["sound", "linear_off"].contains(&self.drawn.kind)
    }

    /// Diagnoses the case and holds it against the truth.
    pub fn row(&self) -> Result<Row, StudyError> {
        Ok(self.diagnosed()?.0)
    }

    /// The same, with the diagnosis where there is one.
    fn diagnosed(&self) -> Result<(Row, Option<Diagnosis>), StudyError> {
        let began = Instant::now();
        let (case, plant, controller) = &self.made;
        let d = match diagnose(case, plant, Some(controller), &DiagnoseSettings::default(), |_| {}) {
            Ok(d) => d.diagnosis,
            Err(e) => return Ok((self.refused(&e.to_string(), began.elapsed().as_secs_f64()), None)),
        };
        Ok((self.held_against(&d, began.elapsed().as_secs_f64())?, Some(d)))
    }

    fn held_against(&self, d: &Diagnosis, seconds: f64) -> Result<Row, StudyError> {
        let h = d.fit.holdout.unwrap_or(d.fit.fit);
        let mut held = [0, 0];
        for (effect, parameter, value) in &self.drawn.truth {
            let found = d.findings.iter().find(|f| f.effect == *effect).and_then(|f| f.parameters.get(*parameter));
            if let Some(e) = found {
                held[1] += 1;
                held[0] += usize::from(e.low <= *value && *value <= e.high);
            }
        }
        Ok(Row {
            verdict: serde_json::to_string(&d.verdict)?.trim_matches('"').into(),
            findings: d.findings.iter().map(|f| f.family.join(" or ")).collect::<Vec<_>>().join(", "),
            outcome: outcome(&self.drawn.expected, self.acts(), d),
            // What is no number is written as a very large one: JSON has no infinity.
            holdout: [h.rms_before, h.rms_refit_linear, h.rms_after]
                .map(|v| if v.is_finite() { v / h.noise_floor.max(f64::MIN_POSITIVE) } else { 1e300 }),
            curve: d.free_form.as_ref().map(|c| self.explained(&h).unwrap_or(c.explained_share)),
            held,
            ..self.refused("", seconds)
        })
    }

    /// Share of what the better linear model leaves beyond what the machine itself leaves without its encoder's noise, which the program does not
    /// know; none of a stage.
    fn explained(&self, held: &FitFigures) -> Option<f64> {
        let Made::Arm(trial) = &self.drawn.made else { return None };
        let records = self.made.0.records.iter().enumerate();
        let held_out: Vec<usize> = records.filter(|(_, (e, _))| e.role == Role::Holdout).map(|(i, _)| i).collect();
        let noise = self.drawn.scale.position.powi(2) * trial.left_by_itself(&held_out);
        let beyond = |rms: f64| rms * rms - noise;
        Some(1.0 - beyond(held.rms_after) / beyond(held.rms_before.min(held.rms_refit_linear)))
    }

    /// The line of a case without a diagnosis.
    fn refused(&self, why: &str, seconds: f64) -> Row {
        Row {
            id: self.id.clone(),
            kind: self.drawn.kind.into(),
            fitted_under: self.drawn.fitted(),
            lambda: if self.acts() { self.lambda() } else { 0.0 },
            expected: self.drawn.expected.join(", "),
            verdict: why.into(),
            findings: String::new(),
            outcome: Outcome::Refused,
            holdout: [0.0; 3],
            curve: None,
            held: [0, 0],
            seconds,
        }
    }
}

/// The digests of a set, to be published before it is run.
pub fn digests(seed: u64, count: Option<usize>) -> Study {
    let cases = sealed_set(seed, count.unwrap_or(WHOLE), SAMPLES);
    let lines: String = cases.iter().map(|c| format!("{} {}\n", c.digest(), c.id)).collect();
    let whole = sha256_hex(lines.as_bytes());
    let mut study = Study::default();
    study.page(
        "mismatch/sealed_digests.txt",
        format!("# seed {seed}, {} cases, SHA-256 of the lines below: {whole}\n{lines}", cases.len()),
    );
    study
}

/// Runs the program on a set; `known` are the digests that were published.
pub fn sealed(
    seed: u64,
    count: Option<usize>,
    known: Option<&str>,
    say: &mut (dyn FnMut(&str) + Send),
) -> Result<Study, StudyError> {
    let cases = sealed_set(seed, count.unwrap_or(WHOLE), SAMPLES);
    let rows: Vec<Row> = rows(&cases, say)?.into_iter().map(|(row, _)| row).collect();
    written(seed, &cases, known, &rows)
}

/// The page of the lines that a run printed: one that was ended early has lines too.
pub fn sealed_of_lines(seed: u64, known: Option<&str>, lines: &str) -> Result<Study, StudyError> {
    let lines = lines.lines().filter(|l| l.starts_with('{'));
    let mut rows: Vec<Row> = lines.map(serde_json::from_str).collect::<Result<_, _>>()?;
    rows.sort_by(|a, b| a.id.cmp(&b.id));
    let has = |place: &usize| rows.iter().any(|r| r.id == name(kind(*place), *place));
    let cases = at_places(seed, SAMPLES, (0..WHOLE).filter(has).collect());
    written(seed, &cases, known, &rows)
}

/// Page and lines of a run.
fn written(seed: u64, cases: &[SealedCase], known: Option<&str>, rows: &[Row]) -> Result<Study, StudyError> {
    let published = known.map(|text| {
        let lines: Vec<&str> = text.lines().skip(1).collect();
        cases.iter().filter(|c| lines.contains(&format!("{} {}", c.digest(), c.id).as_str())).count()
    });
    let mut study = Study::default();
    study.page("mismatch/sealed.md", page(seed, rows, published));
    study.page("mismatch/sealed.json", serde_json::to_string_pretty(rows)? + "\n");
    Ok(study)
}

/// Some cases of a set, by their names, the beginnings of them or their kinds: cases and diagnoses as files, the lines as they are known.
pub fn sealed_cases(
    seed: u64,
    count: Option<usize>,
    names: &[String],
    say: &mut (dyn FnMut(&str) + Send),
) -> Result<Study, StudyError> {
    let asked =
        |place: &usize| names.iter().any(|n| name(kind(*place), *place).starts_with(n.as_str()) || kind(*place) == n);
    let cases = at_places(seed, SAMPLES, (0..count.unwrap_or(WHOLE)).filter(asked).collect());
    let mut study = Study::default();
    for (case, (_, diagnosis)) in cases.iter().zip(rows(&cases, say)?) {
        if let Some(d) = diagnosis {
            study.page(&format!("mismatch/{}.json", case.id), serde_json::to_string_pretty(&d)? + "\n");
        }
        sealed_folder::add(&mut study, &case.id, &case.made)?;
    }
    Ok(study)
}

/// Diagnoses of the cases, each line said as it is known.
fn rows(cases: &[SealedCase], say: &mut (dyn FnMut(&str) + Send)) -> Result<Vec<(Row, Option<Diagnosis>)>, StudyError> {
    let say = Mutex::new(say);
    let one = |case: &SealedCase| {
        let (row, diagnosis) = case.diagnosed()?;
        if let Ok(mut say) = say.lock() {
            say(&serde_json::to_string(&row)?);
        }
        Ok((row, diagnosis))
    };
    cases.par_iter().map(one).collect()
}
