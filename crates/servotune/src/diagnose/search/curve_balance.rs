//! A curve and the linear plant together by the balance of torques: along recorded motion both are linear, whatever the given plant was.
//!
//! In: a balance and a port. Out: plant and curve from which a fit by simulation sets out, and how well the balance foretells what it was
//! not fitted to. Knots are joined by straight lines here; the roughness of the spline through them is held by the same left-out parts that
//! choose it for a simulation.

use super::torque_balance::{Balance, LATER, Smoothed, smooth, weights};
use crate::diagnose::data::linear_form::body_numbers;
use crate::diagnose::free_form::estimation::Curved;
use crate::diagnose::free_form::left_out::LeftOut;
use crate::diagnose::free_form::shape::Shape;
use crate::lti::Body;
use crate::physics::{CurvePort, Knots, Sample, Sliders};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Knots of a curve; of one over the time of a record, where events are short; of one over the session, in which a gain drifts slowly.
const KNOTS: usize = 33;
const OVER_TIME: usize = 129;
const SLOW: usize = 9;
/// Positions of a torque over position and velocity, and speeds either way; how much denser the lower speeds lie than the rows do.
const POSITIONS: usize = 9;
const SPEEDS: usize = 6;
const DENSER: f64 = 1.5;
/// Share of the rows beyond the first and the last knot.
const BEYOND: f64 = 1e-3;
/// Stretches of each record, and parts of them that are left out in turn.
const STRETCHES: usize = 32;
const PARTS: usize = 4;
/// Shares of the later command at which a command's curve is tried: any delay up to that one.
const DELAYS: usize = 9;

/// What enters a balance beside the curve.
struct Rows {
    /// Columns of the plant: command early and late (none where the curve holds it), velocity, position, a constant a record.
    plant: Vec<Vec<f64>>,
    target: Vec<f64>,
    blocks: Vec<(usize, usize)>,
}

