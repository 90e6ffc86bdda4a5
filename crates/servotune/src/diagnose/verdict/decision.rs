//! The verdict: a table of rows, of which the first that holds decides.
//!
//! In: what the steps before found, as [`Facts`]. Out: a [`Judgement`]. Nothing is changed in place: evidence is gathered once, and the row that
//! decides gives verdict, findings and remark. Spec: `specs/mismatch.md`; thresholds: `specs/rules.md`.

use super::facts::Facts;
use super::finding::{Finding, Verdict};
use super::held_out::{astray, unseen};
use super::judgement::Judgement;
use super::line_finding::{line_findings, same_line, unsteady};
use super::linear_change::LinearChange;
use super::naming::unexplained;
use super::search_findings::SearchFindings;
use crate::diagnose::rules::{ASTRAY_SIGMA, Answer, GIVEN_FAR, asked};
use crate::physics::Port;

/// What a verdict is decided from.
struct Evidence<'a> {
    facts: &'a Facts<'a>,
    search: SearchFindings,
    /// Frequencies (Hz) of lines that are bands of noise or ring, where nothing else was found.
    unsteady: Vec<f64>,
    linear: LinearChange,
    /// Whether the given plant is far from the records though no refit is offered.
    given_far: Answer,
    /// What acts on a record that was not used, and on none that was.
    astray: Option<Finding>,
    /// What has a name, in the order in which it was looked for; where something has none, the noise alone.
    names: Vec<Finding>,
    /// Whether these records leave open which of several the first of them is.
    open: bool,
}

/// A row of the table.
struct Row {
    /// When it decides.
    holds: fn(&Evidence) -> Answer,
    verdict: Verdict,
    findings: fn(&Evidence) -> Vec<Finding>,
    remark: fn(&Evidence) -> Option<String>,
}

impl Row {
    /// A row without a remark.
    const fn of(holds: fn(&Evidence) -> Answer, verdict: Verdict, findings: fn(&Evidence) -> Vec<Finding>) -> Row {
        Row { holds, verdict, findings, remark: |_| None }
    }
}

/// All rows. What has no name is given to the wind where the linear refit comes down to its noise.
const TABLE: [Row; 13] = [
    // The log is at fault, and no model explains a log.
    Row::of(|e| e.facts.log_fault().is_some().into(), Verdict::DataFault, |e| list(e.facts.log_fault())),
    // The log's clock explains by one number what all linear numbers do.
    Row::of(|e| e.linear.clock().is_some().into(), Verdict::DataFault, |e| list(e.linear.clock())),
    // The search left something that may not be named.
    Row::of(
        |e| unless_wind(e.search.nameless.is_some().into(), e),
        Verdict::LocatedUnexplained,
        |e| e.nameless(e.search.nameless.unwrap_or(0.0)),
    ),
    // There are lines and nothing else, and they are no hum.
    Row::of(
        |e| unless_wind((!e.unsteady.is_empty()).into(), e),
        Verdict::LocatedUnexplained,
        |e| vec![unsteady(e.facts.data, &e.unsteady)],
    ),
    // The given plant is far from the records, and no refit is offered.
    Row::of(|e| unless_wind(e.given_far.clone(), e), Verdict::LocatedUnexplained, |e| e.nameless(0.0)),
    // Nothing was found, and yet a record that was not used is far off.
    Row::of(
        |e| asked!(None, ASTRAY_SIGMA: e.astray.is_some()),
        Verdict::LocatedUnexplained,
        |e| list(e.astray.as_ref()),
    ),
    // In closed loop, where nothing drifts, several times what repeats differ by is left: whatever was named, something else acts.
    Row {
        holds: |e| Answer::from(e.facts.data.levels.from_repeats) & e.facts.loop_left(e.facts.figures()),
        verdict: Verdict::LocatedUnexplained,
        findings: |e| e.nameless(e.facts.figures().explained_share.clamp(0.0, 1.0)),
        remark: |e| Some(e.said_left()),
    },
    // Nothing was found; what the refit leaves beyond the sensor's white noise may be noise of torque or missing physics, and no repeat tells.
    Row {
        holds: |e| Answer::from(e.names.is_empty()) & e.facts.coloured_rest(),
        verdict: Verdict::Undecidable,
        findings: |_| Vec::new(),
        remark: |_| {
            Some("no record was repeated: the error that the refit leaves is coloured, and cannot be told from noise of torque".into())
        },
    },
    // In open loop what was found hardly changes the simulation, which is several times the noise off: something else acts.
    Row {
        holds: |e| {
            Answer::from(e.names.iter().any(|f| !e.facts.noise.iter().any(|n| n.effect == f.effect)))
                & e.facts.hardly_shown()
        },
        verdict: Verdict::LocatedUnexplained,
        findings: |e| e.nameless(e.facts.figures().explained_share.clamp(0.0, 1.0)),
        remark: |e| Some(e.said_left()),
    },
    // What was found may be one of several.
    Row::of(|e| e.open.into(), Verdict::Family, |e| e.names.clone()),
    // What was found has a name.
    Row::of(|e| (!e.names.is_empty()).into(), Verdict::Named, |e| e.names.clone()),
    // Nothing was found, but linear numbers were off, or further inputs move the position.
    Row::of(
        |e| (e.facts.coupled || e.linear.is_refit() && e.facts.reported.refits).into(),
        Verdict::Refit,
        |_| Vec::new(),
    ),
    // Nothing was found.
    Row::of(|_| true.into(), Verdict::NoMismatch, |_| Vec::new()),
];

