//! What the logs of a case say before any model is fitted: sound, slipped, in other units, or made by another controller.

use super::bench::scene;
use super::finding::Finding;
use super::hygiene::{Replay, SampleFault, replay_records, sample_faults, slips};
use super::judge::{Judged, error};
use super::linear::{Sampled, free_motions};
use super::run::Run;
use super::stack::Basis;
use crate::controller::Law;
use crate::lti::{LtiError, Plant};
use crate::numeric::least_squares::dot;
use crate::recording::Case;

/// What the logs are worth.
pub(super) struct Hygiene {
    pub replay: Option<Replay>,
    pub faults: Vec<SampleFault>,
    /// Verdict on the logs, where it is not "sound".
    pub finding: Option<Finding>,
    /// Whether the controller's law holds, so that the loop can be closed in simulation.
    pub closed: bool,
}

/// Deviation of a factor from 1 above which a position counts as logged in other units; a factor of the command alone is the
/// controller's.
const UNIT: f64 = 0.02;

/// What the logs say; positions that turn out to be shifted are moved back.
pub(super) fn check(
    case: &Case,
    runs: &mut [Run],
    given: &Plant,
    law: Option<&Law>,
    sample_time_s: f64,
) -> Result<Hygiene, LtiError> {
    let mut faults: Vec<SampleFault> = case
        .records
        .iter()
        .zip(runs.iter())
        .flat_map(|((_, record), run)| sample_faults(run, &record.gaps, sample_time_s))
        .collect();
    let mut hygiene = Hygiene { replay: None, faults: Vec::new(), finding: None, closed: false };
    if let Some(law) = law {
        let smooth = smooth(given, runs, sample_time_s)?;
        let all: Vec<&Run> = runs.iter().collect();
        hygiene.closed = all.iter().all(|r| r.reference.is_some());
        hygiene.replay = replay_records(law, &all, &smooth);
    }
    if let (Some(r), Some(law)) = (&hygiene.replay, law)
        && !r.failing.is_empty()
    {
        let failing: Vec<usize> = (0..runs.len()).filter(|&i| r.failing.contains(&runs[i].name)).collect();
        let slips: Vec<SampleFault> = failing.iter().flat_map(|&i| slips(law, &runs[i], sample_time_s)).collect();
        let named: Vec<&Run> = failing.iter().map(|&i| &runs[i]).collect();
        let helps = |e: f64| e < 0.3 * r.error;
        if !slips.is_empty() {
            faults.extend(slips);
            hygiene.closed = false;
        } else if faults.is_empty() {
            if helps(r.error_shifted) && r.shift_samples.abs() > 0.05 && r.error_shifted <= 1.1 * r.error_scaled {
                hygiene.finding = Some(super::log_finding::misalignment(r, sample_time_s, &named));
                let by = r.shift_samples;
                failing.iter().for_each(|&i| shift(&mut runs[i], by));
            } else if helps(r.error_scaled) && (r.position_factor - 1.0).abs() > UNIT {
                hygiene.finding = Some(super::log_finding::scale(r, &named));
                hygiene.closed = false;
            } else {
                hygiene.finding = Some(super::log_finding::controller_mismatch(r, &named));
                hygiene.closed = false;
            }
        }
    }
    if hygiene.replay.is_none() {
        let follows = follows(given, runs, sample_time_s)?;
        if !follows.possible() {
            let all: Vec<&Run> = runs.iter().collect();
            hygiene.finding = Some(super::log_finding::unit(follows.factor, &all));
        } else if let Some(early) = early(given, runs, sample_time_s, &follows)? {
            let all: Vec<&Run> = runs.iter().collect();
            hygiene.finding = Some(super::log_finding::early(-early, sample_time_s, &all));
            runs.iter_mut().for_each(|r| shift(r, -early));
        }
    }
    if !faults.is_empty() {
        hygiene.finding = Some(super::log_finding::samples(&faults));
        hygiene.closed = hygiene.closed && hygiene.replay.as_ref().is_some_and(|r| r.failing.is_empty());
    }
    hygiene.faults = faults;
    Ok(hygiene)
}

