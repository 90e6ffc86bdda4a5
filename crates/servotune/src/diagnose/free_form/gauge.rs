//! What of a curve the linear plant can hold, given to the linear plant: the rest is the curve's own.
//!
//! In: a curve, the covariance of its values, the linear parameters. Out: the same in its plain form. A torque keeps no mean, and no line
//! where the plant has a spring or a damper for it (the line of least squares over the samples); a loading curve begins at 0
//! and keeps no line at its end where the plant has a spring for it; a gain has the mean 1; an amplifier gives 0
//! for 0 and rises by 1 on the mean; a sensor rises or falls by 1 on the mean.

use crate::diagnose::data::linear_form::{FreeParameter, LinearForm, body_numbers, rate_of};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::numeric::spline::Spline;
use crate::physics::{CurvePort, Knots};
use nalgebra::{DMatrix, DVector};

/// A curve in its plain form.
#[derive(Clone)]
pub(in crate::diagnose) struct Plain {
    pub port: CurvePort,
    pub knots: Knots,
    pub value: Vec<f64>,
    /// Standard errors of the values.
    pub spread: Vec<f64>,
    /// How many samples lie near each knot, as a share.
    pub weight: Vec<f64>,
    /// All linear parameters.
    pub p: Vec<f64>,
}

/// Least weight of a knot over the mean one.
const LEAST: f64 = 1e-3;
/// Least stiffness over the given one, and least damping over its unit, that a curve's line may leave.
const LEFT: f64 = 0.02;
/// Share of the longest way behind which a loading curve is all spring.
const TAIL: f64 = 0.4;

/// The place nearest to `a`.
fn nearest(at: &[f64], a: f64) -> usize {
    let i = at.partition_point(|x| *x < a).clamp(1, at.len() - 1);
    if a - at[i - 1] < at[i] - a { i - 1 } else { i }
}

/// How many samples lie near each knot; even for a sensor, behind whose curve nobody saw the arm, and for a loading curve, whose ways nest.
fn weights(data: &DiagnosisData, port: CurvePort, knots: &Knots) -> Vec<f64> {
    let n = knots.count();
    let mut count = vec![0.0; n];
    if matches!(port, CurvePort::SensorOverPosition | CurvePort::TorqueOverLoading) {
        count.fill(1.0);
    } else {
        let arm = if port == CurvePort::AmplifierOverCommand { 1.0 } else { data.scene.arm_over_record() };
        for s in data.trajectories.iter().flat_map(|t| &t.samples) {
            let s = s.scaled(arm);
            let across = knots.velocity.len().max(1);
            let beside = if knots.velocity.is_empty() { 0 } else { nearest(&knots.velocity, s.v) };
            count[nearest(&knots.at, port.argument(&s)) * across + beside] += 1.0;
        }
    }
    let mean = count.iter().sum::<f64>() / n as f64;
    let all: f64 = count.iter().map(|c| c + LEAST * mean).sum();
    count.iter().map(|c| (c + LEAST * mean) / all).collect()
}

/// What a curve's line may move in the plant: free parameter and its change per slope.
fn free_parameter(form: &LinearForm, p: &[f64], port: CurvePort) -> Option<(usize, f64)> {
    let (b, k, _) = body_numbers(&form.given.body);
    let ratio =
        form.free_parameters.iter().zip(p).find(|(k, _)| **k == FreeParameter::Gain).map_or(1.0, |(_, v)| v.exp());
    let gain = b * form.given.resonance_gain * ratio;
    let (wanted, unit) = match port {
        CurvePort::TorqueOverPosition => (FreeParameter::Stiffness, k),
        // A torque that resists is counted the other way round.
        CurvePort::TorqueOverLoading => (FreeParameter::Stiffness, -k),
        CurvePort::TorqueOverVelocity => (FreeParameter::Viscous, rate_of(&form.given.body)),
        _ => return None,
    };
    form.free_parameters.iter().position(|k| *k == wanted).map(|i| (i, -gain / unit))
}

/// The slope of least squares as weights of the values.
fn slope_of(at: &DVector<f64>, weight: &[f64]) -> DVector<f64> {
    let mean: f64 = at.iter().zip(weight).map(|(a, w)| a * w).sum();
    let square: f64 = at.iter().zip(weight).map(|(a, w)| w * (a - mean).powi(2)).sum();
    DVector::from_fn(at.len(), |i, _| weight[i] * (at[i] - mean) / square)
}

/// The slopes of least squares over two arguments as weights of the values.
fn slopes_of(places: &[DVector<f64>; 2], weight: &[f64]) -> [DVector<f64>; 2] {
    let weight = DVector::from_column_slice(weight);
    let [x, v] = places.each_ref().map(|p| p.add_scalar(-p.dot(&weight)));
    let [own_x, own_v] = [x.component_mul(&weight), v.component_mul(&weight)];
    let (xx, xv, vv) = (x.dot(&own_x), x.dot(&own_v), v.dot(&own_v));
    let det = xx * vv - xv * xv;
    [(&own_x * vv - &own_v * xv) / det, (&own_v * xx - &own_x * xv) / det]
}

/// The value at `x` as weights of the values.
fn value_of(at: &[f64], x: f64) -> DVector<f64> {
    DVector::from_fn(at.len(), |i, _| {
        let mut unit = vec![0.0; at.len()];
        unit[i] = 1.0;
        Spline::new(at.to_vec(), unit).value(x)
    })
}

