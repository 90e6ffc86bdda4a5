//! The missing law itself, where no name explains the records: a smooth curve at each port of the machine, estimated together with the
//! linear plant by simulation; the one that foretells best what it was not fitted to.
//!
//! In: the diagnosis data, linear parameters to set out from. Out: the curve in its plain form with its errors, and how well it foretells.
//! Spec: `specs/mismatch.md`, "Curves without a name".

use super::foretelling::{Foretelling, Judged, begun, best_of, better, finished, foretold};
use super::gauge::{Plain, plain};
use super::shape::Shape;
use super::stretches::Stretches;
use super::trial::Trial;
use crate::diagnose::data::linear_form::body_numbers;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::rules::{BALANCES, BALANCES_NOT, CURVE_CLEARLY, CURVE_LAG, FOLD_NAMED, SECOND_CURVE};
use crate::lti::Plant;
use crate::numeric::spline::Spline;
use crate::physics::{CurvePort, Knots};
use rayon::prelude::*;
use std::f64::consts::LN_2;

/// A plant and a curve that balance the torques along recorded motion: from where a fit by simulation sets out.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Curved {
    pub plant: Plant,
    pub shape: Shape,
    /// Mean square of the parts left out over that of the balance without a curve.
    pub share: f64,
}

impl Curved {
    /// The same curve beside another plant: what either holds of gain, spring and damper goes over to the other.
    fn beside(&self, plant: &Plant) -> Option<Shape> {
        let Shape::Curve(port, knots, value) = &self.shape else { return None };
        let numbers = |p: &Plant| {
            let (b, k, c) = body_numbers(&p.body);
            (b * p.resonance_gain, k, c)
        };
        let ((b, k, c), (gain, spring, damper)) = (numbers(plant), numbers(&self.plant));
        let line = match port {
            CurvePort::TorqueOverPosition => [(k - spring) / b, 0.0],
            CurvePort::TorqueOverLoading => [(spring - k) / b, 0.0],
            CurvePort::TorqueOverVelocity => [(c - damper) / b, 0.0],
            CurvePort::TorqueOverMotion => [(k - spring) / b, (c - damper) / b],
            _ => [0.0; 2],
        };
        let ratio = if port.is_of_command() || line != [0.0; 2] { gain / b } else { 1.0 };
        let at = |i: usize| knots.place(i).iter().zip(line).map(|(a, l)| a * l).sum::<f64>();
        let value = value.iter().enumerate().map(|(i, v)| ratio * v + at(i)).collect();
        Some(Shape::Curve(*port, knots.clone(), value))
    }
}

/// What the estimation of curves came to.
pub(in crate::diagnose) struct Estimated<'a> {
    /// The linear plant fitted in the same way.
    pub linear: Foretelling<'a>,
    /// The best curve; beside the reading, where that has a name.
    pub curve: Foretelling<'a>,
    /// It in its plain form.
    pub plain: Plain,
    /// A reading that folds or ends at limits, where the best curve is the sensor's and it foretells as well.
    pub reading: Option<Foretelling<'a>>,
    /// Every port that was tried, with the mean square of the parts left out.
    pub tried: Vec<(CurvePort, f64)>,
}

/// Times that the knots of the best curve are doubled.
const FINER: usize = 2;
/// Time constant from which a lag sets out (samples).
const LAG: f64 = 3.0;
/// Share of the readings below the place where a fold is taken to lie at first, and share of the range below that which makes an edge: the
/// readings of a motion that runs free thin out towards their ends.
const LOWEST: f64 = 0.005;
const EDGE: f64 = 0.03;

/// A shape beside several linear parameters.
fn from_each<'a>(
    data: &'a DiagnosisData,
    stretches: &'a Stretches<'a>,
    starts: &[Vec<f64>],
    shape: &Shape,
) -> Vec<Trial<'a>> {
    starts.iter().map(|p| Trial::new(data, stretches, p, shape.clone())).collect()
}

/// The same with a lag of the amplifier in front, where that foretells clearly better.
fn with_lag<'a>(found: Foretelling<'a>) -> Foretelling<'a> {
    let t = found.trial.data.scene.sample_time_s;
    let lagged = foretold(found.trial.clone().lagged(Some(LAG * t)));
    lagged.filter(|l| l.left_out < CURVE_LAG * found.left_out).unwrap_or(found)
}

