//! Step and load-step responses, before and after, against what the spec asks of a step.
//!
//! In: positions over time. Out: a [`Figure`] of two panels. Convention: one unit of reference, one unit of command at the plant's input.
//! Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Region, RuleLine, Series};

/// What a loop answers to a step of its reference and to one of load.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResponses {
    /// Instants of the controller's samples from the step on (s).
    pub time_s: Vec<f64>,
    /// Position after one position_unit of reference (position_unit).
    pub reference: Vec<f64>,
    /// Position after one command_unit at the plant's input (position_unit).
    pub load: Vec<f64>,
}

/// What is asked of the step of the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLimits {
    /// Largest overshoot (%).
    pub overshoot_percent: Option<f64>,
    /// Latest time at which the position stays within 2 % (s).
    pub settling_s: Option<f64>,
}

/// A curve behind the first is shown for so many times its length.
const LONGER: f64 = 2.0;

/// The figure; curves are named, drawn in order, the first one in front.
pub fn steps(
    curves: &[(&str, &StepResponses)],
    limits: StepLimits,
    [position_unit, command_unit]: [&str; 2],
) -> Result<Figure, ReportError> {
    let time = || Axis::linear("Time", "ms");
    let mut of_reference = Panel::new(time(), Axis::linear("Step of the reference", position_unit));
    let mut of_load = Panel::new(time(), Axis::linear("Step of the load", position_unit));
    if let Some(percent) = limits.overshoot_percent {
        let top = 1.0 + percent / 100.0;
        of_reference.marks.push(RuleLine::horizontal(top, &format!("overshoot at most {percent} %"), Ink::Limit));
    }
    if let Some(s) = limits.settling_s {
        of_reference.marks.push(RuleLine::vertical(1e3 * s, &format!("settled to 2 % by {} ms", 1e3 * s), Ink::Limit));
        of_reference.marks.push(Region::of_y(0.98, 1.02, "", Ink::Muted));
    }
    // A slow loop behind a quick one would press it against the axis.
    let end = curves.first().and_then(|(_, s)| s.time_s.last()).map_or(f64::INFINITY, |t| LONGER * t);
    for (i, (name, found)) in curves.iter().enumerate() {
        let shown = found.time_s.partition_point(|t| *t <= end);
        let ms: Vec<f64> = found.time_s[..shown].iter().map(|t| 1e3 * t).collect();
        let ink = if i == 0 { Ink::Data(0) } else { Ink::Muted };
        let kind = if i == 0 { Kind::Solid } else { Kind::Dashed };
        of_reference.marks.push(Series::new(name, ink, kind.clone(), &ms, &found.reference[..shown])?.into());
        of_load.marks.push(Series::new(name, ink, kind, &ms, &found.load[..shown])?.into());
    }
    Ok(Figure {
        title: "Steps".into(),
        caption: format!(
            "Above one {position_unit} of reference, below one {command_unit} of load at the plant's input, from rest; linear loop, without output limit and feed-forward."
        ),
        share_x: true,
        panels: vec![of_reference, of_load],
    })
}
