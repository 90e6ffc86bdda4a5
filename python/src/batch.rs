//! Many machines in one call: rows are independent, a bad one is a row with its error.
//!
//! In: columns of an Arrow table as numpy views, without copies. Out: a value or an error for each row, in the table's order. A sweep is read through the
//! text of the file that it would stand in, so that a row gets what the command line gives for that file, digests included.

use crate::controller::Controller;
use crate::refusal::words;
use crate::rows::{Row, rows};
use crate::settings::{Reading, model, reading, uncertainty};
use crate::spec::Spec;
use crate::tune::{Held, Job, Machine, run};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::feedback::{Amplitudes, Margins, MeasuredLoop, measured_margins};
use servotune::frf::{Hold, Sweep, read_bytes};
use servotune::identify::identify;
use servotune::lti::PlantFile;
use servotune::tune::{Outcome, TuneSettings};
use servotune::verify::{Inputs, LEAST_DAMPING, SourceFile, VerifySettings, Word, certify};
use servotune_answer::{self as answer, IdentifiedDocument, Named, Proof, TunedDocument, adjusted, model_margins};
use std::fmt::Write;
use std::path::Path;

/// Sweeps of a table: list columns as offsets and values. A row of a list that is null is empty.
#[derive(FromPyObject)]
pub struct Sweeps<'py>([PyReadonlyArray1<'py, i64>; 3], [PyReadonlyArray1<'py, f64>; 3]);

/// The same, for threads without the interpreter.
struct Lists<'a> {
    offsets: [&'a [i64]; 3],
    values: [&'a [f64]; 3],
}

/// Names of the three columns.
const COLUMNS: [&str; 3] = ["frequency_hz", "magnitude_db", "phase_deg"];

impl<'py> Sweeps<'py> {
    fn lists(&self) -> PyResult<Lists<'_>> {
        let [a, b, c] = &self.0;
        let [x, y, z] = &self.1;
        let offsets = [a.as_slice()?, b.as_slice()?, c.as_slice()?];
        let values = [x.as_slice()?, y.as_slice()?, z.as_slice()?];
        for (k, (o, v)) in offsets.iter().zip(&values).enumerate() {
            let rising = o.windows(2).all(|p| p[0] <= p[1]);
            let inside = o.first().is_some_and(|f| *f >= 0) && o.last().is_some_and(|l| *l as usize <= v.len());
            if o.len() != offsets[0].len() || !rising || !inside {
                let words = format!("column {}: its offsets do not fit its values or the other columns", COLUMNS[k]);
                return Err(PyValueError::new_err(words));
            }
        }
        Ok(Lists { offsets, values })
    }
}

impl Lists<'_> {
    fn rows(&self) -> usize {
        self.offsets[0].len() - 1
    }

    fn list(&self, column: usize, row: usize) -> &[f64] {
        let o = self.offsets[column];
        &self.values[column][o[row] as usize..o[row + 1] as usize]
    }

    /// The sweep of a row, read as its file would be.
    fn sweep(&self, row: usize, name: &str, reading: &Reading) -> Result<Sweep, String> {
        let [hz, db, deg] = [0, 1, 2].map(|k| self.list(k, row));
        if db.len() != hz.len() || deg.len() != hz.len() {
            let found = [hz.len(), db.len(), deg.len()];
            return Err(format!("{name}: {found:?} values in {COLUMNS:?}; expected lists of one length"));
        }
        let mut text = String::with_capacity(64 * hz.len() + 64);
        text.push_str("Frequency (Hz)\tMagnitude (dB)\tPhase (deg)\n");
        for ((f, m), p) in hz.iter().zip(db).zip(deg) {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{f}\t{m}\t{p}");
        }
        let settings = adjusted(reading.settings.clone(), reading.measured, reading.unstable_poles);
        let mut sweep = read_bytes(name, text.as_bytes(), &settings).map_err(|e| words(&e))?;
        sweep.frf = sweep.frf.with_unstable_poles(reading.unstable_poles);
        Ok(sweep)
    }
}

/// Refuses what a batch of plain sweeps cannot open.
fn plain(keywords: &Bound<'_, PyDict>) -> PyResult<Reading> {
    let r = reading(keywords)?;
    if r.measured != servotune::frf::Measured::Plant || r.settings.columns.is_some() || r.settings.dataset.is_some() {
        return Err(PyValueError::new_err(
            "a batch takes sweeps of the plant in its three columns; expected no measured, columns or dataset",
        ));
    }
    Ok(r)
}

/// The controller of a row: its own text, else the one for all.
fn law(
    slot: &str,
    own: Option<&str>,
    all: Option<&(servotune::controller::Controller, String)>,
) -> Result<Option<(servotune::controller::Controller, String)>, String> {
    match own {
        Some(text) => {
            let name = format!("controller of {slot}");
            let c = answer::controller(Path::new(&name), text).map_err(|e| words(&e))?;
            Ok(Some((c, text.to_owned())))
        }
        None => Ok(all.cloned()),
    }
}

