//! Convex-concave steps over the PID gains: with the filters as they stand the loop is linear in the gains, on every machine at once.
//!
//! At every point of the grid |1 + L| >= 1/Ms and |L| >= 1 below the crossover's range have a concave side; there they are replaced by the half-plane that
//! touches at the present L, which lies inside the limit. |L| <= 1 above the range and the norms over the DFT's bins are cones as they are. Every step
//! is a second-order-cone programme (clarabel); it is taken where the candidate's own score is better. Source: Hast, Åström, Bernhardsson, Boyd,
//! ECC 2013 (PID design by convex-concave optimization).

use super::limit::cone::{Answer, Programme};
use super::linear::{Linear, linearise};
use super::polish::Polished;
use super::requirements::Requirement;
use super::{Bench, Desk, Parameter, What};
use crate::controller::Pid;
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Radius of the first step (share of each gain), and the one at which no better step is looked for.
const FIRST_RADIUS: f64 = 0.3;
const LAST_RADIUS: f64 = 1e-4;
/// Gain of merit that is worth another step.
const WORTHLESS: f64 = 1e-6;
/// Price of the largest violation.
const PRICE: f64 = 100.0;
/// Step of the differences of the bins' amplitudes, ln of a gain.
const STEP: f64 = 1e-5;
/// Points where |1 + L| is above this many times 1/Ms cannot become active in one step.
const FAR: f64 = 3.0;
/// And points where |L| is below this cannot reach 1.
const LOW: f64 = 0.4;

/// The gains of a candidate: their places in the decision vector and the response of each over that of all three.
struct Gains {
    places: Vec<usize>,
    parts: Vec<Pid>,
}

impl Gains {
    fn of(bench: &Bench, desk: &Desk) -> Gains {
        let own = desk.controller.pid;
        let none = Pid { kp: 0.0, ki_per_s: 0.0, kd_s: 0.0, ..own };
        let (mut places, mut parts) = (Vec::new(), Vec::new());
        for (i, p) in bench.parameters().free().iter().enumerate() {
            let part = match p {
                Parameter::Kp => Pid { kp: own.kp, ..none },
                Parameter::Ki => Pid { ki_per_s: own.ki_per_s, ..none },
                Parameter::Kd => Pid { kd_s: own.kd_s, ..none },
                _ => continue,
            };
            places.push(i);
            parts.push(part);
        }
        Gains { places, parts }
    }
}

/// Steps from `x`, `steps` programmes at most; none where nothing is gained.
pub(super) fn gains(bench: &Bench, x: &[f64], steps: usize, desk: &mut Desk) -> Option<Polished> {
    let mut x = x.to_vec();
    let mut here = linearise(bench, &x, desk)?;
    let first = here.score;
    let mut radius = FIRST_RADIUS;
    let mut fresh = true;
    let mut programme = None;
    for _ in 0..steps {
        if radius < LAST_RADIUS {
            break;
        }
        if fresh {
            programme = build(bench, &x, &here, desk);
        }
        let (p, g) = programme.as_mut()?;
        p.ball.1 = radius;
        let Answer::Found { x: step, .. } = p.solve() else { break };
        let mut trial = x.clone();
        for (at, d) in g.places.iter().zip(&step) {
            let [from, to] = bench.parameters().bounds()[*at];
            trial[*at] = (trial[*at] + (1.0 + d).max(0.05).ln()).clamp(from, to);
        }
        let score = bench.score(&trial, desk);
        let gained = here.score.merit(PRICE) - score.merit(PRICE);
        fresh = gained > 0.0;
        if !fresh {
            radius *= 0.3;
            continue;
        }
        x = trial;
        let Some(there) = linearise(bench, &x, desk) else { break };
        here = there;
        if gained < WORTHLESS {
            break;
        }
    }
    let better = here.score.merit(PRICE) < first.merit(PRICE);
    better.then_some(Polished { x, score: here.score })
}

