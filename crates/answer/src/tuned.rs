//! The search of gains and the document of `tune`.

use super::{AnswerError, Named, Proof, Say, for_a_loop};
use serde::Serialize;
use servotune::controller::{Controller, Pid};
use servotune::frf::Sweep;
use servotune::identify::{IdentifySettings, identify};
use servotune::lti::Plant;
use servotune::pes::context;
use servotune::tune::{InputDigest, Outcome, PhysicalJudgement, Spec, TuneError};
use servotune::verify::SourceFile;
use servotune_report::workflow::{Asked, Given, Reached, tune_and_verify};
use std::path::Path;

/// The document of `tune`.
#[derive(Serialize)]
pub struct TunedDocument<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    objective: Objective,
    gain_table: Option<&'a Path>,
    /// The proof of the table; absent without a table or without a certificate asked for.
    certificate: Option<&'a Proof>,
    report: Option<&'a Path>,
    /// Names and judgement of the physics; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    physics: Option<Physics<'a>>,
}

/// What was made smallest, as the contract names it.
#[derive(Serialize)]
struct Objective {
    name: &'static str,
    value: f64,
    unit: String,
    /// No bound is computed.
    lower_bound: Option<f64>,
    starts: usize,
    starts_at_best: usize,
}

#[derive(Serialize)]
struct Physics<'a> {
    effects: Vec<&'static str>,
    amplitudes: &'a [f64],
    rounds: usize,
    before: Option<&'a PhysicalJudgement>,
    after: &'a PhysicalJudgement,
}

/// A plant model to be tuned, with the digest of its file; `clock` is the controller's sample time (s).
pub fn given_model(
    plant: Named<'_, Plant>,
    source: SourceFile,
    spec: &Spec,
    start: Option<&Controller>,
    clock: f64,
    say: Say<'_>,
) -> Result<(Given, InputDigest), AnswerError> {
    let physics = if plant.value.physics.is_empty() {
        None
    } else {
        let clock = start.cloned().unwrap_or_else(|| at_clock(clock));
        let profile = spec.write("tuning a plant with physics").map_err(TuneError::from)?;
        for_a_loop(plant, &context(profile, &clock), say)?.map(Box::new)
    };
    let linear = Plant { physics: Vec::new(), ..plant.value.clone() };
    let digest = InputDigest { role: "plant".into(), sha256: source.sha256() };
    Ok((Given::Model { plant: Box::new(linear), source: Box::new(source), physics }, digest))
}

/// A sweep to be tuned on, with its digest; a sweep with the hold in it has it divided out of the model.
pub fn given_sweep(file: &Path, sweep: Sweep, model: &IdentifySettings) -> Result<(Given, InputDigest), AnswerError> {
    let identified =
        identify(&sweep.frf, model).map_err(|source| AnswerError::Identify { file: file.into(), source })?;
    let digest = InputDigest { role: "frf".into(), sha256: sweep.source_digest.clone() };
    Ok((Given::Response { sweep: Box::new(sweep), identified: Box::new(identified) }, digest))
}

/// Tunes, and proves the table on the way.
pub fn tuned(given: &Given, asked: &Asked<'_>, say: Say<'_>) -> Result<Reached, AnswerError> {
    Ok(tune_and_verify(given, asked, say)?)
}

impl<'a> TunedDocument<'a> {
    /// Of a tuning, with the files that were written and the proof of the table.
    pub fn of(
        given: &'a Given,
        reached: &'a Reached,
        spec: &Spec,
        proof: Option<&'a Proof>,
        gain_table: Option<&'a Path>,
        report: Option<&'a Path>,
    ) -> Self {
        let (units, o) = (given.units(), reached.outcome.objective());
        let objective = Objective {
            name: o.name.name(),
            value: o.value,
            unit: spec.objective.unit(units.position, units.command),
            lower_bound: None,
            starts: o.starts,
            starts_at_best: o.starts_at_best,
        };
        let physics = given.physics().zip(reached.physics.as_ref()).map(|(physics, t)| Physics {
            effects: physics.names(),
            amplitudes: &t.amplitudes,
            rounds: t.rounds,
            before: t.before.as_ref(),
            after: &t.after,
        });
        TunedDocument { outcome: &reached.outcome, objective, gain_table, certificate: proof, report, physics }
    }
}

/// A controller of nothing but a clock.
fn at_clock(sample_time_s: f64) -> Controller {
    let pid = Pid { kp: 1.0, ki_per_s: 0.0, kd_s: 0.0, derivative_filter_s: 0.0 };
    let (lowpass, notch) = (Vec::new(), Vec::new());
    Controller { sample_time_s, output_limit: None, pid, lowpass, notch, biquad: Vec::new(), feedforward: None }
}