/// The knots with others between them.
fn doubled(at: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = at.iter().copied().chain(at.windows(2).map(|w| 0.5 * (w[0] + w[1]))).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The same curve over more knots, where it foretells clearly better: what acts at one place only falls between few.
fn finer<'a>(data: &'a DiagnosisData, ground: &'a Stretches<'a>, mut found: Foretelling<'a>) -> Foretelling<'a> {
    for _ in 0..FINER {
        let Shape::Curve(port, knots, value) = &found.trial.shape else { break };
        if matches!(port, CurvePort::SensorOverPosition | CurvePort::TorqueOverMotion) {
            break;
        }
        let spline = Spline::new(knots.at.clone(), value.clone());
        let at = doubled(&knots.at);
        let value = at.iter().map(|a| spline.value(*a)).collect();
        let shape = Shape::Curve(*port, Knots::line(at), value);
        let next = foretold(Trial::new(data, ground, &found.trial.p, shape).lagged(found.trial.lag_s));
        match next.filter(|n| n.left_out < CURVE_CLEARLY * found.left_out) {
            Some(next) => found = next,
            None => break,
        }
    }
    found
}

/// Linear parameters with other gains: what is read may be a part of the motion only.
fn other_gains(data: &DiagnosisData, starts: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let gain =
        data.form.free_parameters.iter().position(|k| *k == crate::diagnose::data::linear_form::FreeParameter::Gain);
    let moved = |p: &Vec<f64>, by: f64| {
        let mut p = p.clone();
        if let Some(i) = gain {
            p[i] += by;
        }
        p
    };
    starts.iter().flat_map(|p| [0.0, 1.5 * LN_2].map(|by| moved(p, by))).collect()
}

/// Where the lower and the upper end of some readings lie, and whether each is an edge; none without readings.
fn ends(runs: &[Run]) -> Option<[(f64, bool); 2]> {
    let mut all: Vec<f64> = runs.iter().flat_map(|r| r.position.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let at = |share: f64| all.get((share * all.len() as f64) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(LOWEST), at(1.0 - LOWEST));
    let (least, most) = (all.first()?, all.last()?);
    let edge = EDGE * (most - least);
    Some([(low, low - least < edge), (high, most - high < edge)])
}

/// Whether the readings end below as if the sensor folded there.
pub(in crate::diagnose) fn may_fold(data: &DiagnosisData) -> bool {
    ends(&data.runs).is_some_and(|[(_, below), _]| below)
}

/// Readings that fold or end at limits, each fitted from several starts.
fn readings<'a>(data: &'a DiagnosisData, stretches: &'a Stretches<'a>, starts: &[Vec<f64>]) -> Vec<Foretelling<'a>> {
    let Some([(low, below), (high, above)]) = ends(&stretches.runs) else { return Vec::new() };
    let fitted = |starts: &[Vec<f64>], reading: Shape| {
        // A lag in front changes the whole motion: it is no afterthought here.
        let lags = [None, Some(LAG * data.scene.sample_time_s)];
        let all = starts.iter().flat_map(|p| lags.map(|lag_s| (p, lag_s)));
        let one = |(p, lag_s): (&Vec<f64>, Option<f64>)| {
            Trial::new(data, stretches, p, Shape::Linear).read_by(reading.clone()).lagged(lag_s)
        };
        best_of(all.map(one).collect())
    };
    let fold = below.then(|| fitted(&other_gains(data, starts), Shape::Fold([low, low])));
    let limits = (below || above).then(|| fitted(starts, Shape::Limits([low, high])));
    fold.into_iter().chain(limits).flatten().collect()
}