/// Factor of the gain beyond which no machine differs from its model, but its log does.
const OTHER_UNIT: f64 = 8.0;
/// Share of the position's energy that the scaled model must explain.
const ALIKE: f64 = 0.8;

/// How the position follows the given plant's answer to the recorded command.
struct Follows {
    /// Times what.
    factor: f64,
    /// Energy of the position that it leaves, and all of it.
    left: f64,
    whole: f64,
}

impl Follows {
    /// Whether a machine of this model can do so: where the position follows the command at all, not in other units or signs.
    fn possible(&self) -> bool {
        let alike = self.left < (1.0 - ALIKE) * self.whole;
        !alike || (self.factor > OTHER_UNIT.recip() && self.factor < OTHER_UNIT)
    }
}

fn follows(given: &Plant, runs: &[Run], sample_time_s: f64) -> Result<Follows, LtiError> {
    let sampled = Sampled::of(given, sample_time_s)?;
    let (mut ss, mut sy, mut yy) = (0.0, 0.0, 0.0);
    for run in runs {
        let mut basis = Basis::default();
        free_motions(&given.body, sample_time_s, run.len()).into_iter().for_each(|c| basis.add_local(0, c));
        let input: Vec<f64> = run.input.iter().map(|u| u - run.before).collect();
        let mut s = vec![0.0; run.len()];
        sampled.delayed.add_response(&input, &mut s);
        let mut y = run.position.clone();
        [&mut s, &mut y].into_iter().for_each(|x| basis.project(x));
        (ss, sy, yy) = (ss + dot(&s, &s), sy + dot(&s, &y), yy + dot(&y, &y));
    }
    Ok(Follows { factor: sy / ss, left: (yy - sy * sy / ss).max(0.0), whole: yy })
}

/// Most samples by which a position is taken to be early, and the share of the error that moving it back must take.
const EARLIEST: usize = 20;
const MOVED_BACK: f64 = 0.3;

/// By how many samples the position comes before the command that made it can have acted: no machine does that, a log that slipped does.
/// None where moving it back does not help far more than all of the model's own delay.
fn early(given: &Plant, runs: &[Run], sample_time_s: f64, unmoved: &Follows) -> Result<Option<f64>, LtiError> {
    let left = |by: f64| -> Result<f64, LtiError> {
        let mut moved = runs.to_vec();
        moved.iter_mut().for_each(|r| shift(r, -by));
        Ok(follows(given, &moved, sample_time_s)?.left)
    };
    let mut best = (unmoved.left, 0.0);
    for by in 1..=EARLIEST {
        let now = left(by as f64)?;
        if now > best.0 {
            break;
        }
        best = (now, by as f64);
    }
    let own = given.delay_s / sample_time_s;
    // Up to the model's own delay it may be a machine that is faster than its model.
    Ok((best.0 < MOVED_BACK * unmoved.left && best.1 > own + 0.5).then_some(best.1))
}

/// The given plant's answer to each record's command, its free motions fitted to the position: the motion without the noise.
fn smooth(given: &Plant, runs: &[Run], sample_time_s: f64) -> Result<Vec<Vec<f64>>, LtiError> {
    let scene = scene(given, runs, sample_time_s, None);
    let model = Judged { plant: given, effects: Vec::new(), own: Vec::new(), lines: &[], fit: None, scene: &scene };
    let smooth = |run: &Run| Ok(run.position.iter().zip(error(&model, run, None)?).map(|(y, e)| y - e).collect());
    runs.iter().map(smooth).collect()
}

/// Moves the position log against the others by a real number of samples.
fn shift(run: &mut Run, samples: f64) {
    let y = run.position.clone();
    let last = y.len() - 1;
    for (k, p) in run.position.iter_mut().enumerate() {
        let at = (k as f64 + samples).clamp(0.0, last as f64);
        let (i, f) = (at.floor() as usize, at.fract());
        *p = if f == 0.0 { y[i] } else { y[i] + f * (y[(i + 1).min(last)] - y[i]) };
    }
}
