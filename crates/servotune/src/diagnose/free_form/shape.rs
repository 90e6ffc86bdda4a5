//! What may stand beside the linear plant while a curve is looked for: nothing, a reading that folds, or a curve at one port; with or
//! without a lag of the amplifier in front of it all.
//!
//! In: numbers. Out: effects with their settings, as a machine takes them.

use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::physics::amplifier_lag::AmplifierLag;
use crate::physics::sensor_curve::SensorCurve;
use crate::physics::{CurvePort, Knots, LawSetting};
use nalgebra::DMatrix;

/// What stands beside the linear plant.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::diagnose) enum Shape {
    /// Nothing.
    Linear,
    /// The reading folds: lowest reading and where it is read.
    Fold([f64; 2]),
    /// The reading ends at two limits.
    Limits([f64; 2]),
    /// A curve: its port, where its knots are, and its values there.
    Curve(CurvePort, Knots, Vec<f64>),
}

/// Knots of a curve.
const KNOTS: usize = 17;
/// Share of the samples beyond the first and the last knot: a curve is straight there.
const BEYOND: f64 = 1e-3;
/// Share of the longest loaded way at which the last slider slides: some samples lie beyond it.
const REACHED: f64 = 0.98;

impl Shape {
    /// Its numbers.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Shape::Linear => Vec::new(),
            Shape::Fold(n) | Shape::Limits(n) => n.to_vec(),
            Shape::Curve(_, _, value) => value.clone(),
        }
    }

    /// The same shape with other numbers.
    pub fn with(&self, numbers: &[f64]) -> Shape {
        match self {
            Shape::Linear => Shape::Linear,
            Shape::Fold(_) => Shape::Fold([numbers[0], numbers[1]]),
            Shape::Limits(_) => Shape::Limits([numbers[0], numbers[1]]),
            Shape::Curve(port, knots, _) => Shape::Curve(*port, knots.clone(), numbers.to_vec()),
        }
    }

    /// The effect that it is; none where it is none.
    pub fn effect(&self) -> Option<LawSetting> {
        match self {
            Shape::Linear => None,
            Shape::Fold([lowest, at]) => Some(LawSetting::fixed(SensorCurve::Folded { lowest: *lowest, at: *at })),
            Shape::Limits([low, high]) => {
                Some(LawSetting::fixed(SensorCurve::Limited { low: *low, high: low.max(*high) }))
            }
            Shape::Curve(port, knots, value) => Some(LawSetting::fixed(port.curve(knots, value))),
        }
    }

    /// The port of a curve.
    pub fn port(&self) -> Option<CurvePort> {
        match self {
            Shape::Curve(port, ..) => Some(*port),
            _ => None,
        }
    }

    /// Whether it stands between the arm and what is recorded.
    pub fn reads(&self) -> bool {
        matches!(self, Shape::Fold(_) | Shape::Limits(_) | Shape::Curve(CurvePort::SensorOverPosition, ..))
    }

    /// Rows whose squares, times the numbers, add up to the roughness; none where there is no curve.
    pub fn roughness(&self) -> DMatrix<f64> {
        match self {
            Shape::Curve(_, knots, _) => knots.roughness(),
            _ => DMatrix::zeros(0, 0),
        }
    }

    /// Knots of a curve at a port over the range of the records; none where nothing moves there, or few knots tell nothing.
    pub fn knots(data: &DiagnosisData, port: CurvePort) -> Option<Vec<f64>> {
        // Of these there are many, and the balance of torques gives their start.
        if matches!(port, CurvePort::TorqueOverTime | CurvePort::TorqueOverMotion) {
            return None;
        }
        let arm = match port {
            CurvePort::AmplifierOverCommand | CurvePort::SensorOverPosition => 1.0,
            _ => data.scene.arm_over_record(),
        };
        let mut all: Vec<f64> =
            data.trajectories.iter().flat_map(|t| &t.samples).map(|s| port.argument(&s.scaled(arm))).collect();
        all.retain(|v| v.is_finite());
        all.sort_by(f64::total_cmp);
        let off = (BEYOND * all.len() as f64) as usize;
        let [low, high] = [*all.get(off)?, *all.get(all.len().checked_sub(off + 1)?)?];
        if port == CurvePort::TorqueOverLoading {
            let records = data.trajectories.iter().map(|t| t.samples.iter().map(|s| arm * s.x).collect::<Vec<_>>());
            return Shape::loading_knots(records, KNOTS);
        }
        Some(Shape::spread(port, low, high)).filter(|_| low < high)
    }

    /// Knots from `low` to `high`. Dense around 0 where laws turn there: over velocity and command, and on a loading curve.
    pub fn spread(port: CurvePort, low: f64, high: f64) -> Vec<f64> {
        // A gain drifts slowly over a session.
        let count = if port == CurvePort::GainOverTime { KNOTS / 2 + 1 } else { KNOTS };
        Shape::spread_of(port, low, high, count)
    }

    /// The same with a number of knots.
    pub fn spread_of(port: CurvePort, low: f64, high: f64, knots: usize) -> Vec<f64> {
        let share = |k: usize| k as f64 / (knots - 1) as f64;
        if port == CurvePort::TorqueOverLoading {
            return (0..knots).map(|k| low + share(k).powi(3) * (high - low)).collect();
        }
        let around = matches!(port, CurvePort::TorqueOverVelocity | CurvePort::AmplifierOverCommand);
        if around && low < 0.0 && high > 0.0 && low > -8.0 * high && high < -8.0 * low {
            let s = |k: usize| 2.0 * share(k) - 1.0;
            return (0..knots).map(|k| s(k).abs().powf(1.6) * if s(k) < 0.0 { low } else { high }).collect();
        }
        (0..knots).map(|k| low + share(k) * (high - low)).collect()
    }

    /// Knots of a loading curve over the longest way that is loaded: from where a record begins, or half a swing between two turns (Masing).
    pub fn loading_knots(records: impl Iterator<Item = Vec<f64>>, knots: usize) -> Option<Vec<f64>> {
        let one = |x: Vec<f64>| {
            let first = x.first().copied().unwrap_or(0.0);
            let (low, high) = x.iter().fold((first, first), |(a, b), v| (a.min(*v), b.max(*v)));
            (high - first).max(first - low).max(0.5 * (high - low))
        };
        let reach = records.map(one).fold(0.0, f64::max);
        (reach > 0.0).then(|| Shape::spread_of(CurvePort::TorqueOverLoading, 0.0, REACHED * reach, knots))
    }

    /// The curve that changes nothing.
    pub fn idle(port: CurvePort, at: Vec<f64>) -> Shape {
        let value = at.iter().map(|a| port.idle(*a)).collect();
        Shape::Curve(port, Knots::line(at), value)
    }
}

/// The amplifier's lag as an effect of the plant file.
pub(in crate::diagnose) fn lag(seconds: f64) -> LawSetting {
    LawSetting::fixed(AmplifierLag { time_constant_s: seconds })
}

/// The effects of a lag of the amplifier, a shape and a reading behind it, in this order. The lag stands behind the amplifier's own curve,
/// or behind none, so that a record may begin while it still fades.
pub(in crate::diagnose) fn effects(lag_s: Option<f64>, shape: &Shape, reading: &Shape) -> Vec<LawSetting> {
    let mut own = shape.effect();
    let mut all = Vec::new();
    if let Some(lag_s) = lag_s {
        let port = CurvePort::AmplifierOverCommand;
        let curve = match shape {
            Shape::Curve(CurvePort::AmplifierOverCommand, knots, value) => {
                own = None;
                port.curve(knots, value)
            }
            _ => port.curve(&Knots::line(vec![-1.0, 1.0]), &[-1.0, 1.0]),
        };
        all.push(LawSetting::fixed(curve.lagged(lag_s)));
    }
    all.extend(own);
    all.extend(reading.effect());
    all
}
