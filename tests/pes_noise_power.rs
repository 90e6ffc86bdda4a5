//! Expected powers of a closed loop against covariances by a Lyapunov equation, finer grids and differences.
#![allow(clippy::unwrap_used)]

use nalgebra::DMatrix;
use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::feedback::{LoopOnGrid, LoopPower, Magnitude, PowerWork, SampledPlant};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant, Section, Sections, step_chain};
use servotune::numeric::random::Random;
use servotune::pes::{
    ExpectedNoise, Noise, NoisePower, NoisePowerWork, NoiseWork, PesClock, Profile, Spiral, WindowDft, coloured,
    tabulated,
};
use std::f64::consts::TAU;

const T: f64 = 39.6e-6;

fn plant(damping: f64) -> DiscretePlant {
    let mode = |hz: f64, ratio: f64| Mode {
        zero_rad_s: ratio * TAU * hz,
        zero_damping_ratio: damping,
        pole_rad_s: TAU * hz,
        pole_damping_ratio: damping,
    };
    let (position_unit, command_unit) = ("track".into(), "V".into());
    let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
    let modes = vec![mode(1222.0, 0.97), mode(2150.0, 1.05), mode(4200.0, 1.04)];
    let plant =
        Plant { position_unit, command_unit, body, delay_s: 65e-6, resonance_gain: 1.0, modes, physics: vec![] };
    DiscretePlant::of(&plant, T).unwrap()
}

fn chain(gain: f64, notch_hz: f64) -> Vec<Section> {
    let c = Controller {
        sample_time_s: T,
        output_limit: None,
        pid: Pid { kp: 0.27 * gain, ki_per_s: 60.0 * gain, kd_s: 3.7e-4 * gain, derivative_filter_s: 12e-6 },
        lowpass: vec![Lowpass { frequency_hz: 7000.0, damping_ratio: 0.7 }],
        notch: vec![Notch { frequency_hz: notch_hz, zero_damping_ratio: 0.05, pole_damping_ratio: 0.25 }],
        biquad: vec![],
        feedforward: None,
    };
    c.sections().unwrap().chain
}

fn profile(encoder_rms: f64, windage_rms: f64) -> Profile {
    Profile {
        spiral: Spiral { velocity: 350.0, distance: 15.0, acceleration_time_s: 2e-3, start_s: 8e-3, duration_s: 0.06 },
        pes: PesClock { sample_rate_hz: 27_480.0, window: [200, 400] },
        noise: Noise { encoder_rms, windage_rms, windage_corner_hz: 60.0, seed: 1, ..Noise::default() },
    }
}

/// The closed loop under noise: transition, stationary covariance, position's row, covariances of position and command.
struct Stationary {
    a: DMatrix<f64>,
    p: DMatrix<f64>,
    position: DMatrix<f64>,
    variances: [f64; 2],
}

/// What one unit of a state or a noise leads to: the next state, the position, the command.
type Columns = (Vec<f64>, f64, f64);

/// The sum of A^k B Bᵀ A^kᵀ, by doubling, solves the Lyapunov equation of the matrices that the simulation's own step has.
fn stationary(plant: &DiscretePlant, chain: &[Section], noise: &Noise) -> Stationary {
    let form = plant.real_form();
    let (n, d) = (form.output.len(), plant.whole_delay_samples());
    let order = n + (d + 1) + 2 * chain.len() + 1;
    let keep = (-TAU * noise.windage_corner_hz * T).exp();
    // One sample of everything, for a state and the two fresh draws: next state, position, command.
    let step = |x: &[f64], fresh: [f64; 2]| -> (Vec<f64>, f64, f64) {
        let (state, line) = (&x[..n], &x[n..n + d + 1]);
        let mut memory: Vec<[f64; 2]> = x[n + d + 1..order - 1].chunks(2).map(|m| [m[0], m[1]]).collect();
        let windage = x[order - 1];
        let y: f64 = form.output.iter().zip(state).map(|(c, x)| c * x).sum();
        let u = step_chain(chain, &mut memory, -(y + noise.encoder_rms * fresh[0]));
        // u[k], u[k-1], ...
        let commands: Vec<f64> = std::iter::once(u + windage).chain(line.iter().copied()).collect();
        let mut next: Vec<f64> = (0..n)
            .map(|i| {
                let moved: f64 = (0..n).map(|j| form.state[(i, j)] * state[j]).sum();
                moved + form.now[i] * commands[d] + form.before[i] * commands[d + 1]
            })
            .collect();
        next.extend(&commands[..d + 1]);
        next.extend(memory.iter().flatten());
        next.push(keep * windage + (1.0 - keep * keep).sqrt() * noise.windage_rms * fresh[1]);
        (next, y, u)
    };
    let unit = |i: usize| -> Vec<f64> { (0..order).map(|j| f64::from(u8::from(i == j))).collect() };
    let columns: Vec<_> = (0..order).map(|i| step(&unit(i), [0.0; 2])).collect();
    let fresh: Vec<_> = [[1.0, 0.0], [0.0, 1.0]].map(|f| step(&vec![0.0; order], f)).into();
    let once = DMatrix::from_fn(order, order, |i, j| columns[j].0[i]);
    let mut a = once.clone();
    let b = DMatrix::from_fn(order, 2, |i, j| fresh[j].0[i]);
    let mut p = &b * b.transpose();
    for _ in 0..40 {
        p += &a * &p * a.transpose();
        a = &a * &a;
    }
    let row = |of: fn(&Columns) -> f64| {
        let c = DMatrix::from_fn(1, order, |_, j| of(&columns[j]));
        (&c * &p * c.transpose())[(0, 0)] + fresh.iter().map(|f| of(f).powi(2)).sum::<f64>()
    };
    let variances = [row(|x| x.1), row(|x| x.2)];
    Stationary { position: DMatrix::from_fn(1, order, |_, j| columns[j].1), a: once, p, variances }
}