impl Balance<'_> {
    fn total(&self) -> usize {
        self.parts.iter().map(|p| p.rows.len()).sum()
    }

    /// A value at every row, smoothed, from one at every sample of a record.
    fn at_rows(&self, of: &dyn Fn(&Smoothed, usize) -> Vec<f64>, weights: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.total());
        for (r, part) in self.parts.iter().enumerate() {
            let series = of(part, r);
            out.extend(part.rows.iter().map(|&k| smooth(&series, k, weights)));
        }
        out
    }

    fn rows(&self, port: Option<CurvePort>, weights: &[f64]) -> Rows {
        let mut plant = Vec::new();
        if !port.is_some_and(CurvePort::is_of_command) {
            let acts = |r: usize| held(&self.means[r].input);
            plant.extend([0, LATER].map(|lag| self.at_rows(&|_, r| late(&acts(r), lag), weights)));
        }
        let raw = |of: &dyn Fn(&Smoothed, usize, usize) -> f64| -> Vec<f64> {
            self.parts
                .iter()
                .enumerate()
                .flat_map(|(r, p)| p.rows.iter().map(|&k| of(p, r, k)).collect::<Vec<_>>())
                .collect()
        };
        if !matches!(port, Some(CurvePort::TorqueOverVelocity | CurvePort::TorqueOverMotion)) {
            plant.push(raw(&|p, _, k| -p.samples[k].v));
        }
        let free = matches!(self.data.form.given.body, Body::FreeInertia { .. });
        if !free && !matches!(port, Some(CurvePort::TorqueOverPosition | CurvePort::TorqueOverMotion)) {
            plant.push(raw(&|p, r, k| self.means[r].origin - p.samples[k].x));
        }
        for own in 0..self.parts.len() {
            plant.push(raw(&|_, r, _| f64::from(u8::from(r == own))));
        }
        let mut blocks = Vec::new();
        for part in &self.parts {
            let n = part.rows.len();
            blocks.extend((0..STRETCHES).map(|k| (n * (k + 1) / STRETCHES - n * k / STRETCHES, k % PARTS)));
        }
        Rows { plant, target: raw(&|p, _, k| p.acceleration[k]), blocks }
    }

    /// What is left on parts left out, and the numbers.
    fn foretold(&self, rows: &Rows, curve: &[Vec<f64>], rough: &DMatrix<f64>) -> Option<(f64, Vec<f64>)> {
        let count = rows.plant.len() + curve.len();
        let total = rows.target.len();
        if total < 4 * count {
            return None;
        }
        let all: Vec<&Vec<f64>> = rows.plant.iter().chain(curve).collect();
        let j = DMatrix::from_fn(total, count, |i, k| all[k][i]);
        let r: Vec<f64> = rows.target.iter().map(|t| -t).collect();
        let left_out = LeftOut::new(&rows.blocks, &r, &j, &vec![0.0; count], rough);
        let smoothness = if curve.is_empty() { 0.0 } else { left_out.best_smoothness() };
        let error = left_out.error(smoothness);
        error.is_finite().then_some(())?;
        Some((error, left_out.solution(smoothness)?))
    }

    /// Knots over what the rows go over.
    fn knots(&self, port: CurvePort) -> Option<Knots> {
        let arm = self.arm(port);
        let sorted = |of: &dyn Fn(&Sample) -> f64| {
            let rows = self.parts.iter().flat_map(|p| p.rows.iter().map(move |&k| p.sharp[k].scaled(arm)));
            let mut all: Vec<f64> = rows.map(|s| of(&s)).filter(|a| a.is_finite()).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let off = |count: usize| (BEYOND * count as f64) as usize;
        if port == CurvePort::TorqueOverLoading {
            let records = self.parts.iter().map(|p| p.sharp.iter().map(|s| arm * s.x).collect::<Vec<_>>());
            return Shape::loading_knots(records, KNOTS).map(Knots::line);
        }
        let all = sorted(&|s| port.argument(s));
        let [low, high] = [*all.get(off(all.len()))?, *all.get(all.len().checked_sub(off(all.len()) + 1)?)?];
        if low >= high {
            return None;
        }
        if port == CurvePort::TorqueOverMotion {
            // Where the machine moves, and closer together where laws turn.
            let speeds = sorted(&|s| s.v.abs());
            let last = speeds.len() - 1 - off(speeds.len());
            let share = |k: usize| (k as f64 / SPEEDS as f64).powf(DENSER);
            let mut up: Vec<f64> = (1..=SPEEDS).map(|k| speeds[(share(k) * last as f64) as usize]).collect();
            up.retain(|v| *v > 0.0);
            up.dedup();
            let down = up.iter().rev().map(|v| -v);
            return Some(Knots {
                at: (0..POSITIONS).map(|k| low + k as f64 / (POSITIONS - 1) as f64 * (high - low)).collect(),
                velocity: down.chain([0.0]).chain(up.iter().copied()).collect(),
            })
            .filter(|k| k.velocity.len() > 2);
        }
        let count = match port {
            CurvePort::TorqueOverTime => OVER_TIME,
            CurvePort::GainOverTime => SLOW,
            _ => KNOTS,
        };
        Some(Knots::line(Shape::spread_of(port, low, high, count)))
    }

    fn arm(&self, port: CurvePort) -> f64 {
        if port == CurvePort::AmplifierOverCommand { 1.0 } else { self.data.scene.arm_over_record() }
    }

    /// The columns of a curve's values, a command's at this share of the later one.
    fn curve_columns(&self, port: CurvePort, knots: &Knots, weights: &[f64], share: f64) -> Vec<Vec<f64>> {
        let (arm, at) = (self.arm(port), &knots.at);
        if port == CurvePort::TorqueOverLoading {
            return self.loading_columns(at, weights);
        }
        let across = knots.velocity.len().max(1);
        let over = |j: usize, s: &Sample| {
            let along = hat(at, j / across, port.argument(s));
            if knots.velocity.is_empty() { along } else { along * hat(&knots.velocity, j % across, s.v) }
        };
        let acting = |r: usize| -> Vec<f64> {
            let acts = held(&self.means[r].input);
            let (early, late) = (late(&acts, 0), late(&acts, LATER));
            early.iter().zip(&late).map(|(a, b)| (1.0 - share) * a + share * b).collect()
        };
        (0..knots.count())
            .into_par_iter()
            .map(|j| {
                let of = |part: &Smoothed, r: usize| -> Vec<f64> {
                    let hats = part.sharp.iter().map(|s| over(j, &s.scaled(arm)));
                    match port {
                        CurvePort::AmplifierOverCommand => {
                            let acts = held(&hats.collect::<Vec<_>>());
                            let (early, late) = (late(&acts, 0), late(&acts, LATER));
                            early.iter().zip(&late).map(|(a, b)| (1.0 - share) * a + share * b).collect()
                        }
                        CurvePort::GainOverPosition | CurvePort::GainOverTime => {
                            hats.zip(acting(r)).map(|(h, u)| h * u).collect()
                        }
                        _ => hats.collect(),
                    }
                };
                self.at_rows(&of, weights)
            })
            .collect()
    }

    /// Of a loading curve: its values are slopes between knots, and each slider holds the fall of the slope at its knot.
    fn loading_columns(&self, at: &[f64], weights: &[f64]) -> Vec<Vec<f64>> {
        let arm = self.data.scene.arm_over_record();
        let mut sliders: Vec<Vec<f64>> = vec![Vec::with_capacity(self.total()); at.len() - 1];
        for part in &self.parts {
            let mut row = Sliders::of(at, at);
            let mut stretch = vec![vec![0.0; part.sharp.len()]; at.len() - 1];
            for k in 1..part.sharp.len() {
                let dx = arm * (part.sharp[k].x - part.sharp[k - 1].x);
                row.go(dx).iter().zip(&mut stretch).for_each(|(z, s)| s[k] = *z);
            }
            for (out, s) in sliders.iter_mut().zip(&stretch) {
                out.extend(part.rows.iter().map(|&k| -smooth(s, k, weights)));
            }
        }
        let n = at.len();
        let total = self.total();
        let slider = |j: Option<usize>, i: usize| j.and_then(|j| sliders.get(j)).map_or(0.0, |s| s[i]);
        // A value at knot i raises the slope before it and lowers the one behind.
        let column = |i: usize| -> Vec<f64> {
            let before = (i > 0).then(|| (at[i] - at[i - 1]).recip());
            let behind = (i + 1 < n).then(|| (at[i + 1] - at[i]).recip());
            let own = i.checked_sub(1);
            (0..total)
                .map(|k| {
                    let rises =
                        before.map_or(0.0, |w| w * (slider(own, k) - slider(own.and_then(|o| o.checked_sub(1)), k)));
                    let falls = behind.map_or(0.0, |w| w * (slider(Some(i), k) - slider(own, k)));
                    rises - falls
                })
                .collect()
        };
        (0..n).into_par_iter().map(column).collect()
    }

    /// What the balance without a curve leaves of the parts left out.
    fn linear_left(&self) -> Option<f64> {
        let rows = self.rows(None, &weights(self.width));
        self.foretold(&rows, &[], &DMatrix::zeros(0, 0)).map(|f| f.0)
    }

    /// Plant and curve at a port, beside what the linear balance leaves; none where nothing moves there or nothing can be solved.
    fn curved(&self, port: CurvePort, linear: f64) -> Option<Curved> {
        let weights = weights(self.width);
        let knots = self.knots(port)?;
        let rows = self.rows(Some(port), &weights);
        let rough = knots.roughness();
        let early = self.curve_columns(port, &knots, &weights, 0.0);
        let tried: Vec<(f64, Vec<f64>, f64)> = if port.is_of_command() {
            let late = self.curve_columns(port, &knots, &weights, 1.0);
            let at = |share: f64| {
                let between = |(a, b): (&f64, &f64)| (1.0 - share) * a + share * b;
                let column = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(between).collect();
                let columns: Vec<Vec<f64>> = early.iter().zip(&late).map(column).collect();
                self.foretold(&rows, &columns, &rough).map(|(error, x)| (error, x, share))
            };
            (0..DELAYS).into_par_iter().filter_map(|k| at(k as f64 / (DELAYS - 1) as f64)).collect()
        } else {
            self.foretold(&rows, &early, &rough).map(|(error, x)| (error, x, 0.0)).into_iter().collect()
        };
        let (error, x, share) = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        self.made(port, knots, &x, share, rows.plant.len(), error / linear)
    }

    /// The numbers of a balance as a plant and a curve.
    fn made(&self, port: CurvePort, knots: Knots, x: &[f64], share: f64, from: usize, left: f64) -> Option<Curved> {
        let at = &knots.at;
        let (own, mut value) = (&x[..from], x[from..].to_vec());
        let mut own = own.iter().copied();
        let (gain, late) = match port {
            CurvePort::AmplifierOverCommand => {
                // The line of least squares through the curve is the gain.
                (line(at, &value), share)
            }
            CurvePort::GainOverPosition | CurvePort::GainOverTime => {
                (value.iter().sum::<f64>() / value.len() as f64, share)
            }
            _ => {
                let [early, late] = [own.next()?, own.next()?];
                (early + late, late / (early + late))
            }
        };
        let both = port == CurvePort::TorqueOverMotion;
        let viscous = if both || port == CurvePort::TorqueOverVelocity { 0.0 } else { own.next()? };
        let free = matches!(self.data.form.given.body, Body::FreeInertia { .. });
        let stiffness = if free || both || port == CurvePort::TorqueOverPosition { 0.0 } else { own.next()? };
        if !gain.is_normal() {
            return None;
        }
        value.iter_mut().for_each(|v| *v /= gain);
        // What the curve holds of spring and damper goes back to the plant, that it stays one.
        let (mut viscous, mut stiffness) = (viscous, stiffness);
        match port {
            // What still resists more behind all turns is a spring.
            CurvePort::TorqueOverLoading => {
                let from = at.len() / 2;
                let rise = line(&at[from..], &value[from..]);
                stiffness += gain * rise;
                value.iter_mut().zip(at).for_each(|(v, a)| *v -= rise * a);
            }
            CurvePort::TorqueOverVelocity => viscous = (-gain * line(at, &value)).max(0.0),
            CurvePort::TorqueOverPosition => stiffness = (-gain * line(at, &value)).max(0.0),
            CurvePort::TorqueOverMotion => {
                let place = |axis: usize| (0..value.len()).map(|i| knots.place(i)[axis]).collect::<Vec<_>>();
                viscous = (-gain * line(&place(1), &value)).max(0.0);
                stiffness = if free { 0.0 } else { (-gain * line(&place(0), &value)).max(0.0) };
            }
            _ => {}
        }
        let plant = self.plant(gain, LATER as f64 * late, viscous, stiffness);
        let held = body_numbers(&plant.body);
        let back = match port {
            CurvePort::TorqueOverVelocity => [held.2 / gain, 0.0],
            CurvePort::TorqueOverPosition => [held.1 / gain, 0.0],
            CurvePort::TorqueOverMotion => [held.1 / gain, held.2 / gain],
            _ => [0.0; 2],
        };
        for (i, v) in value.iter_mut().enumerate() {
            *v += knots.place(i).iter().zip(back).map(|(a, b)| a * b).sum::<f64>();
        }
        if port == CurvePort::TorqueOverLoading {
            let first = value[0];
            value.iter_mut().for_each(|v| *v -= first);
        }
        value.iter().all(|v| v.is_finite()).then_some(())?;
        Some(Curved { plant, shape: Shape::Curve(port, knots, value), share: left })
    }
}