/// The programme around a candidate. Variables: relative steps of the gains, then the objective over its present value, the largest violation, and both
/// norms of each machine over their present weighted sum.
fn build(bench: &Bench, x: &[f64], here: &Linear, desk: &mut Desk) -> Option<(Programme, Gains)> {
    let amplitudes = bins(bench, x, desk)?;
    bench.score(x, desk);
    let g = Gains::of(bench, desk);
    let count = g.places.len();
    if count == 0 {
        return None;
    }
    let machines = bench.machines.len();
    let n = count + 2 + 2 * machines;
    let (objective, violation) = (count, count + 1);
    let mut p = Programme { cost: vec![0.0; n], ball: (count, FIRST_RADIUS), top: 1e6, ..Programme::default() };
    p.cost[objective] = 1.0;
    p.cost[violation] = PRICE;
    let blank = || vec![0.0; n + 1];
    let unit = |j: usize, k: f64, constant: f64| {
        let mut row = blank();
        row[j] = k;
        row[n] = constant;
        row
    };
    p.half_spaces.push(unit(violation, 1.0, 0.0));
    for (j, at) in g.places.iter().enumerate() {
        let [from, to] = bench.parameters().bounds()[*at];
        p.half_spaces.push(unit(j, 1.0, 1.0 - (from - x[*at]).exp()));
        p.half_spaces.push(unit(j, -1.0, (to - x[*at]).exp() - 1.0));
    }
    // Phase, gain and named crossing: straight lines, as in the other polish; Ms at its dips between the grid's points too.
    for r in &here.rows {
        let mut row = unit(violation, 1.0, -r.value);
        for (j, at) in g.places.iter().enumerate() {
            row[j] = -r.gradient.get(*at).copied().unwrap_or(0.0);
        }
        p.half_spaces.push(row);
    }
    let scale = here.score.objective.exp();
    for (m, (amplitude, slopes)) in amplitudes.iter().enumerate() {
        let [low, high] = [0, 1].map(|i| count + 2 + 2 * m + i);
        let mut row = unit(objective, 1.0, 0.0);
        row[low] = -bench.weight_low;
        row[high] = -bench.weight_high;
        p.half_spaces.push(row);
        let dft = bench.machines[m].dft();
        for (norm, band) in [(low, LOW_BAND_HZ), (high, HIGH_BAND_HZ)] {
            let mut cone = vec![unit(norm, 1.0, 0.0)];
            for i in dft.inside(band) {
                let mut row = blank();
                for (j, d) in slopes.iter().enumerate() {
                    row[j] = d[i] / scale;
                }
                row[n] = amplitude[i] / scale;
                cone.push(row);
            }
            p.cones.push(cone);
        }
        for w in &bench.aimed[m] {
            let norm = match w.what {
                What::DftLow => low,
                What::DftHigh => high,
                _ => continue,
            };
            let mut row = unit(norm, -1.0, w.limit / scale);
            row[violation] = w.limit / scale;
            p.half_spaces.push(row);
        }
        margins(bench, desk, m, &g, &mut p);
    }
    Some((p, g))
}

/// Ms and the range of the crossover on the grid of one machine.
fn margins(bench: &Bench, desk: &Desk, m: usize, g: &Gains, p: &mut Programme) {
    let n = p.cost.len();
    let violation = g.places.len() + 1;
    let aimed = &bench.aimed[m];
    let limit = |what: What, side: super::Side| -> Option<&Requirement> {
        aimed.iter().find(|w| w.what == what && w.side == side)
    };
    let least = limit(What::MaxSensitivity, super::Side::AtMost).map(|w| 1.0 / w.limit);
    let from = limit(What::GainCrossover, super::Side::AtLeast).map_or(0.0, |w| TAU * w.limit);
    let to = limit(What::GainCrossover, super::Side::AtMost).map_or(f64::INFINITY, |w| TAU * w.limit);
    let plant = &bench.machines[m].sampled;
    let on = &desk.buffers[m].on;
    let t = plant.sample_time_s();
    let all = desk.controller.pid.section(t);
    for (i, w) in plant.w_rad_s().iter().enumerate() {
        let l = Complex::new(on.re[i], on.im[i]);
        let (size, away) = (l.norm(), (1.0 + l).norm());
        let near = least.is_some_and(|least| away < FAR * least);
        let below = *w < from && (1.0..1.0 / LOW).contains(&size);
        let above = *w > to && size <= 1.0 && size > LOW;
        if !(near || below || above) {
            continue;
        }
        let back = Complex::from_polar(1.0, -w * t);
        let c = all.at_delay(back);
        let parts: Vec<Complex<f64>> = g.parts.iter().map(|part| l * part.section(t).at_delay(back) / c).collect();
        // The part of constant + Σ part d along a direction.
        let along = |direction: Complex<f64>, constant: Complex<f64>| {
            let mut row = vec![0.0; n + 1];
            for (j, part) in parts.iter().enumerate() {
                row[j] = (direction.conj() * part).re;
            }
            row[n] = (direction.conj() * constant).re;
            row
        };
        if let Some(least) = least.filter(|_| near) {
            let mut row = along((1.0 + l) / away, 1.0 + l);
            row[n] -= least;
            row[violation] = least;
            p.half_spaces.push(row);
        }
        if below {
            let mut row = along(l / size, l);
            row[n] -= 1.0;
            row[violation] = 1.0;
            p.half_spaces.push(row);
        }
        if above {
            let mut bound = vec![0.0; n + 1];
            bound[n] = 1.0;
            bound[violation] = 1.0;
            p.cones.push(vec![bound, along(Complex::new(1.0, 0.0), l), along(Complex::new(0.0, 1.0), l)]);
        }
    }
}