#[test]
fn variances_are_those_of_the_lyapunov_equation() {
    for (gain, notch_hz, damping) in [(1.0, 1222.0, 0.03), (0.6, 2150.0, 0.02), (1.5, 1222.0, 0.03)] {
        let (plant, chain) = (plant(damping), chain(gain, notch_hz));
        let grid = SampledPlant::of_model(&plant);
        let mut on = LoopOnGrid::default();
        grid.judge(&chain, &mut on);
        assert_eq!(on.quick.unstable_poles, 0);
        for (encoder, windage) in [(0.003, 0.0), (0.0, 2e-4), (0.003, 2e-4)] {
            let profile = profile(encoder, windage);
            let noise = NoisePower::of(&profile, &grid, &WindowDft::new(200, 27_480.0, vec![5])).unwrap();
            let found = [noise.position.variance(&on), noise.command.variance(&on)];
            let exact = stationary(&plant, &chain, &profile.noise).variances;
            for (a, b) in found.iter().zip(exact) {
                // What the quadrature promises.
                assert!(
                    (a / b - 1.0).abs() < 1e-3,
                    "{gain} {encoder} {windage}: {found:?} {exact:?}, Ms {}",
                    on.quick.max_sensitivity()
                );
            }
        }
    }
}

#[test]
fn the_quadrature_agrees_with_a_grid_a_hundred_times_finer() {
    let mut r = Random::new(12);
    let (hz, psd) = ([20.0, 100.0, 700.0, 4000.0], [1e-9, 1e-7, 1e-10, 1e-12]);
    let (mut seen, mut sharp) = (0, 0.0f64);
    while seen < 25 {
        let plant = plant(r.between(0.004, 0.04));
        let chain = chain(r.between(0.4, 1.8), r.between(1000.0, 4500.0));
        let grid = SampledPlant::of_model(&plant);
        let mut on = LoopOnGrid::default();
        grid.judge(&chain, &mut on);
        if on.quick.unstable_poles != 0 || on.quick.max_sensitivity() > 3.5 {
            continue;
        }
        seen += 1;
        sharp = sharp.max(on.quick.max_sensitivity());
        let sections = Sections { chain: chain.clone(), sample_time_s: T };
        let fine = |through: Magnitude, density: &dyn Fn(f64) -> f64| {
            // Midpoints of equal steps in ln w between the grid's own points.
            let w = grid.w_rad_s();
            let piece = |i: usize| -> f64 {
                (0..100)
                    .map(|k| {
                        let edge = |k: f64| w[i] * (w[i + 1] / w[i]).powf(k / 100.0);
                        let at = edge(f64::from(k) + 0.5);
                        let (p, c) = (plant.at(at), sections.at(at));
                        let s = 1.0 / (1.0 + p * c);
                        let size = match through {
                            Magnitude::PS => p * s,
                            Magnitude::T => p * c * s,
                            Magnitude::CS => c * s,
                            _ => s,
                        };
                        size.norm_sqr() * density(at / TAU) * (edge(f64::from(k) + 1.0) - edge(f64::from(k))) / TAU
                    })
                    .sum()
            };
            (0..w.len() - 1).map(piece).sum::<f64>()
        };
        let (windage, table) = (coloured(2e-4, 60.0, T), tabulated(&hz, &psd));
        let cases: [(Magnitude, &dyn Fn(f64) -> f64); 5] = [
            (Magnitude::PS, &windage),
            (Magnitude::PS, &table),
            (Magnitude::T, &|_| 1.0),
            (Magnitude::CS, &|_| 1.0),
            (Magnitude::S, &|_| 1.0),
        ];
        for (through, density) in cases {
            let mut power = LoopPower::on(&grid);
            power.add(&grid, through, density);
            let (found, exact) = (power.variance(&on), fine(through, density));
            assert!(
                (found / exact - 1.0).abs() < 1e-3,
                "{through:?}: {found} {exact}, Ms {}",
                on.quick.max_sensitivity()
            );
        }
    }
    assert!(sharp > 2.0, "{sharp}");
}

