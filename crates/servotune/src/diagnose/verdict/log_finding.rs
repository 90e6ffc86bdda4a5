//! Findings about the logs themselves, from what data checks saw.

use super::finding::{Estimate, Finding, Where};
use super::naming::{everywhere, plain};
use crate::diagnose::data::checks::{Replay, SampleFault};
use crate::diagnose::data::log_filter::{LogFilter, Numerator};
use crate::diagnose::data::reading_limits::ReadingLimits;
use crate::diagnose::data::run::Run;
use crate::numeric::digits::said;
use crate::physics::{
    Facts, controller_mismatch, linear_parameters, lost_samples, misalignment, sensor_curve, sensor_lag,
};
use std::collections::BTreeMap;

/// What log checks find is exact: no chance is left.
fn fault(facts: &Facts, says: String, parameters: BTreeMap<String, Estimate>, place: Where) -> Finding {
    let effect = facts.name.to_owned();
    Finding { family: vec![effect.clone()], effect, port: facts.port, p_value: 1e-300, says, parameters, place }
}

/// The position log is shifted: the documented controller says by how much.
pub(super) fn misalignment(r: &Replay, sample_time_s: f64, runs: &[&Run]) -> Finding {
    let why = format!(
        "shifted by {:.2} samples, the documented controller gives the recorded command again",
        r.shift_samples
    );
    slipped(r.shift_samples, 0.05, sample_time_s, &why, runs)
}

/// The position comes before the command that made it.
pub(in crate::diagnose) fn early(shift_samples: f64, sample_time_s: f64, runs: &[&Run]) -> Finding {
    let why = format!(
        "the position comes {:.0} samples before the model's answer to the command, more than all of its delay",
        -shift_samples
    );
    slipped(shift_samples, 0.5, sample_time_s, &why, runs)
}

/// The position log is off by so many samples, known to `off`.
fn slipped(samples: f64, off: f64, sample_time_s: f64, why: &str, runs: &[&Run]) -> Finding {
    let shift = Estimate { value: samples, low: samples - off, high: samples + off, unit: "samples".into() };
    let parameters =
        BTreeMap::from([("samples".to_owned(), shift), ("shift_s".to_owned(), plain(samples * sample_time_s, "s"))]);
    let facts = &misalignment::FACTS;
    fault(facts, format!("In the log {}: {why}.", facts.says), parameters, everywhere(runs))
}

/// Most stretches on a limit that are told, the longest ones.
const SHOWN: usize = 12;

/// The readings end at limits; `heard` says whether the controller got no more than the log, where that is known.
pub(super) fn cut_off(
    limits: &ReadingLimits,
    heard: Option<bool>,
    runs: &[Run],
    sample_time_s: f64,
    unit: &str,
) -> Finding {
    let named = [("lowest_reading", limits.ends[0]), ("highest_reading", limits.ends[1])];
    let known: Vec<(&str, f64)> = named.iter().filter_map(|(name, v)| Some((*name, (*v)?))).collect();
    let at: Vec<String> = known.iter().map(|(_, v)| said(*v, 4)).collect();
    let who = match heard {
        Some(true) => "the controller heard no more: the sensor ends there",
        Some(false) => "the controller heard more: the log is cut off there",
        None => "sensor or log is cut off there",
    };
    let mut records: Vec<String> = limits.stretches.iter().map(|(i, _)| runs[*i].name.clone()).collect();
    records.dedup();
    // A fast motion meets a limit hundreds of times.
    let mut longest = limits.stretches.clone();
    longest.sort_by_key(|(_, [first, last])| std::cmp::Reverse(last - first));
    longest.truncate(SHOWN);
    longest.sort();
    let time_s = longest.iter().map(|(_, ends)| ends.map(|k| k as f64 * sample_time_s)).collect();
    let says = format!(
        "The positions end at {} {unit}: {} of {} readings lie there to the last digit, met and left at full speed; {who}.",
        at.join(" and "),
        limits.samples,
        limits.of
    );
    let parameters = known.iter().map(|(name, v)| ((*name).to_owned(), plain(*v, unit))).collect();
    fault(&sensor_curve::FACTS, says, parameters, Where { records, time_s, velocity_sign: "both", ..Where::default() })
}

/// The readings fold at their lowest one, and the controller heard the sign.
pub(super) fn folded(lowest: f64, runs: &[Run], unit: &str) -> Finding {
    let says = format!(
        "The positions fold at {} {unit}: they turn round there in a corner, at full speed, and nowhere else; the controller heard the sign: the log has lost it.",
        said(lowest, 4)
    );
    let parameters = [("lowest_reading".to_owned(), plain(lowest, unit))].into();
    fault(&sensor_curve::FACTS, says, parameters, everywhere(&runs.iter().collect::<Vec<_>>()))
}

