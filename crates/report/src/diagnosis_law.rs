//! The laws that were found, drawn along the recorded motion, and the torque that no law explains.
//!
//! In: effects with their numbers, trajectories. Out: figures. Convention: torques in command units, positive in the direction of
//! motion; each law on the record where it is strongest. Spec: `specs/mismatch.md`.

use super::ReportError;
use super::diagnosis_shown::{Shown, short, words};
use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Scale, Series};
use super::time::{CurveKind, TimeCurve, TimePanel, time};
use servotune::diagnose::{SelectedEffect, Trajectory};
use servotune::lti::{Body, Plant};
use servotune::physics::{AnyLaw, COLUMNS, Entry, LawSetting, MotionScene, Sample, ShownOver, describing};
use std::f64::consts::TAU;

/// Points of a curve that is no function of time and so is not thinned when drawn.
const POINTS: usize = 5000;
/// Share of the largest command below which a torque over the command says nothing.
const ENOUGH: f64 = 0.15;

/// What an effect adds along a trajectory, strengths applied, at its place of entry.
pub(super) fn added(law: &AnyLaw, strengths: &[f64], scene: &MotionScene, motion: &Trajectory) -> Vec<f64> {
    let facts = law.facts();
    let samples = &motion.samples;
    let mut law = law.in_motion(scene);
    let mut out = [0.0; COLUMNS];
    let mut step = |from: &Sample, to: &Sample| {
        law.columns(from, to, &mut out[..facts.columns]);
        law.commit(from, to);
        strengths.iter().zip(&out).map(|(s, c)| s * c).sum()
    };
    // A torque belongs to the interval behind the sample, everything else to the sample itself.
    let last = samples.len().saturating_sub(1);
    let ends = |k: usize| if facts.entry == Entry::Torque { (k, (k + 1).min(last)) } else { (k.saturating_sub(1), k) };
    (0..samples.len()).map(|k| step(&samples[ends(k).0], &samples[ends(k).1])).collect()
}

/// Strengths of a chosen effect in one segment.
pub(super) fn own(c: &SelectedEffect, segment: usize) -> &[f64] {
    if c.setting.facts().per_record {
        c.setting.strengths.get(segment * c.setting.facts().columns..).unwrap_or(&[])
    } else {
        &c.setting.strengths
    }
}

/// A figure for each effect in the model.
pub(super) fn law_figures(s: &Shown) -> Result<Vec<Figure>, ReportError> {
    let data = &s.made.data;
    let mut figures = Vec::new();
    for c in &s.made.selection.model.chosen {
        let every: Vec<Vec<f64>> = data
            .trajectories
            .iter()
            .enumerate()
            .map(|(i, motion)| added(&c.setting.law, own(c, i), &data.scene, motion))
            .collect();
        let energy = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64;
        let best = (0..every.len()).max_by(|&a, &b| energy(&every[a]).total_cmp(&energy(&every[b])));
        if let Some(i) = best {
            figures.push(law_figure(s, c, i, &every[i])?);
        }
    }
    Ok(figures)
}