fn for_all(controller: Option<&Controller>) -> Option<(servotune::controller::Controller, String)> {
    controller.map(|c| (c.controller.clone(), c.text.clone()))
}

fn json(document: &impl serde::Serialize) -> Result<String, String> {
    serde_json::to_string(document).map_err(|e| e.to_string())
}

/// Verdict, objective, phase margin (deg), gain margin (dB), Ms, gain table, certified, document, certificate.
type TunedRow = (&'static str, f64, Option<f64>, Option<f64>, f64, Option<String>, bool, String, Option<String>);

/// Tunes every sweep of a table.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "Python names every one of them")]
pub fn batch_tune(
    py: Python<'_>,
    slots: Vec<String>,
    sweeps: Sweeps<'_>,
    controllers: Vec<Option<String>>,
    controller: Option<&Controller>,
    spec: &Spec,
    units: (String, String),
    hold_included: bool,
    certificate: bool,
    starts: usize,
    sample_time_s: Option<f64>,
    reading_words: &Bound<'_, PyDict>,
    model_words: &Bound<'_, PyDict>,
    threads: usize,
) -> PyResult<Vec<Row<TunedRow>>> {
    let lists = sweeps.lists()?;
    let reading = plain(reading_words)?;
    let settings = TuneSettings { sample_time_s, starts, ..TuneSettings::default() };
    let job = Job { spec, settings, certificate, uncertainty: Default::default() };
    let (model, hold_s) = model(model_words, (&units.0, &units.1))?;
    let held = Held { hold_s, by_controller: hold_included };
    let all = for_all(controller);
    let one = |i: usize| -> Result<TunedRow, String> {
        let sweep = lists.sweep(i, &slots[i], &reading)?;
        let start = law(&slots[i], controllers[i].as_deref(), all.as_ref())?;
        let machine = Machine::Sweep(Path::new(&slots[i]), Box::new(sweep), &model, held);
        let start = start.as_ref().map(|(c, text)| (c, text.as_str()));
        let (given, reached) = run(machine, &job, start, &mut |_| ()).map_err(|e| words(&e))?;
        let verdict = match &reached.outcome {
            Outcome::Tuned(_) => "tuned",
            Outcome::TunedWithoutGuard(_) => "tuned_without_guard",
            Outcome::Infeasible(_) => "infeasible",
        };
        let proof = reached.certificate.as_ref().map(Proof::of);
        let document = json(&TunedDocument::of(
            &given,
            &reached,
            &spec.spec,
            proof.as_ref().filter(|_| reached.tuned),
            None,
            None,
        ))?;
        let certificate = match &reached.certificate {
            Some(Ok(c)) if reached.tuned => Some(c.text().map_err(|e| words(&e))?),
            _ => None,
        };
        let after = &reached.table.after;
        // The command line writes no table where the limits are missed; neither does a row.
        let gains = if reached.tuned { Some(reached.table.text().map_err(|e| words(&e))?) } else { None };
        Ok((
            verdict,
            reached.outcome.objective().value,
            after.phase_margin_deg,
            after.gain_margin_db,
            after.max_sensitivity,
            gains,
            reached.tuned && proof.is_some_and(|p| p.proved),
            document,
            certificate,
        ))
    };
    rows(py, threads, lists.rows(), one)
}

/// Order, relative error, plant.toml, accepted, document.
type IdentifiedRow = (usize, f64, String, bool, String);

/// Identifies every sweep of a table.
#[pyfunction]
pub fn batch_identify(
    py: Python<'_>,
    slots: Vec<String>,
    sweeps: Sweeps<'_>,
    units: (String, String),
    reading_words: &Bound<'_, PyDict>,
    model_words: &Bound<'_, PyDict>,
    threads: usize,
) -> PyResult<Vec<Row<IdentifiedRow>>> {
    let lists = sweeps.lists()?;
    let reading = plain(reading_words)?;
    let (settings, hold_s) = model(model_words, (&units.0, &units.1))?;
    let one = |i: usize| -> Result<IdentifiedRow, String> {
        let mut sweep = lists.sweep(i, &slots[i], &reading)?;
        sweep.frf = sweep.frf.with_hold(Hold::of(hold_s));
        let id = identify(&sweep.frf, &settings).map_err(|e| format!("{}: {}", slots[i], words(&e)))?;
        let document = IdentifiedDocument::of(&sweep, &id);
        let text = toml::to_string(&PlantFile::from(&id.plant)).map_err(|e| e.to_string())?;
        Ok((id.plant.order(), id.rms_relative_error, text, document.accepted(), json(&document)?))
    };
    rows(py, threads, lists.rows(), one)
}

/// Stable, phase margin (deg), its crossover (Hz), gain margin (dB), its crossover (Hz), Ms, its frequency (Hz), modulus margin, delay margin (s), disk
/// margin, document.
type MarginsRow = (bool, Option<f64>, Option<f64>, Option<f64>, Option<f64>, f64, f64, f64, Option<f64>, f64, String);

fn margins_row(m: &Margins, accepted: bool, document: String) -> MarginsRow {
    (
        accepted,
        m.phase_margin_deg,
        m.gain_crossover_hz,
        m.gain_margin_db,
        m.phase_crossover_hz,
        m.max_sensitivity,
        m.max_sensitivity_hz,
        m.modulus_margin,
        m.delay_margin_s,
        m.disk_margin,
        document,
    )
}

/// Margins of every row: of its plant's text, or of its sweep where it has no plant.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "Python names every one of them")]
pub fn batch_margins(
    py: Python<'_>,
    slots: Vec<String>,
    plants: Option<Vec<Option<String>>>,
    sweeps: Option<Sweeps<'_>>,
    controllers: Vec<Option<String>>,
    controller: Option<&Controller>,
    hold_included: bool,
    reading_words: &Bound<'_, PyDict>,
    threads: usize,
) -> PyResult<Vec<Row<MarginsRow>>> {
    let reading = plain(reading_words)?;
    let lists = sweeps.as_ref().map(Sweeps::lists).transpose()?;
    let all = for_all(controller);
    let one = |i: usize| -> Result<MarginsRow, String> {
        let slot = &slots[i];
        let (law, _) = law(slot, controllers[i].as_deref(), all.as_ref())?
            .ok_or_else(|| format!("{slot}: no controller; expected the column `controller` or controller="))?;
        let law_name = format!("controller of {slot}");
        let controller = Named { file: Path::new(&law_name), value: &law };
        match (plants.as_ref().and_then(|p| p[i].as_deref()), &lists) {
            (Some(text), _) => {
                let name = format!("plant of {slot}");
                let plant = answer::plant(Path::new(&name), text).map_err(|e| words(&e))?;
                let plant = Named { file: Path::new(&name), value: &plant };
                let judged = model_margins(
                    plant,
                    controller,
                    &Amplitudes { low: 0.15, high: 15.0, ..Amplitudes::default() },
                    &mut |_| (),
                )
                .map_err(|e| words(&e))?;
                let m = match &judged {
                    answer::ModelMargins::Linear(m) => m.as_ref(),
                    answer::ModelMargins::Described(d) => &d.margins.worst,
                };
                Ok(margins_row(m, judged.stable(), json(&judged)?))
            }
            (None, Some(lists)) => {
                let mut sweep = lists.sweep(i, slot, &reading)?;
                sweep.frf = sweep.frf.with_hold(Hold::of(hold_included.then_some(law.sample_time_s)));
                let sections = law.sections().map_err(|e| format!("{law_name}: {}", words(&e)))?;
                let l = MeasuredLoop::new(&sweep.frf, &sections).map_err(|e| words(&e))?;
                let judged = measured_margins(&l).map_err(|e| words(&e))?;
                Ok(margins_row(&judged.margins, judged.margins.stable, json(&judged)?))
            }
            (None, None) => Err(format!("{slot}: no plant; expected its TOML text in the column `plant`")),
        }
    };
    rows(py, threads, slots.len(), one)
}

/// Proved, findings, document.
type ProvedRow = (bool, usize, String);

/// Proves every gain table of a table on its plant.
#[pyfunction]
pub fn batch_verify(
    py: Python<'_>,
    slots: Vec<String>,
    gains: Vec<Option<String>>,
    plants: Vec<Option<String>>,
    spec: &Spec,
    shares: Option<&Bound<'_, PyDict>>,
    threads: usize,
) -> PyResult<Vec<Row<ProvedRow>>> {
    let uncertainty = uncertainty(shares)?.unwrap_or_default();
    let one = |i: usize| -> Result<ProvedRow, String> {
        let slot = &slots[i];
        let source = |what: &str, text: Option<&String>| {
            let text =
                text.ok_or_else(|| format!("{slot}: no {what}; expected its TOML text in the column `{what}`"))?;
            Ok::<_, String>(SourceFile { file: format!("{what} of {slot}").into(), text: text.clone() })
        };
        let plant = source("plant", plants[i].as_ref())?;
        let inputs = Inputs {
            gains: &source("gains", gains[i].as_ref())?,
            plants: std::slice::from_ref(&plant),
            sweeps: &[],
            least_damping: LEAST_DAMPING,
            spec: &spec.source,
            profile: spec.profile.as_ref(),
            word: Word::default(),
            uncertainty,
        };
        let c = certify(&inputs, &VerifySettings::default()).map_err(|e| words(&e))?;
        Ok((c.proved, c.findings.len(), json(&c)?))
    };
    rows(py, threads, slots.len(), one)
}

/// Verdict, effects, document.
type DiagnosedRow = (String, Vec<String>, String);

/// Diagnoses every case folder.
#[pyfunction]
pub fn batch_diagnose(
    py: Python<'_>,
    folders: Vec<Option<String>>,
    threads: usize,
) -> PyResult<Vec<Row<DiagnosedRow>>> {
    let one = |i: usize| match &folders[i] {
        Some(folder) => crate::diagnose::row(Path::new(folder)),
        None => Err("no folder; expected the path of a case folder in the column `case`".to_owned()),
    };
    rows(py, threads, folders.len(), one)
}