/// The position was filtered behind the controller's reading, before it was logged.
pub(super) fn filtered(filter: &LogFilter, sample_time_s: f64, runs: &[&Run]) -> Finding {
    let (bandwidth, delay) = (filter.bandwidth_hz(sample_time_s), filter.delay_s(sample_time_s));
    let what = match filter.numerator {
        Numerator::Zeros(_) => "a low-pass".to_owned(),
        Numerator::Mean(n) => format!("a mean of {n} samples, a low-pass"),
    };
    let parameters = [("bandwidth_hz", bandwidth, "Hz"), ("time_constant_s", delay, "s")];
    let says = format!(
        "The log holds a filtered position: with {what} of {} Hz undone, the documented controller gives the recorded command again; it heard the position before that filter.",
        said(bandwidth, 3)
    );
    // The reference takes no such way: where it moves, it tells the two apart.
    let moves = |r: &&Run| r.reference.as_ref().is_some_and(|r| r.iter().any(|v| *v != r[0]));
    let parameters = parameters.map(|(name, v, unit)| (name.to_owned(), plain(v, unit))).into();
    let mut found = fault(&sensor_lag::FACTS, says, parameters, everywhere(runs));
    if !runs.iter().any(moves) {
        found.family.push(controller_mismatch::FACTS.name.into());
        found.says +=
            " No reference moves here: a controller without a low-pass that it is documented to have looks the same.";
    }
    found
}

/// Position or command is logged in other units, or with the other sign: the documented controller says so.
pub(in crate::diagnose) fn scale(r: &Replay, runs: &[&Run]) -> Finding {
    let sign = if r.position_factor < 0.0 { "with the sign turned round" } else { "in other units" };
    let factors = [
        ("position_factor".to_owned(), plain(r.position_factor, "1")),
        ("command_factor".to_owned(), plain(r.command_factor, "1")),
    ];
    let why = format!("the controller's command follows from the log only with a factor of {:.6}", r.position_factor);
    scaled(sign, &why, BTreeMap::from(factors), runs)
}

/// The position follows the model only with a factor that no machine of this model can have.
pub(in crate::diagnose) fn unit(factor: f64, runs: &[&Run]) -> Finding {
    let sign = if factor < 0.0 { "with the sign turned round" } else { "in other units than the model" };
    let why = format!("it follows the command as the model says, but times {factor:.6}");
    scaled(sign, &why, BTreeMap::from([("position_factor".to_owned(), plain(factor, "1"))]), runs)
}

/// The position is logged with a factor.
fn scaled(sign: &str, why: &str, parameters: BTreeMap<String, Estimate>, runs: &[&Run]) -> Finding {
    Finding {
        effect: linear_parameters::FACTS.name.into(),
        family: vec![linear_parameters::FACTS.name.into()],
        port: crate::physics::Port::Time,
        p_value: 1e-300,
        says: format!("The position is logged {sign}: {why}."),
        parameters,
        place: everywhere(runs),
    }
}

/// The command does not follow from the documented law.
pub(super) fn controller_mismatch(r: &Replay, runs: &[&Run]) -> Finding {
    let facts = &controller_mismatch::FACTS;
    let says = format!(
        "{}: replayed over the log, the documented law misses the recorded command by {:.2} % rms.",
        facts.says,
        100.0 * r.error
    );
    fault(facts, says, BTreeMap::from([("replay_error".to_owned(), plain(r.error, "1"))]), everywhere(runs))
}

/// Samples are missing, doubled or stuck.
pub(in crate::diagnose) fn samples(faults: &[SampleFault]) -> Finding {
    let out_of_step = lost_samples::FACTS.says;
    let first = &faults[0];
    let (says, what) = match (first.stuck, first.samples > 0.0) {
        (true, _) => ("the position stands still in the log while the arm moves on", "samples"),
        (false, true) => (out_of_step, "samples lost"),
        (false, false) => (out_of_step, "samples too many"),
    };
    let records: Vec<String> = faults.iter().map(|f| f.record.clone()).collect();
    let says = format!("{says}: record {} at {:.6} s, {} {what}.", first.record, first.time_s, first.samples.abs());
    let parameters = BTreeMap::from([("samples".to_owned(), plain(first.samples, "samples"))]);
    let time_s = faults.iter().map(|f| [f.time_s, f.time_s]).collect();
    fault(&lost_samples::FACTS, says, parameters, Where { records, time_s, velocity_sign: "both", ..Where::default() })
}