/// Amplitudes of the bins, and how they change with a relative step of each gain.
type Amplitudes = (Vec<f64>, Vec<Vec<f64>>);

/// The bins of every machine around `x`.
fn bins(bench: &Bench, x: &[f64], desk: &mut Desk) -> Option<Vec<Amplitudes>> {
    let read = |desk: &Desk| desk.buffers.iter().map(|b| b.amplitude().to_vec()).collect::<Vec<_>>();
    if bench.score(x, desk).violation >= super::bench::UNSTABLE {
        return None;
    }
    let mut all: Vec<Amplitudes> = read(desk).into_iter().map(|a| (a, Vec::new())).collect();
    let places = Gains::of(bench, desk).places;
    let mut moved = x.to_vec();
    for at in places {
        moved[at] = x[at] + STEP;
        if bench.score(&moved, desk).violation >= super::bench::UNSTABLE {
            return None;
        }
        moved[at] = x[at];
        for ((here, slopes), there) in all.iter_mut().zip(read(desk)) {
            slopes.push(there.iter().zip(here.iter()).map(|(a, b)| (a - b) / STEP).collect());
        }
    }
    Some(all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::Plant;
    use crate::tune::{Machine, Parameters, Spec};
    use crate::twin::{MachineClass, nominal_controller, paper_machine};

    fn bench(plants: &[Plant]) -> Bench {
        let (limits, profile) =
            (include_str!("../../specs/limits/paper.toml"), include_str!("../../specs/profiles/spiral.toml"));
        let spec = Spec::parse(limits, profile).unwrap();
        let machines: Vec<Machine<'_>> = plants.iter().map(Machine::Model).collect();
        let start = nominal_controller().unwrap();
        Bench::new(&machines, &spec, Parameters::of(&spec, Some(&start), start.sample_time_s)).unwrap()
    }

    /// The truth is a search of the three gains on a grid of its own: where the steps end no neighbour is better by more than its own step shows.
    #[test]
    fn the_steps_end_where_no_neighbouring_gains_are_better() {
        let plants = [MachineClass::Healthy, MachineClass::Tunable].map(|c| paper_machine(c).unwrap());
        for plants in [&plants[..1], &plants[..]] {
            let bench = bench(plants);
            let mut desk = bench.desk();
            let x = bench.parameters().vector(&nominal_controller().unwrap());
            let before = bench.score(&x, &mut desk);
            let end = gains(&bench, &x, 60, &mut desk).unwrap();
            assert!(end.score.merit(PRICE) < before.merit(PRICE), "{before:?} {:?}", end.score);
            // Filters stand still.
            let places = Gains::of(&bench, &desk).places;
            assert!((0..x.len()).all(|i| places.contains(&i) || x[i] == end.x[i]));
            for step in [0.05, 0.01] {
                for at in 0..27 {
                    let mut near = end.x.clone();
                    for (i, place) in places.iter().enumerate() {
                        near[*place] += step * f64::from(at / 3i32.pow(i as u32) % 3 - 1);
                    }
                    let bounds = bench.parameters().bounds();
                    near.iter_mut().zip(bounds).for_each(|(x, [from, to])| *x = x.clamp(*from, *to));
                    let gained = end.score.merit(PRICE) - bench.score(&near, &mut desk).merit(PRICE);
                    assert!(gained < 2e-3, "{step} {at}: {gained}");
                }
            }
        }
    }
}
