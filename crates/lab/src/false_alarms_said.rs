//! What a diagnosis of a case said on which nothing acts, and which alarms that is.
//!
//! In: a diagnosis. Out: a line, and its alarms by what they guard.

use serde::{Deserialize, Serialize};
use servotune::diagnose::{Consequence, DiagnoseError, Diagnosed};
use servotune::physics::{
    Facts, broadband_disturbance, controller_mismatch, encoder_noise, jitter, line_disturbance, linear_parameters,
    lost_samples, misalignment, quantisation, repeatable_runout, shock, time_base_drift, unexplained,
};
use std::collections::BTreeMap;

/// What is said of lines, of noise and of the log. Any other name is a law's.
static LINES: [&Facts; 2] = [&line_disturbance::FACTS, &repeatable_runout::FACTS];
static NOISE: [&Facts; 4] =
    [&quantisation::FACTS, &broadband_disturbance::FACTS, &encoder_noise::FACTS, &jitter::FACTS];
static LOGS: [&Facts; 5] = [
    &controller_mismatch::FACTS,
    &lost_samples::FACTS,
    &misalignment::FACTS,
    &time_base_drift::FACTS,
    &linear_parameters::FACTS,
];
/// The verdict of a case that the program does not take, and those that are alarms by themselves.
const REFUSED: &str = "refused";
const OPEN: &str = "undecidable";
const REFIT: &str = "refit";
/// The given model that is the machine's own.
pub(super) const EXACT: &str = "exact";
/// How the remark on a plant begins that was cleared of a curve: no more of it is handed over.
const OF_A_CURVE: &str = "the search set out from a plant fitted together with a curve";
/// What is told of a case without repeats.
pub(super) const NO_REPEATS: &str = "controller";
/// The model whose fit came to nothing.
pub(super) const LOST: &str = "lost";

/// What a diagnosis said, with all that may be an alarm.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Said {
    /// Name.
    pub id: String,
    /// Kind of the machine.
    pub kind: String,
    /// The given model: exact, fitted to records under noise, lost in that fit, or off.
    pub model: String,
    /// What was told beside the plant.
    pub told: String,
    /// Verdict; `refused` where the program ended with an error.
    pub verdict: String,
    /// Effects, each with its sentence.
    pub findings: Vec<[String; 2]>,
    /// What is said of a curve.
    pub curve: Option<String>,
    /// Whether samples are said to be at fault.
    pub faults: bool,
    /// Records that were set aside for a push.
    pub pushed: Vec<String>,
    /// Lines that were taken out of the records (Hz).
    pub lines_hz: Vec<f64>,
    /// The law that the plant was cleared of before the search.
    pub cleared: Option<String>,
    /// Remarks.
    pub remarks: Vec<String>,
}

impl Said {
    /// What came of a case: its name, kind, model and what was told.
    pub fn of([id, kind, model, told]: [&str; 4], made: Result<Diagnosed, DiagnoseError>) -> Said {
        let bare = Said {
            id: id.into(),
            kind: kind.into(),
            model: model.into(),
            told: told.into(),
            verdict: REFUSED.into(),
            findings: vec![],
            curve: None,
            faults: false,
            pushed: vec![],
            lines_hz: vec![],
            cleared: None,
            remarks: vec![],
        };
        let d = match made {
            Ok(d) => d,
            Err(e) => return Said { remarks: vec![e.to_string()], ..bare },
        };
        let verdict = serde_json::to_value(d.diagnosis.verdict).unwrap_or_default();
        Said {
            verdict: verdict.as_str().unwrap_or_default().into(),
            findings: d.diagnosis.findings.into_iter().map(|f| [f.family.join(" or "), f.says]).collect(),
            curve: d.diagnosis.free_form.map(|c| format!("{}: {}", c.port, c.says)),
            faults: !d.diagnosis.sample_faults.is_empty(),
            pushed: d.data.runs.iter().filter(|r| r.shocked).map(|r| r.name.clone()).collect(),
            lines_hz: d.data.lines.iter().map(|l| l.hz).collect(),
            cleared: d.data.foretold.map(|c| c.effect().facts().name.into()),
            remarks: d.diagnosis.remarks,
            ..bare
        }
    }

    /// What was an alarm, with what was said.
    pub fn alarms(&self) -> BTreeMap<Consequence, String> {
        let remark = |of: &dyn Fn(&str) -> bool| self.remarks.iter().find(|r| of(r)).cloned();
        let findings = self.findings.iter().map(|[name, says]| (of_name(name), format!("{name}: {says}")));
        let listed = |what: &str, all: Vec<String>| (!all.is_empty()).then(|| format!("{what} {}", all.join(", ")));
        let lines = self.lines_hz.iter().map(|hz| format!("{hz:.4}")).collect();
        let torque = format!("({})", broadband_disturbance::FACTS.name);
        let verdict = |v: &str| (self.verdict == v).then(|| self.remarks.join("; "));
        let others = [
            (Consequence::Refusal, verdict(REFUSED)),
            (Consequence::Log, self.faults.then(|| "samples at fault".to_owned())),
            (Consequence::Push, listed("set aside:", self.pushed.clone())),
            (Consequence::Line, listed("taken out (Hz):", lines)),
            (Consequence::Noise, remark(&|r| r.ends_with(&torque))),
            (Consequence::Cleared, self.cleared.clone().or_else(|| remark(&|r| r.starts_with(OF_A_CURVE)))),
            (Consequence::Refit, verdict(REFIT).filter(|_| self.model == EXACT)),
            (Consequence::Curve, self.curve.clone()),
            (Consequence::Open, verdict(OPEN)),
        ];
        let others = others.into_iter().filter_map(|(what, said)| said.map(|said| (what, said)));
        let mut all: BTreeMap<Consequence, String> = BTreeMap::new();
        for (what, said) in findings.chain(others) {
            let before = all.remove(&what).map_or(String::new(), |b| b + "; ");
            all.insert(what, before + &said);
        }
        all
    }
}

/// What the finding of a name, or of a family that begins with it, is.
fn of_name(family: &str) -> Consequence {
    let name = family.split(" or ").next().unwrap_or(family);
    let is = |all: &[&Facts]| all.iter().any(|f| f.name == name);
    match name {
        n if n == unexplained::FACTS.name => Consequence::Nameless,
        n if n == shock::FACTS.name => Consequence::Push,
        _ if is(&LINES) => Consequence::Line,
        _ if is(&NOISE) => Consequence::Noise,
        _ if is(&LOGS) => Consequence::Log,
        _ => Consequence::Law,
    }
}