/// The plain form.
pub(in crate::diagnose) fn plain(
    data: &DiagnosisData,
    port: CurvePort,
    knots: &Knots,
    value: &[f64],
    covariance: &DMatrix<f64>,
    p: &[f64],
) -> Plain {
    let (at, n, weight) = (&knots.at[..], knots.count(), weights(data, port, knots));
    let theta = DVector::from_column_slice(value);
    let mean = DVector::from_column_slice(&weight);
    let ones = DVector::from_element(n, 1.0);
    let places = [0, 1].map(|axis| DVector::from_fn(n, |i, _| knots.place(i)[axis]));
    let (knots, spread) = (knots.clone(), vec![]);
    let mut out = Plain { port, knots, value: vec![], spread, weight: weight.clone(), p: p.to_vec() };
    let gain = data.form.free_parameters.iter().position(|k| *k == FreeParameter::Gain);
    let slope = slope_of(&places[0], &weight);
    let mut map = DMatrix::identity(n, n);
    let plain = match port {
        CurvePort::TorqueOverPosition | CurvePort::TorqueOverVelocity | CurvePort::TorqueOverMotion => {
            let held: Vec<(CurvePort, &DVector<f64>, DVector<f64>)> = match port {
                CurvePort::TorqueOverMotion => {
                    let [over_x, over_v] = slopes_of(&places, &weight);
                    let [x, v] = &places;
                    vec![(CurvePort::TorqueOverPosition, x, over_x), (CurvePort::TorqueOverVelocity, v, over_v)]
                }
                _ => vec![(port, &places[0], slope)],
            };
            for (port, places, slope) in held {
                let Some((i, by)) = free_parameter(&data.form, p, port) else { continue };
                let full = by * slope.dot(&theta);
                let least = if port == CurvePort::TorqueOverPosition { LEFT - 1.0 } else { least_damping(data) };
                let moved = full.max(least - p[i]);
                out.p[i] += moved;
                let share = if full == 0.0 { 1.0 } else { moved / full };
                map -= places * slope.transpose() * share;
            }
            map = (DMatrix::identity(n, n) - &ones * mean.transpose()) * map;
            &map * &theta
        }
        CurvePort::TorqueOverTime => {
            map = &map - &ones * mean.transpose();
            &map * &theta
        }
        CurvePort::TorqueOverLoading => {
            give_spring(&mut out, &mut map, data, (&places[0], &theta));
            let first = map.row(0).into_owned();
            map.row_iter_mut().for_each(|mut row| row -= &first);
            &map * &theta
        }
        CurvePort::GainOverPosition | CurvePort::GainOverTime => {
            let level = mean.dot(&theta);
            scaled(&mut out, gain, level);
            let plain = &theta / level;
            map = (map - &plain * mean.transpose()) / level;
            plain
        }
        CurvePort::AmplifierOverCommand => {
            let rise = slope.dot(&theta);
            scaled(&mut out, gain, rise);
            let zero = &ones * value_of(at, 0.0f64.clamp(at[0], at[n - 1])).transpose();
            let plain = (DMatrix::identity(n, n) - &zero) * &theta / rise;
            map = ((map - &zero) - &plain * slope.transpose()) / rise;
            plain
        }
        CurvePort::SensorOverPosition => {
            let spline = Spline::new(at.to_vec(), value.to_vec());
            let rise = (at.iter().map(|a| spline.slope(*a).powi(2)).sum::<f64>() / n as f64).sqrt();
            scaled(&mut out, gain, rise);
            out.knots.at.iter_mut().for_each(|a| *a *= rise);
            theta
        }
    };
    out.value = plain.iter().copied().collect();
    let spread = &map * covariance * map.transpose();
    out.spread = (0..n).map(|i| spread[(i, i)].max(0.0).sqrt()).collect();
    out
}

/// What of a loading curve still rises behind all turns is a spring, and goes to the plant.
fn give_spring(
    out: &mut Plain,
    map: &mut DMatrix<f64>,
    data: &DiagnosisData,
    (at, theta): (&DVector<f64>, &DVector<f64>),
) {
    let last = at.max();
    let behind: Vec<f64> = at.iter().map(|a| f64::from(u8::from(*a > TAIL * last))).collect();
    let count: f64 = behind.iter().sum();
    let behind: Vec<f64> = behind.iter().map(|w| w / count).collect();
    let slope = slope_of(at, &behind);
    if let Some((i, by)) = free_parameter(&data.form, &out.p, CurvePort::TorqueOverLoading) {
        let full = by * slope.dot(theta);
        let moved = full.max(LEFT - 1.0 - out.p[i]);
        out.p[i] += moved;
        let share = if full == 0.0 { 1.0 } else { moved / full };
        *map -= at * slope.transpose() * share;
    }
}

/// Least value of the damping's free parameter.
fn least_damping(data: &DiagnosisData) -> f64 {
    let (_, _, c) = body_numbers(&data.form.given.body);
    -c / rate_of(&data.form.given.body) + LEFT * f64::from(u8::from(c > 0.0)) * c / rate_of(&data.form.given.body)
}

/// Gives a curve's factor to the plant's gain.
fn scaled(out: &mut Plain, gain: Option<usize>, by: f64) {
    if let Some(i) = gain.filter(|_| by > 0.0) {
        out.p[i] += by.ln();
    }
}
