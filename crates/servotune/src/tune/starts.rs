//! Where the search starts: given controllers, loops shaped by rule, loops shaped by seeded strata.
//!
//! A loop is shaped by what an engineer would choose (crossover, lead, integral corner, filters); the gains follow from
//! |L| = 1 at the crossover. Nearly every start is then stable, where random gains nearly never are.

use super::{TunedNumber, TuningProblem};
use crate::controller::Controller;
use crate::feedback::SampledPlant;
use crate::lti::{FrequencyResponse, Sections};
use crate::numeric::random::Random;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Numbers that a loop is shaped by, each from 0 to 1.
const SHARES: usize = 15;
/// Notches that have shares of their own; further ones take them again.
const NOTCHES: usize = 4;

/// What a shaped loop is made from.
#[derive(Clone, Copy, Debug)]
struct Shape {
    crossover_hz: f64,
    /// Derivative over proportional part at the crossover, the tangent of the lead.
    lead: f64,
    /// Crossover over the integral's corner.
    integral: f64,
    /// Where a low-pass lies, 0 to 1 between its bounds (ln).
    lowpass: f64,
    notch_depth: [f64; NOTCHES],
    notch_damping: [f64; NOTCHES],
    /// Where other numbers lie between their bounds (ln).
    other: f64,
    notch: [Place; NOTCHES],
}

/// Where a notch lies.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// On the plant's mode of this rank, the worst first.
    Mode(usize),
    /// This share of the way between its bounds (ln).
    At(f64),
}

/// How the notches of one start are laid.
#[derive(Clone, Copy, Debug)]
enum Laying {
    /// On the worst modes, one each.
    Modes,
    /// Anywhere.
    Anywhere,
    /// Each on a mode or anywhere, two perhaps on one.
    Mixed,
}

impl Laying {
    const ALL: [Laying; 3] = [Laying::Modes, Laying::Anywhere, Laying::Mixed];

    fn place(self, notch: usize, share: f64) -> Place {
        match self {
            Laying::Modes => Place::Mode(notch),
            Laying::Mixed if share < 0.5 => Place::Mode((2.0 * share * NOTCHES as f64) as usize),
            Laying::Mixed => Place::At(2.0 * share - 1.0),
            Laying::Anywhere => Place::At(share),
        }
    }
}

/// `count` decision vectors or more: the given ones, two by rule, then strata under `seed`.
pub(super) fn starts(problem: &TuningProblem, given: &[Vec<f64>], seed: u64, count: usize) -> Vec<Vec<f64>> {
    let [low, high] = problem.parameters.ranges().crossover_hz;
    let mut all = given.to_vec();
    let plain = Shape {
        crossover_hz: (low * high).sqrt(),
        lead: 1.3,
        integral: 8.0,
        lowpass: 0.8,
        notch_depth: [0.2; NOTCHES],
        notch_damping: [0.3; NOTCHES],
        other: 0.5,
        notch: std::array::from_fn(Place::Mode),
    };
    for crossover_hz in [plain.crossover_hz, (low * low * high).cbrt()] {
        all.push(shaped(problem, 0, &Shape { crossover_hz, ..plain }));
    }
    let mut random = Random::stream(seed, 11);
    let n = (count + given.len()).saturating_sub(all.len());
    // One stratum of every quantity is used exactly once (Latin hypercube, McKay, Beckman & Conover 1979).
    let mut column = || -> Vec<f64> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, (random.uniform() * (i + 1) as f64) as usize);
        }
        order.into_iter().map(|i| (i as f64 + random.uniform()) / n as f64).collect()
    };
    let columns: [Vec<f64>; SHARES] = std::array::from_fn(|_| column());
    let row = |i: usize| std::array::from_fn(|c| columns[c][i]);
    for i in 0..n {
        let shape = Shape::of(problem, &row(i), Laying::ALL[i % 3]);
        all.push(shaped(problem, i % problem.machines.len(), &shape));
    }
    all
}

/// One more shaped loop.
pub(super) fn further(problem: &TuningProblem, random: &mut Random) -> Vec<f64> {
    let shares = std::array::from_fn(|_| random.uniform());
    let laying = Laying::ALL[((random.uniform() * 3.0) as usize).min(2)];
    shaped(problem, 0, &Shape::of(problem, &shares, laying))
}