/// Slope of the line of least squares.
fn line(at: &[f64], value: &[f64]) -> f64 {
    let mean = at.iter().sum::<f64>() / at.len() as f64;
    let square: f64 = at.iter().map(|a| (a - mean).powi(2)).sum();
    at.iter().zip(value).map(|(a, v)| (a - mean) * v).sum::<f64>() / square
}

/// What a command held between samples comes to around each sample: the mean of the two beside it.
fn held(u: &[f64]) -> Vec<f64> {
    (0..u.len()).map(|k| 0.5 * (u[k] + u[k.saturating_sub(1)])).collect()
}

/// A series some samples later.
fn late(x: &[f64], by: usize) -> Vec<f64> {
    (0..x.len()).map(|k| x[k.saturating_sub(by)]).collect()
}

/// The value at `x` of what is 1 at knot `j` and 0 at the others, straight between and beyond them.
fn hat(at: &[f64], j: usize, x: f64) -> f64 {
    let i = at.partition_point(|a| *a <= x).clamp(1, at.len() - 1);
    let share = (x - at[i - 1]) / (at[i] - at[i - 1]);
    if i == j {
        share
    } else if i == j + 1 {
        1.0 - share
    } else {
        0.0
    }
}

/// Plants and curves over one argument by the balances of some smoothings, the best of each port, those that foretell best first.
pub(in crate::diagnose) fn curves(balances: &[Balance]) -> Vec<Curved> {
    let other = [CurvePort::SensorOverPosition, CurvePort::TorqueOverMotion];
    best_of(balances, CurvePort::ALL.into_iter().filter(|p| !other.contains(p)))
}

/// The same of a torque over position and velocity.
pub(in crate::diagnose) fn surface(balances: &[Balance]) -> Option<Curved> {
    best_of(balances, [CurvePort::TorqueOverMotion].into_iter()).pop()
}

fn best_of(balances: &[Balance], ports: impl Iterator<Item = CurvePort>) -> Vec<Curved> {
    let linear: Vec<Option<f64>> = balances.iter().map(Balance::linear_left).collect();
    let best = |port: CurvePort| {
        let all = balances.iter().zip(&linear).filter_map(|(b, l)| b.curved(port, (*l)?));
        all.min_by(|a, b| a.share.total_cmp(&b.share))
    };
    let mut all: Vec<Curved> = ports.filter_map(best).collect();
    all.sort_by(|a, b| a.share.total_cmp(&b.share));
    all
}