fn law_figure(s: &Shown, c: &SelectedEffect, segment: usize, value: &[f64]) -> Result<Figure, ReportError> {
    let (data, facts) = (&s.made.data, c.setting.facts());
    let motion = &data.trajectories[segment].samples;
    let way = c.effect().shown_over();
    let largest = motion.iter().fold(0.0f64, |m, k| m.max(k.i.abs()));
    let (quantity, unit) = match (facts.entry, way) {
        (_, ShownOver::FactorOverPosition | ShownOver::FactorOverTime) => ("Torque per command", "1"),
        (_, ShownOver::Input) => ("Output of the amplifier", s.command),
        (Entry::Torque, _) => ("Torque added", s.command),
        (Entry::Command, _) => ("Command added", s.command),
        (Entry::Position, _) => ("Position added", s.position),
    };
    let (across, across_unit) = match way {
        ShownOver::Position | ShownOver::Loop | ShownOver::FactorOverPosition => ("Position", s.position.to_owned()),
        ShownOver::Velocity => ("Velocity", format!("{}/s", s.position)),
        ShownOver::Time | ShownOver::FactorOverTime => ("Time", "s".to_owned()),
        ShownOver::Input => ("Command", s.command.to_owned()),
        ShownOver::Spindle => ("Spindle angle", "deg".to_owned()),
    };
    let over_time = matches!(way, ShownOver::Time | ShownOver::FactorOverTime);
    let factor = matches!(way, ShownOver::FactorOverTime | ShownOver::FactorOverPosition);
    // Every sample over time, which is thinned when drawn; else no more than the eye can use.
    let stride = if over_time { 1 } else { motion.len().div_ceil(POINTS).max(1) };
    let place = |m: &Sample| match way {
        ShownOver::Position | ShownOver::Loop | ShownOver::FactorOverPosition => m.x,
        ShownOver::Velocity => m.v,
        ShownOver::Time | ShownOver::FactorOverTime => m.t,
        ShownOver::Input => m.u,
        ShownOver::Spindle => m.spindle_rad.rem_euclid(TAU).to_degrees(),
    };
    let points: Vec<[f64; 3]> = motion
        .iter()
        .zip(value)
        .step_by(stride)
        .filter(|(m, _)| !factor || m.i.abs() > ENOUGH * largest)
        .map(|(m, v)| {
            let y = match way {
                ShownOver::Input => m.u + v,
                _ if factor => 1.0 + v / m.i,
                _ => *v,
            };
            [place(m), y, m.t]
        })
        .collect();
    // Loops are drawn as lines, functions of one place as dots: lines would only jump to and fro.
    let memory = way == ShownOver::Loop;
    let kind = if memory || (over_time && !factor) { Kind::Solid } else { Kind::Points };
    let column = |j: usize| points.iter().map(|p| p[j]).collect::<Vec<f64>>();
    let mut panel =
        Panel::new(Axis::linear(across, &across_unit), Axis::linear(quantity, if unit == "1" { "" } else { unit }));
    panel.height = 1.2;
    if way == ShownOver::Input {
        let reach = motion.iter().fold(0.0f64, |m, k| m.max(k.u.abs()));
        panel.marks.push(
            Series::new("without the effect", Ink::Muted, Kind::Dashed, &[-reach, reach], &[-reach, reach])?.into(),
        );
    }
    let name = words(facts.name);
    panel
        .marks
        .push(Series::new(&name, Ink::Data(0), kind, &column(0), &column(1))?.along("time", "s", &column(2))?.into());
    if factor {
        panel.marks.push(RuleLine::horizontal(1.0, "model as given", Ink::Plain));
    }
    if facts.entry == Entry::Position {
        let noise = data.levels.sensor_rms;
        panel.marks.push(RuleLine::horizontal(noise, "sensor noise (rms)", Ink::Limit));
        panel.marks.push(RuleLine::horizontal(-noise, "", Ink::Limit));
    }
    let run = &data.runs[data.stack.segments[segment].runs[0]].name;
    let caption = format!("{}. Along the motion of {run}, where it is strongest.", facts.equation);
    Ok(Figure {
        title: format!("{}: {name}", if s.named() { "The law found" } else { "The nearest law" }),
        caption,
        share_x: false,
        panels: vec![panel],
    })
}

/// Acceleration per command, stiffness (1/s²) and viscous rate (1/s): x'' = b u - k x - c x'.
fn numbers(plant: &Plant) -> [f64; 3] {
    let [b, k, c] = match plant.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
            [dc_gain * w * w, w * w, 2.0 * damping_ratio * w]
        }
        Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => [acceleration_gain, 0.0, viscous_rate_per_s],
        // No diagnosis starts from one.
        Body::Rational(ref r) => [r.gain, 0.0, 0.0],
    };
    [b * plant.resonance_gain, k, c]
}

/// Natural frequency (Hz) and damping ratio of the body with its torque effects at one amplitude (position_unit): the
/// frequency at which the describing function's stiffness balances the inertia.
fn at_amplitude(plant: &Plant, effects: &[&LawSetting], scene: &MotionScene, amplitude: f64) -> Option<(f64, f64)> {
    let [b, k, c] = numbers(plant);
    let mut w = if k > 0.0 { k.sqrt() } else { TAU };
    for _ in 0..40 {
        let mut stiffness = k;
        let mut rate = c;
        for s in effects {
            // The torque -N x holds back where N is negative: x'' + c x' + (k - b Re N) x = 0, Im N/w the rate.
            let n = describing(s, scene, amplitude, w)?;
            stiffness -= b * n.re;
            rate -= b * n.im / w;
        }
        if stiffness.is_nan() || stiffness <= 0.0 {
            return None;
        }
        let next = stiffness.sqrt();
        let done = (next - w).abs() < 1e-6 * w;
        w = next;
        if done {
            return Some((w / TAU, rate / (2.0 * w)));
        }
    }
    None
}

