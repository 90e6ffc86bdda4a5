//! A curve without a name, drawn with its band: what stands in for the law that is missing.
//!
//! In: a diagnosis that carries one. Out: a figure, and its sentences. Convention: the band is the 95 % interval at each argument; what a
//! linear plant can hold is not in the curve. A torque over position and velocity is drawn over the velocity at some of its positions.
//! Spec: `specs/mismatch.md`, "Curves without a name".

use super::ReportError;
use super::diagnosis_shown::short;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Series};
use super::page::{Block, Section};
use servotune::diagnose::{FreeFormFound, curve_title};
use servotune::lti::CurveKnot;
use servotune::numeric::spline::Spline;
use servotune::physics::CurvePort;

/// Points between the first knot and the last.
const POINTS: usize = 241;

/// The section of a curve; none where a diagnosis has none.
pub(super) fn curve_section(curve: Option<&FreeFormFound>) -> Result<Option<Section>, ReportError> {
    let Some(curve) = curve else { return Ok(None) };
    let [linear, with] = curve.left_out.map(short);
    let foretold = format!(
        "Parts of the fitted records were left out in turn: the best linear plant misses them by {linear}, the one with the curve by {with} (rms, in the \
         measure of the fit)."
    );
    let blocks = vec![Block::Prose(curve.says.clone()), Block::Figure(curve_figure(curve)?), Block::Prose(foretold)];
    Ok(Some(Section { heading: "The curve that stands in".into(), blocks }))
}

/// The curve over its argument.
pub fn curve_figure(curve: &FreeFormFound) -> Result<Figure, ReportError> {
    let knots = &curve.knots;
    if knots.iter().all(|k| k.velocity.is_some()) {
        return surface_figure(curve);
    }
    let through = |of: &dyn Fn(&CurveKnot) -> f64| {
        Spline::new(knots.iter().map(|k| k.at).collect(), knots.iter().map(of).collect())
    };
    let (first, last) = (knots[0].at, knots[knots.len() - 1].at);
    let x: Vec<f64> = (0..POINTS).map(|i| first + (last - first) * i as f64 / (POINTS - 1) as f64).collect();
    let loading = curve.argument == "loading";
    let straight = |s: &Spline, x: f64| {
        let i = s.at().partition_point(|a| *a <= x).clamp(1, s.at().len() - 1);
        let share = (x - s.at()[i - 1]) / (s.at()[i] - s.at()[i - 1]);
        s.values()[i - 1] + share * (s.values()[i] - s.values()[i - 1])
    };
    let along =
        |s: &Spline| x.iter().map(|x| if loading { straight(s, *x) } else { s.value(*x) }).collect::<Vec<f64>>();
    let value = along(&through(&|k| k.value));
    // The band's half width is drawn through the knots and never below nothing.
    let off = along(&through(&|k| 0.5 * (k.high.unwrap_or(k.value) - k.low.unwrap_or(k.value))));
    let edge = |side: f64| value.iter().zip(&off).map(|(v, o)| v + side * o.max(0.0)).collect::<Vec<f64>>();
    let port = CurvePort::ALL.into_iter().find(|p| p.names() == [curve.port, curve.argument]);
    let mut argument = if loading { "way since the first turn".to_owned() } else { curve.argument.to_owned() };
    argument[..1].make_ascii_uppercase();
    let quantity = match curve.port {
        "amplifier" => "Output of the amplifier",
        "gain" => "Torque per command",
        "sensor" => "Reading",
        _ if loading => "Torque that resists",
        _ => "Torque added",
    };
    let unit = if curve.unit == "1" { "" } else { &curve.unit };
    let mut panel = Panel::new(Axis::linear(&argument, &curve.argument_unit), Axis::linear(quantity, unit));
    panel.height = 1.2;
    let band = Kind::Band { upper: edge(1.0) };
    panel.marks.push(Series::new("95 % band", Ink::Data(0), band, &x, &edge(-1.0))?.into());
    if let Some(port) = port {
        let plain: Vec<f64> = x.iter().map(|x| port.idle(*x)).collect();
        panel.marks.push(Series::new("without it", Ink::Muted, Kind::Dashed, &x, &plain)?.into());
    }
    panel.marks.push(Series::new("estimated curve", Ink::Data(0), Kind::Solid, &x, &value)?.into());
    let (at, values): (Vec<f64>, Vec<f64>) = knots.iter().map(|k| (k.at, k.value)).unzip();
    panel.marks.push(Series::new("knots", Ink::Data(0), Kind::Points, &at, &values)?.into());
    Ok(Figure {
        title: format!("A curve without a name: {}", curve_title(curve.port, curve.argument)),
        caption: format!(
            "{}; its smoothness is the one under which stretches that were left out are simulated best. \
             What a linear plant can hold is in the plant, not in the curve.",
            if loading {
                "First loading, straight between knots and level behind the last; loops follow Masing's rule"
            } else {
                "Natural cubic spline over what the records reached"
            }
        ),
        share_x: false,
        panels: vec![panel],
    })
}

/// Positions at which a torque over position and velocity is drawn.
const DRAWN: usize = 5;

/// A torque over the velocity, a line a position.
fn surface_figure(curve: &FreeFormFound) -> Result<Figure, ReportError> {
    let mut at: Vec<f64> = curve.knots.iter().map(|k| k.at).collect();
    at.dedup();
    let speed_unit = format!("{}/s", curve.argument_unit);
    let mut panel = Panel::new(Axis::linear("Velocity", &speed_unit), Axis::linear("Torque added", &curve.unit));
    panel.height = 1.2;
    let lines = DRAWN.min(at.len());
    for line in 0..lines {
        let here = at[line * (at.len() - 1) / (lines - 1).max(1)];
        let row: Vec<&CurveKnot> = curve.knots.iter().filter(|k| k.at == here).collect();
        let of = |value: &dyn Fn(&CurveKnot) -> f64| row.iter().map(|k| value(k)).collect::<Vec<f64>>();
        let velocity = of(&|k| k.velocity.unwrap_or(0.0));
        let ink = Ink::Data(line as u8);
        let name = format!("at {} {}", short(here), curve.argument_unit);
        let band = Kind::Band { upper: of(&|k| k.high.unwrap_or(k.value)) };
        let lower = of(&|k| k.low.unwrap_or(k.value));
        // The bands of inner lines would hide one another.
        if line == 0 || line + 1 == lines {
            panel.marks.push(Series::new(&name, ink, band, &velocity, &lower)?.into());
        }
        panel.marks.push(Series::new(&name, ink, Kind::Solid, &velocity, &of(&|k| k.value))?.into());
    }
    Ok(Figure {
        title: format!("A curve without a name: {}", curve_title(curve.port, curve.argument)),
        caption: "Cubic spline over the position, straight between the velocities of the knots; its smoothness is the one under which \
                  stretches that were left out are simulated best. The 95 % band is drawn at the two ends of the stroke, where it is \
                  widest. What a linear plant can hold is in the plant, not in the curve."
            .into(),
        share_x: false,
        panels: vec![panel],
    })
}