/// The verdict on what was found.
pub(in crate::diagnose) fn decide(facts: &Facts) -> Judgement {
    let evidence = Evidence::of(facts);
    let mut consulted = evidence.search.consulted.clone();
    let decides = |row: &&Row| {
        let answer = (row.holds)(&evidence);
        consulted.extend(answer.consulted);
        answer.yes
    };
    // The last row always holds.
    let row = TABLE.iter().find(decides).unwrap_or(&TABLE[TABLE.len() - 1]);
    let linear = evidence.linear.remark();
    let remarks = evidence.search.remarks.iter().cloned().chain(linear).chain((row.remark)(&evidence)).collect();
    Judgement { verdict: row.verdict, findings: (row.findings)(&evidence), remarks, consulted }
}

fn list(finding: Option<&Finding>) -> Vec<Finding> {
    finding.into_iter().cloned().collect()
}

fn unless_wind(answer: Answer, e: &Evidence) -> Answer {
    answer & !e.facts.blown()
}

fn is_family(finding: &Finding) -> bool {
    finding.family.len() > 1
}

impl<'a> Evidence<'a> {
    /// The evidence in the order in which it is looked for. Nothing more is asked of a log at fault; the linear numbers are asked where nothing is
    /// without a name, single records where nothing was found.
    fn of(facts: &'a Facts<'a>) -> Evidence<'a> {
        let search = SearchFindings::of(facts);
        let ends = facts.log_fault().is_some() || search.nameless.is_some();
        let (lines, bands) = if ends { Default::default() } else { line_findings(facts.data, facts.selection) };
        let found = acting(facts, &search, lines);
        let unsteady = if found.is_empty() { bands } else { Vec::new() };
        let linear = match ends || !unsteady.is_empty() {
            true => LinearChange::NotAsked,
            false => LinearChange::of(facts, found.is_empty()),
        };
        let found = [found, list(linear.finding())].concat();
        let given_far = given_far(facts, &linear, &found);
        let nameless = search.nameless.is_some() || !unsteady.is_empty() || given_far.yes;
        let names = if nameless { facts.noise.clone() } else { with_noise(facts, found) };
        // Of several laws any may be open, of all else what was found first.
        let laws = !nameless && facts.log_checks.finding.is_none() && !search.named.is_empty();
        let open = if laws { search.named.iter().any(is_family) } else { names.first().is_some_and(is_family) };
        let silent = !ends && !nameless && names.is_empty() && linear.clock().is_none();
        let astray = (silent && !facts.given_stands()).then(|| astray(facts.data, facts.held_out)).flatten();
        let astray = astray.and_then(|h| unseen(facts.data, facts.selection, h));
        Evidence { facts, search, unsteady, linear, given_far, astray, names, open }
    }

    /// The finding without a name, of which laws explain a share.
    fn nameless(&self, explained: f64) -> Vec<Finding> {
        let simulated = self.facts.reported.withdrawn.is_none();
        vec![unexplained(self.facts.data, self.facts.selection, simulated.then_some(explained))]
    }

    fn said_left(&self) -> String {
        let f = self.facts.figures();
        let names: Vec<&str> = self.names.iter().map(|f| f.effect.as_str()).collect();
        let beside = if names.is_empty() { String::new() } else { format!(" beside {}", names.join(", ")) };
        let times = f.rms_after / f.noise_floor;
        format!("{times:.1} times the noise stay in the simulation{beside}: something else acts")
    }
}

/// What acts by name: another controller, what the search found, pushes and lines; a hum that the search found too is one.
fn acting(facts: &Facts, search: &SearchFindings, lines: Vec<Finding>) -> Vec<Finding> {
    let before = facts.log_checks.finding.iter().chain(&search.named).cloned().collect();
    facts.shocks.iter().cloned().chain(lines).fold(before, |mut all: Vec<Finding>, f| {
        if !all.iter().any(|g| same_line(g, &f)) {
            all.push(f);
        }
        all
    })
}

/// Whether the given plant, which stands where no refit is offered, is far from the records.
fn given_far(facts: &Facts, linear: &LinearChange, found: &[Finding]) -> Answer {
    let f = facts.fit.fit;
    Answer::from(found.is_empty() && linear.is_refit() && !facts.reported.refits)
        & asked!(f.rms_refit_linear / f.noise_floor, GIVEN_FAR: f.rms_refit_linear > GIVEN_FAR * f.noise_floor)
}

/// With what the noise tells; not where nothing else was found and far more is left than the encoder's noise and count: those are no reason for
/// what is a hundred times as large.
fn with_noise(facts: &Facts, found: Vec<Finding>) -> Vec<Finding> {
    let rounding = facts.data.grid.map_or(0.0, |g| g.step / 12f64.sqrt());
    let wind = facts.noise.iter().any(|f| f.port == Port::Torque);
    let beyond = !wind && facts.coloured(facts.data.levels.sensor_rms.hypot(rounding)).yes;
    if found.is_empty() && beyond { found } else { [found, facts.noise.clone()].concat() }
}