/// Natural frequency and damping over amplitude; none where nothing that was found changes them.
pub(super) fn amplitude_figure(s: &Shown) -> Result<Option<Figure>, ReportError> {
    let (fixed, scene) = (&s.made.corrected, &s.made.data.scene);
    let effects: Vec<&LawSetting> = fixed.effects.iter().filter(|s| s.law.effect().acts_on_body()).collect();
    if !effects.iter().any(|s| s.law.effect().changes_with_amplitude()) {
        return Ok(None);
    }
    let amplitudes = servotune::physics::logarithmic(1e-3 * scene.travel, 2.0 * scene.travel, 25);
    let found: Vec<(f64, (f64, f64))> =
        amplitudes.iter().filter_map(|&a| at_amplitude(&fixed.plant, &effects, scene, a).map(|f| (a, f))).collect();
    if found.len() < 3 {
        return Ok(None);
    }
    let x: Vec<f64> = found.iter().map(|f| f.0).collect();
    let across = || Axis { scale: Scale::Log10, ..Axis::linear("Amplitude of the motion", s.position) };
    let mut panels = Vec::new();
    for (label, unit, pick) in [("Natural frequency", "Hz", 0), ("Damping ratio", "", 1)] {
        let mut panel = Panel::new(across(), Axis::linear(label, unit));
        panel.height = 0.75;
        let y: Vec<f64> = found.iter().map(|(_, (f, z))| if pick == 0 { *f } else { *z }).collect();
        panel.marks.push(Series::new(s.models()[2], Ink::Data(0), Kind::Solid, &x, &y)?.into());
        if let Body::SecondOrder { natural_frequency_rad_s: w, damping_ratio, .. } = s.made.refitted.body {
            let level = if pick == 0 { w / TAU } else { damping_ratio };
            let kind = Kind::Dashed;
            panel.marks.push(
                Series::new("linear refit", Ink::Data(1), kind, &[x[0], x[x.len() - 1]], &[level, level])?.into(),
            );
        }
        panels.push(panel);
    }
    let caption = format!(
        "Body of the corrected model in a steady swing (describing function). A linear model has one value for all; the records \
         move by up to {} {}.",
        short(scene.travel),
        s.position
    );
    let title = "Natural frequency and damping over amplitude".to_owned();
    Ok(Some(Figure { title, caption, share_x: true, panels }))
}

/// Takes the mean out: a constant torque is a record's own offset.
fn centred(mut x: Vec<f64>) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter_mut().for_each(|v| *v -= mean);
    x
}

/// Share of a record at its start that is not drawn: the smoother guesses where the motion starts, and the torque of that guess is
/// no torque of the machine.
const START: f64 = 0.03;

/// Torque beyond the linear part of the corrected model over time, beside the torque of its effects, on the record with most.
pub(super) fn unexplained_figure(s: &Shown) -> Result<Option<Figure>, ReportError> {
    let data = &s.made.data;
    // What the corrected plant carries, and what belongs to the record alone. A command acts as a torque one delay later.
    let drives = |e: Entry| matches!(e, Entry::Torque | Entry::Command);
    let settled = |mut x: Vec<f64>| x.split_off((START * x.len() as f64) as usize);
    let found = |i: usize| {
        let lasting = s.made.corrected.effects.iter().map(|x| (&x.law, &x.strengths[..]));
        let passing = s.made.selection.model.chosen.iter().filter(|c| c.setting.facts().per_record);
        let passing = passing.map(|c| (&c.setting.law, own(c, i)));
        let mut sum: Option<Vec<f64>> = None;
        for (law, strengths) in lasting.chain(passing).filter(|p| drives(p.0.facts().entry)) {
            let part = added(law, strengths, &data.scene, &data.trajectories[i]);
            match &mut sum {
                Some(sum) => sum.iter_mut().zip(part).for_each(|(f, p)| *f += p),
                None => sum = Some(part),
            }
        }
        sum
    };
    // The last smoothing was told the torque of the refitted body and of the laws: what it left is beyond both, so that the laws'
    // own torque comes on top.
    let beyond = |i: usize| {
        let mut torque = data.trajectories[i].unexplained.clone();
        if let Some(found) = found(i) {
            torque.iter_mut().zip(found).for_each(|(t, f)| *t += f);
        }
        centred(settled(torque))
    };
    let every: Vec<Vec<f64>> = (0..data.trajectories.len()).map(beyond).collect();
    let energy = |i: usize| every[i].iter().map(|v| v * v).sum::<f64>();
    let Some(i) = (0..every.len()).max_by(|&a, &b| energy(a).total_cmp(&energy(b))) else {
        return Ok(None);
    };
    let at = settled(data.trajectories[i].samples.iter().map(|m| m.t).collect());
    let found = found(i).map(|f| centred(settled(f)));
    let line = |name, value, ink| TimeCurve { name, time_s: &at, value, ink, kind: CurveKind::Line };
    let mut curves = vec![line("torque beyond the linear plant", &every[i], Ink::Muted)];
    curves.extend(found.as_ref().map(|f| line("torque of the laws in the model", f, Ink::Data(0))));
    let noise = data.levels.torque_rms;
    let limits = [(noise, "torque noise (rms)"), (-noise, "")];
    let limits: &[(f64, &str)] = if noise > 0.0 { &limits } else { &[] };
    let panel = TimePanel { quantity: "Torque", unit: s.command, curves: &curves, limits };
    let run = &data.runs[data.stack.segments[i].runs[0]].name;
    let how = "Estimated from the recorded motion by a smoother, in command units, less its mean and without the first 3 % of the \
               record, where the smoother finds its start; the linear plant is the corrected one.";
    let caption = match found {
        Some(_) => format!("{how} Where both curves agree, nothing is left to explain."),
        None => format!("{how} No torque of a law is in the model: what stands here is noise, or is not explained."),
    };
    let title = format!("Torque that the linear plant does not explain, {run}");
    time(&title, &caption, &[panel], None).map(Some)
}