#[test]
fn bins_are_those_of_the_autocovariance() {
    // A servo clock that is the controller's: there the window sees exactly the sampled position.
    let (plant, chain) = (plant(0.03), chain(1.0, 1222.0));
    let (mut profile, bins, n) = (profile(0.003, 2e-4), vec![1, 5, 9, 13, 21], 200);
    profile.pes.sample_rate_hz = 1.0 / T;
    let dft = WindowDft::new(n, 1.0 / T, bins.clone());
    let grid = SampledPlant::of_model(&plant);
    let mut on = LoopOnGrid::default();
    grid.judge(&chain, &mut on);
    let noise = NoisePower::of(&profile, &grid, &dft).unwrap();
    let mut found = Vec::new();
    noise.bins(&on, &mut NoisePowerWork::default(), &mut found);
    let older = ExpectedNoise::of(&profile, T, plant.integrators(), &plant, &dft).unwrap();
    let mut amplitude = vec![0.0; bins.len()];
    older.add(&chain, &mut NoiseWork::default(), &mut amplitude);
    let Stationary { a, p, position, .. } = stationary(&plant, &chain, &profile.noise);
    let mut column = &p * position.transpose();
    let mut covariance = Vec::new();
    for _ in 0..n {
        covariance.push((&position * &column)[(0, 0)]);
        column = &a * column;
    }
    for ((a, b), k) in found.iter().zip(&amplitude).zip(bins) {
        // E|X|²/N² = Σ (N - |m|) R(m) cos(2 pi k m/N) / N².
        let lag = |m: usize| {
            let turn = (TAU * (k * m) as f64 / n as f64).cos();
            (if m == 0 { 1.0 } else { 2.0 }) * (n - m) as f64 * covariance[m] * turn
        };
        let exact = (0..n).map(lag).sum::<f64>() / (n * n) as f64;
        assert!((a / exact - 1.0).abs() < 1e-3, "{k}: {a} {exact}");
        // The older grid is coarser below the bins, where the density is steep.
        assert!((b * b / exact - 1.0).abs() < 0.03, "{k}: {} {exact}", b * b);
    }
}

#[test]
fn slopes_are_those_of_differences() {
    let (plant, chain) = (plant(0.03), chain(1.0, 1222.0));
    let profile = profile(0.003, 2e-4);
    let dft = WindowDft::new(200, 27_480.0, vec![5, 9]);
    let grid = SampledPlant::of_model(&plant);
    let noise = NoisePower::of(&profile, &grid, &dft).unwrap();
    let (bins, weights) = ([3.0, -1.0], [0.7, 1e-3]);
    let figure = |chain: &[Section]| {
        let (mut on, mut powers) = (LoopOnGrid::default(), Vec::new());
        grid.close(chain, &mut on);
        noise.bins(&on, &mut NoisePowerWork::default(), &mut powers);
        bins[0] * powers[0]
            + bins[1] * powers[1]
            + weights[0] * noise.position.variance(&on)
            + weights[1] * noise.command.variance(&on)
    };
    let mut on = LoopOnGrid::default();
    grid.close(&chain, &mut on);
    let (mut work, mut found) = (NoisePowerWork::default(), Vec::new());
    noise.slopes(&grid, &chain, &on, &bins, weights, &mut work, &mut found);
    let mut alone = Vec::new();
    noise.position.slopes(&grid, &chain, &on, &mut PowerWork::default(), &mut alone);
    assert!(alone.len() == chain.len() && alone != found);
    for s in 0..chain.len() {
        let expected: Vec<f64> = (0..5)
            .map(|k| {
                let at = |h: f64| {
                    let mut chain = chain.clone();
                    let c = &mut chain[s];
                    *[&mut c.b0, &mut c.b1, &mut c.b2, &mut c.a1, &mut c.a2][k] += h;
                    figure(&chain)
                };
                let h = 1e-7;
                (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
            })
            .collect();
        let size = expected.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for (a, b) in found[s].iter().zip(&expected) {
            // Rounding of 1e-15 over h, as a share; the slopes of a PID section are a hundred times the figure and more.
            assert!((a - b).abs() < 1e-5 * size, "{s}: {:?} {expected:?}", found[s]);
        }
    }
}
