//! What the noise itself tells: a coarse count of the encoder, noise that grows with the speed, torque without a pattern, an encoder louder than
//! it should be.
//!
//! In: the diagnosis data's levels, what repeats differ by, the levels that a sound machine shows where they are given. Out: findings.

use super::finding::{Estimate, Finding, FitFigures};
use super::naming::everywhere;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::noise::torque_noise::TorqueNoise;
use crate::diagnose::rules::{NOISE_DEPARTED, NOISE_LARGER, NOISE_SHARED, NOISE_SLOPE, NOISE_WITH_SPEED};
use crate::physics::{Facts, broadband_disturbance, encoder_noise, jitter, quantisation};
use crate::recording::NominalNoise;

/// Least error of a step, as a share of it: no scale is graduated better.
const GRADUATION: f64 = 1e-4;
/// Error of a level of torque noise that is no better known than its spectrum's shape.
const SHAPE: f64 = 0.05;

/// Findings of the noise; `left` is what the best model leaves on the fit records.
pub(in crate::diagnose) fn noise_findings(
    data: &DiagnosisData,
    torque_noise: Option<&TorqueNoise>,
    nominal: &NominalNoise,
    left: FitFigures,
) -> Vec<Finding> {
    let mut all: Vec<Finding> = counted(data).into_iter().collect();
    let larger = left.rms_after.powi(2) > NOISE_LARGER * data.levels.sensor_rms.powi(2);
    let blown = torque_noise.filter(|u| match nominal.windage_rms {
        Some(level) => u.rms_command > NOISE_DEPARTED * level,
        None => larger,
    });
    all.extend(blown.map(|u| wind(data, u)));
    all.extend(nominal.encoder_rms.and_then(|level| loud(data, level)));
    if all.is_empty() {
        all.extend(faster(data));
    }
    all
}

/// The encoder's count, where it makes a part of the noise that is worth a word.
fn counted(data: &DiagnosisData) -> Option<Finding> {
    let grid = data.grid.filter(|_| data.coarse())?;
    let off = grid.off.max(GRADUATION * grid.step);
    let unit = data.form.given.position_unit.clone();
    let step = Estimate { value: grid.step, low: grid.step - off, high: grid.step + off, unit };
    Some(statistic(&quantisation::FACTS, vec![("step", step)], 1e-300, &fitted(data)))
}

/// Torque without a pattern, with level and corner.
fn wind(data: &DiagnosisData, u: &TorqueNoise) -> Finding {
    let unit = data.form.given.command_unit.clone();
    let off = 1.96 * u.spread.hypot(SHAPE) * u.rms_command;
    let level = Estimate { value: u.rms_command, low: u.rms_command - off, high: u.rms_command + off, unit };
    let [low, high] = u.corners_hz;
    let corner = Estimate { value: u.corner_hz, low, high, unit: "Hz".into() };
    let p_value = (-0.5 * u.ahead).exp().max(1e-300);
    let mut f = statistic(
        &broadband_disturbance::FACTS,
        vec![("rms_command", level), ("corner_hz", corner)],
        p_value,
        &fitted(data),
    );
    f.says = format!("{} It is the larger part of what the simulation leaves.", f.says);
    f
}

/// An encoder whose noise is above the stated one.
fn loud(data: &DiagnosisData, stated: f64) -> Option<Finding> {
    let level = data.levels.sensor_rms;
    if !data.levels.from_repeats || level < NOISE_DEPARTED * stated {
        return None;
    }
    let n: usize = data.repeats.iter().map(|r| r.1.len()).sum();
    let off = 1.96 * level / (2.0 * n as f64).sqrt();
    let unit = data.form.given.position_unit.clone();
    let rms = Estimate { value: level, low: level - off, high: level + off, unit };
    let gain = n as f64 * ((level / stated).powi(2) - 1.0 - 2.0 * (level / stated).ln());
    let mut f =
        statistic(&encoder_noise::FACTS, vec![("rms", rms)], log_tail(gain, 1).exp().max(1e-300), &fitted(data));
    f.says = format!("{} {:.2} times the stated level.", f.says.trim_end_matches('.').to_owned() + ":", level / stated);
    Some(f)
}

fn fitted(data: &DiagnosisData) -> Vec<&Run> {
    data.fit_runs.iter().map(|&r| &data.runs[r]).collect()
}

/// Noise that grows with the speed: a clock that trembles, or an encoder that does.
fn faster(data: &DiagnosisData) -> Option<Finding> {
    // Squares of the whitened repeats, and products of neighbours, against the square of the speed.
    let (mut n, mut sx, mut sy, mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut sz, mut sxz) = (0.0, 0.0);
    for (run, series) in &data.repeats {
        let Some(segment) = data.stack.segments.iter().position(|s| s.runs.contains(run)) else { continue };
        let mut last = 0.0;
        for (e, m) in series.iter().zip(&data.trajectories[segment].samples) {
            let (x, y, z) = ((m.v / data.scene.speed).powi(2), e * e, e * last);
            last = *e;
            sz += z;
            sxz += x * z;
            n += 1.0;
            sx += x;
            sy += y;
            sxx += x * x;
            sxy += x * y;
            syy += y * y;
        }
    }
    if n < 100.0 {
        return None;
    }
    let spread = sxx - sx * sx / n;
    let slope = (sxy - sx * sy / n) / spread;
    let left = (syy - sy * sy / n - slope * (sxy - sx * sy / n)) / n;
    let sigma = (left / spread).sqrt();
    let floor = (sy - slope * sx) / n;
    // Seven standard errors, and at the highest speed clearly more than at rest.
    if !(slope > NOISE_SLOPE * sigma && slope > NOISE_WITH_SPEED * floor) {
        return None;
    }
    let seconds = (slope * data.levels.sensor_rms.powi(2)).sqrt() / data.scene.speed;
    // Each reading scatters on its own; what neighbours share is a motion: a limit or a gap answers the noise as the motion has it.
    if (sxz - sx * sz / n) / spread > NOISE_SHARED * slope {
        return None;
    }
    let z = slope / sigma;
    // Half the slope's relative error, the value being its root.
    let off = 0.5 * 1.96 * seconds / z;
    let rms = Estimate { value: seconds, low: seconds - off, high: seconds + off, unit: "s".into() };
    let p_value = log_tail(z * z, 1).exp().max(1e-300);
    let mut f = statistic(&jitter::FACTS, vec![("rms_s", rms)], p_value, &fitted(data));
    f.family.push(encoder_noise::FACTS.name.into());
    Some(f)
}

fn statistic(facts: &Facts, parameters: Vec<(&str, Estimate)>, p_value: f64, runs: &[&Run]) -> Finding {
    let &Facts { name, says, port, .. } = facts;
    Finding {
        effect: name.into(),
        family: vec![name.into()],
        port,
        p_value,
        says: format!("{says}."),
        parameters: parameters.into_iter().map(|(n, e)| (n.to_owned(), e)).collect(),
        place: everywhere(runs),
    }
}