/// The sensor's curve: from a straight one, and from the readings that fold or end.
fn sensor<'a>(
    data: &'a DiagnosisData,
    stretches: &'a Stretches<'a>,
    starts: &[Vec<f64>],
    readings: &[Foretelling<'a>],
) -> Option<Foretelling<'a>> {
    let port = CurvePort::SensorOverPosition;
    let straight =
        Shape::knots(data, port).and_then(|at| best_of(from_each(data, stretches, starts, &Shape::idle(port, at))));
    let top = data.scene.centre + 0.5 * range(data);
    let bent = readings.iter().filter_map(|reading| {
        let (at, value): (Vec<f64>, Vec<f64>) = match reading.trial.reading {
            Shape::Fold([lowest, fold]) => {
                let reach = (top - lowest).abs();
                let at = Shape::spread(port, fold - reach, fold + reach);
                let value = at.iter().map(|a| lowest + (a - fold).abs()).collect();
                (at, value)
            }
            Shape::Limits([low, high]) => {
                let at = Shape::spread(port, 1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low);
                let value = at.iter().map(|a| a.max(low).min(high)).collect();
                (at, value)
            }
            _ => return None,
        };
        let shape = Shape::Curve(port, Knots::line(at), value);
        foretold(Trial::new(data, stretches, &reading.trial.p, shape).lagged(reading.trial.lag_s))
    });
    bent.fold(straight, |best, b| better(best, Some(b)))
}

fn range(data: &DiagnosisData) -> f64 {
    let all = data.means.iter().flat_map(|r| &r.position);
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    high - low
}

/// Stretches for the linear plant and most ports, and for the sensor's curve.
pub(in crate::diagnose) fn grounds<'a>(data: &DiagnosisData) -> [Stretches<'a>; 2] {
    let plain = Stretches::of(data);
    let one_place = plain.standing_alike();
    [plain, one_place]
}

/// Estimates the curve at every port and takes the best; `curves` are those of the balance of torques. Without a ground for it the sensor's
/// curve is not asked for.
pub(in crate::diagnose) fn estimated<'a>(
    data: &'a DiagnosisData,
    (ground, one_place): (&'a Stretches<'a>, Option<&'a Stretches<'a>>),
    starts: &[Vec<f64>],
    curves: &[Curved],
    progress: &mut dyn FnMut(&str),
) -> Option<Estimated<'a>> {
    progress("a curve without a name: the linear plant by simulation");
    let linear = with_lag(best_of(from_each(data, ground, starts, &Shape::Linear))?);
    // What acts may have bent the refit: the given plant is another start.
    let mut from = vec![linear.trial.p.clone()];
    from.extend(starts.first().filter(|p| **p != from[0]).cloned());
    progress("a curve without a name: at every port of torque and amplifier");
    let mut found = at_ports(data, ground, curves, &from);
    let mut read = Vec::new();
    if let Some(one_place) = one_place {
        progress("a curve without a name: sensor over position");
        read = readings(data, one_place, starts);
        found.extend(sensor(data, one_place, &from, &read));
    }
    let (best, mut tried) = among(found);
    let mut curve = finer(data, ground, best?.further()?);
    progress("a curve without a name: torque over position and velocity");
    if let Some(found) = surface(data, ground, curves, &from) {
        tried.push((CurvePort::TorqueOverMotion, found.left_out));
        if found.left_out < CURVE_CLEARLY * curve.left_out {
            curve = found;
        }
    }
    if curve.trial.lag_s.is_none() {
        curve = with_lag(curve);
    }
    let port = curve.trial.shape.port()?;
    let reading = read
        .into_iter()
        .min_by(|a, b| a.left_out.total_cmp(&b.left_out))
        .filter(|_| port == CurvePort::SensorOverPosition);
    let mut reading = reading.filter(|r| r.left_out < SECOND_CURVE * curve.left_out);
    if let (Some(r), Some(one_place)) = (&reading, one_place) {
        progress("a curve without a name beside the reading that was found");
        let (other, by_port) = beside(r, one_place)?;
        // A name, alone or with a curve at another port, before a sensor bent freely, where it foretells as well.
        if r.left_out < FOLD_NAMED * curve.left_out || other.left_out <= curve.left_out {
            (curve, tried) = (other, by_port);
        } else {
            reading = None;
        }
    }
    let plain = in_plain_form(&curve)?;
    Some(Estimated { linear, curve, plain, reading, tried })
}