impl Shape {
    fn of(problem: &TuningProblem, share: &[f64; SHARES], laying: Laying) -> Shape {
        let [low, high] = problem.parameters.ranges().crossover_hz;
        let between = |c: usize, from: f64, to: f64| from + (to - from) * share[c];
        // Of one share and one of the notch's, so that each is uniform.
        let spread = |c: usize, k: usize, from: f64, to: f64| {
            from + (to - from) * (share[c] + share[11 + (k + c) % NOTCHES]).fract()
        };
        Shape {
            crossover_hz: low * (high / low).powf(share[0]),
            // Some loops lead by notches alone, or rise by the integral alone.
            lead: 10f64.powf(if share[1] < 0.2 { -2.7 + 10.0 * share[1] } else { between(1, -1.2, 1.7) }),
            integral: 10f64.powf(between(2, -0.3, 2.4)),
            lowpass: share[3],
            // Each notch has a depth and a width of its own: one may hide a narrow mode, another turn the phase over an octave.
            notch_depth: std::array::from_fn(|k| 10f64.powf(spread(4, k, -1.5, -0.05))),
            notch_damping: std::array::from_fn(|k| 10f64.powf(spread(5, k, -1.3, -0.1))),
            other: share[6],
            notch: std::array::from_fn(|k| laying.place(k, share[7 + k])),
        }
    }
}

/// The `k`-th highest peak of |P| w², the plant with its inertia taken out, above half the crossover (Hz).
fn worst_mode(m: &SampledPlant, crossover_hz: f64, k: usize) -> Option<f64> {
    let w = m.w_rad_s();
    let size = |i: usize| m.value(i).norm() * w[i] * w[i];
    let mut peaks: Vec<(f64, f64)> = (1..w.len() - 1)
        .filter(|&i| w[i] > 0.5 * crossover_hz * TAU && size(i) > size(i - 1) && size(i) >= size(i + 1))
        .map(|i| (size(i), w[i]))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.get(k).map(|p| p.1 / TAU)
}

/// The decision vector of a shaped loop on one machine.
fn shaped(problem: &TuningProblem, machine: usize, s: &Shape) -> Vec<f64> {
    let p = problem.parameters();
    let m = &problem.machines[machine].sampled;
    let mut c = p.base().clone();
    for (parameter, [from, to]) in p.free().iter().zip(p.bounds()) {
        let share = |x: f64| (from + (to - from) * x).exp();
        match *parameter {
            TunedNumber::LowpassFrequency { filter } => c.lowpass[filter].frequency_hz = share(s.lowpass),
            TunedNumber::DerivativeFilter => c.pid.derivative_filter_s = share(s.other),
            TunedNumber::NotchFrequency { filter } => {
                let mode = |k: usize| worst_mode(m, s.crossover_hz, k).map(|hz| hz.clamp(from.exp(), to.exp()));
                let hz = match s.notch[filter % NOTCHES] {
                    Place::At(x) => share(x),
                    Place::Mode(k) => mode(k).unwrap_or_else(|| share((filter as f64 + 1.0) / 4.0)),
                };
                c.notch[filter].frequency_hz = hz;
            }
            TunedNumber::NotchPoleDamping { filter } => {
                // A range beyond a notch's own is a peak filter's.
                let damping = if to.exp() > 0.5 { s.notch_damping[filter % NOTCHES] } else { share(s.other) };
                c.notch[filter].pole_damping_ratio = damping.clamp(from.exp(), to.exp());
            }
            _ => {}
        }
    }
    for (parameter, [from, to]) in p.free().iter().zip(p.bounds()) {
        if let TunedNumber::NotchDepth { filter } = *parameter {
            let depth =
                if *to > 0.0 { (from + 0.3 * (to - from) * s.other).exp() } else { s.notch_depth[filter % NOTCHES] };
            c.notch[filter].zero_damping_ratio = depth * c.notch[filter].pole_damping_ratio;
        }
    }
    let w = s.crossover_hz * TAU;
    let plant = nearest(m, w);
    // kp (1 + j lead - j/integral) at the crossover, then the size from |L| = 1.
    let unit = Controller {
        pid: crate::controller::Pid { kp: 1.0, ki_per_s: w / s.integral, kd_s: s.lead / w, ..c.pid },
        ..c
    };
    // Kinds without an integral or a derivative drop it here.
    let unit = p.controller(&p.vector_outside(&unit));
    let mut chain = Vec::new();
    super::parameters::chain_of(&unit, &mut chain);
    let response = Sections { chain, sample_time_s: unit.sample_time_s }.at(w);
    let gain = 1.0 / (plant * response).norm();
    let mut c = unit;
    c.pid.kp *= gain;
    c.pid.ki_per_s *= gain;
    c.pid.kd_s *= gain;
    p.vector(&c)
}

fn nearest(m: &SampledPlant, w: f64) -> Complex<f64> {
    let i = m.w_rad_s().partition_point(|x| *x < w).min(m.w_rad_s().len() - 1);
    m.value(i)
}

/// Starts drawn for each one that is polished; scoring one costs a hundredth of polishing it.
pub(super) const SCREENED: usize = 6;

/// Starts that are drawn for one further polish.
pub(super) const DRAWN: usize = SCREENED;
