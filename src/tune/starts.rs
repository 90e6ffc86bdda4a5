//! Where the search starts: the given controller, loops shaped by rule, loops shaped by seeded strata.
//!
//! A loop is shaped by what an engineer would choose (crossover, lead, integral corner, filters); the gains follow from
//! |L| = 1 at the crossover. Nearly every start is then stable, where random gains nearly never are.

use super::{Bench, Parameter};
use crate::controller::Controller;
use crate::feedback::SampledPlant;
use crate::lti::{FrequencyResponse, Sections};
use crate::numeric::random::Random;
use nalgebra::Complex;
use std::f64::consts::TAU;

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
    notch_depth: f64,
    notch_damping: f64,
}

/// Crossovers tried where the spec names none (Hz): below the first mode of any positioner of this kind, up to its modes.
const CROSSOVER_HZ: [f64; 2] = [100.0, 1500.0];

/// `count` decision vectors: first the base controller if `given`, then two by rule, then strata under `seed`.
pub(super) fn starts(
    bench: &Bench,
    crossover_hz: Option<[f64; 2]>,
    given: bool,
    seed: u64,
    count: usize,
) -> Vec<Vec<f64>> {
    let [low, high] = crossover_hz.unwrap_or(CROSSOVER_HZ);
    let mut all = Vec::with_capacity(count);
    if given {
        all.push(bench.parameters.vector(bench.parameters.base()));
    }
    let plain = Shape {
        crossover_hz: (low * high).sqrt(),
        lead: 1.3,
        integral: 8.0,
        lowpass: 0.8,
        notch_depth: 0.2,
        notch_damping: 0.3,
    };
    for crossover_hz in [plain.crossover_hz, (low * low * high).cbrt()] {
        all.push(shaped(bench, 0, &Shape { crossover_hz, ..plain }, &|m, i| worst_mode(m, crossover_hz, i)));
    }
    let mut random = Random::stream(seed, 11);
    let n = count.saturating_sub(all.len());
    // One stratum of every quantity is used exactly once (Latin hypercube, McKay, Beckman & Conover 1979).
    let mut column = || -> Vec<f64> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, (random.uniform() * (i + 1) as f64) as usize);
        }
        order.into_iter().map(|i| (i as f64 + random.uniform()) / n as f64).collect()
    };
    let columns: Vec<Vec<f64>> = (0..10).map(|_| column()).collect();
    #[allow(clippy::needless_range_loop, reason = "i is the stratum, an index into every column")]
    for i in 0..n {
        let between = |c: usize, from: f64, to: f64| from + (to - from) * columns[c][i];
        let shape = Shape {
            crossover_hz: low * (high / low).powf(columns[0][i]),
            lead: 10f64.powf(between(1, -0.3, 1.5)),
            integral: 10f64.powf(between(2, 0.5, 1.7)),
            lowpass: columns[3][i],
            notch_depth: 10f64.powf(between(4, -1.3, -0.05)),
            notch_damping: 10f64.powf(between(5, -1.1, -0.1)),
        };
        let machine = i % bench.machines.len();
        // Every other start lays its notches on modes, the rest anywhere between their bounds.
        let on_modes = i % 2 == 0;
        all.push(shaped(bench, machine, &shape, &|m, k| {
            if on_modes { worst_mode(m, shape.crossover_hz, k) } else { NotchAt::Share(columns[6 + k % 4][i]) }
        }));
    }
    all.truncate(count.max(1));
    all
}

enum NotchAt {
    Hz(f64),
    /// 0 to 1 between the bounds (ln).
    Share(f64),
}

/// The `k`-th highest peak of |P| w², the plant with its inertia taken out, above half the crossover.
fn worst_mode(m: &SampledPlant, crossover_hz: f64, k: usize) -> NotchAt {
    let w = m.w_rad_s();
    let size = |i: usize| m.value(i).norm() * w[i] * w[i];
    let mut peaks: Vec<(f64, f64)> = (1..w.len() - 1)
        .filter(|&i| w[i] > 0.5 * crossover_hz * TAU && size(i) > size(i - 1) && size(i) >= size(i + 1))
        .map(|i| (size(i), w[i]))
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.get(k).map_or(NotchAt::Share((k as f64 + 1.0) / 4.0), |p| NotchAt::Hz(p.1 / TAU))
}

/// The decision vector of a shaped loop on one machine.
fn shaped(bench: &Bench, machine: usize, s: &Shape, notch: &dyn Fn(&SampledPlant, usize) -> NotchAt) -> Vec<f64> {
    let p = bench.parameters();
    let m = &bench.machines[machine].sampled;
    let mut c = p.base().clone();
    for (parameter, [from, to]) in p.free().iter().zip(p.bounds()) {
        let share = |x: f64| (from + (to - from) * x).exp();
        match *parameter {
            Parameter::LowpassFrequency { filter } => c.lowpass[filter].frequency_hz = share(s.lowpass),
            Parameter::NotchFrequency { filter } => {
                let hz = match notch(m, filter) {
                    NotchAt::Hz(hz) => hz.clamp(from.exp(), to.exp()),
                    NotchAt::Share(x) => share(x),
                };
                c.notch[filter].frequency_hz = hz;
                c.notch[filter].pole_damping_ratio = s.notch_damping;
                c.notch[filter].zero_damping_ratio = s.notch_damping * s.notch_depth;
            }
            _ => {}
        }
    }
    let w = s.crossover_hz * TAU;
    let plant = nearest(m, w);
    // kp (1 + j lead - j/integral) at the crossover, then the size from |L| = 1.
    let unit = Controller {
        pid: crate::controller::Pid { kp: 1.0, ki_per_s: w / s.integral, kd_s: s.lead / w, ..c.pid },
        ..c
    };
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