/// The best curve at each port of torque and amplifier that may be the one.
fn at_ports<'a>(
    data: &'a DiagnosisData,
    ground: &'a Stretches<'a>,
    curves: &[Curved],
    from: &[Vec<f64>],
) -> Vec<Foretelling<'a>> {
    let one = |port: CurvePort| {
        // The balance of torques knows nothing of the given plant, which what acts may have bent.
        let balanced = curves.iter().find(|c| c.shape.port() == Some(port));
        let share = balanced.map_or(1.0, |c| c.share);
        // Where one port balances well, one that does not is not it; where this one does, its curve is the start.
        if share > BALANCES_NOT && curves.iter().any(|c| c.share < BALANCES) {
            return Vec::new();
        }
        let idle = Shape::knots(data, port).filter(|_| share > BALANCES);
        let mut trials = idle.map_or_else(Vec::new, |at| from_each(data, ground, from, &Shape::idle(port, at)));
        trials.extend(balanced.and_then(|c| from_balance(data, ground, c, from)));
        begun(trials)
    };
    let later = [CurvePort::SensorOverPosition, CurvePort::TorqueOverMotion];
    let ports: Vec<CurvePort> = CurvePort::ALL.into_iter().filter(|p| !later.contains(p)).collect();
    let all: Vec<Vec<Judged>> = ports.into_par_iter().map(one).collect();
    finished(all.into_iter().flatten().collect())
}

/// The best of some curves, and how each port foretells.
fn among(all: Vec<Foretelling>) -> (Option<Foretelling>, Vec<(CurvePort, f64)>) {
    let tried = all.iter().filter_map(|f| Some((f.trial.shape.port()?, f.left_out))).collect();
    (all.into_iter().map(Some).fold(None, better), tried)
}

/// A trial of the curve of a balance, with the plant beside which it simulates best: its own, or one of some others.
fn from_balance<'a>(
    data: &'a DiagnosisData,
    ground: &'a Stretches<'a>,
    curve: &Curved,
    others: &[Vec<f64>],
) -> Option<Trial<'a>> {
    let own = data.form.numbers_of(&curve.plant);
    let beside = |p: &Vec<f64>| {
        let shape = curve.beside(&data.form.plant(p))?;
        let mut trial = Trial::new(data, ground, p, shape);
        let left = trial.left();
        left.is_finite().then_some((left, trial))
    };
    let best = own.iter().chain(others).filter_map(beside).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(best.1)
}

/// A torque over position and velocity, where the balance foretells clearly better with it than with any curve over one argument.
fn surface<'a>(
    data: &'a DiagnosisData,
    ground: &'a Stretches<'a>,
    curves: &[Curved],
    starts: &[Vec<f64>],
) -> Option<Foretelling<'a>> {
    let (both, one): (Vec<_>, Vec<_>) =
        curves.iter().partition(|c| c.shape.port() == Some(CurvePort::TorqueOverMotion));
    let least = one.iter().map(|c| c.share).fold(1.0, f64::min);
    let found = both.first().filter(|c| c.share < CURVE_CLEARLY * least)?;
    foretold(from_balance(data, ground, found, starts)?)
}

/// The best curve at another port beside a reading that folds or ends at limits.
fn beside<'a>(
    reading: &Foretelling<'a>,
    one_place: &'a Stretches<'a>,
) -> Option<(Foretelling<'a>, Vec<(CurvePort, f64)>)> {
    let data = reading.trial.data;
    let one = |port: CurvePort| {
        // What is read is not where the arm is: positions and speeds may be of either sign.
        let at = Shape::knots(data, port)?;
        let at = if port == CurvePort::AmplifierOverCommand { at } else { both_sides(port, &at) };
        let from = reading.trial.clone();
        foretold(Trial::new(data, one_place, &from.p, Shape::idle(port, at)).read_by(from.reading).lagged(from.lag_s))
    };
    let ports: Vec<CurvePort> = CurvePort::ALL.into_iter().filter(|p| *p != CurvePort::SensorOverPosition).collect();
    let all: Vec<Option<Foretelling>> = ports.into_par_iter().map(one).collect();
    let (best, tried) = among(all.into_iter().flatten().collect());
    best.map(|b| (b, tried))
}

/// Knots as far to one side of 0 as to the other.
fn both_sides(port: CurvePort, at: &[f64]) -> Vec<f64> {
    let reach = at.iter().fold(0.0f64, |m, a| m.max(a.abs()));
    Shape::spread(port, -reach, reach)
}

fn in_plain_form(f: &Foretelling) -> Option<Plain> {
    let Shape::Curve(port, knots, value) = &f.trial.shape else { return None };
    let from = f.trial.shape_from();
    let own = f.covariance.view((from, from), (value.len(), value.len())).into_owned();
    Some(plain(f.trial.data, *port, knots, value, &own, &f.trial.p))
}
