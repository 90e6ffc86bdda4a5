//! The quick write and its slopes against the plain simulation: records to rounding, slopes to central differences.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, Feedforward, Lowpass, Notch, Pid};
use servotune::lti::{DiscretePlant, ModalForm, ModalTerm, Section};
use servotune::numeric::random::Random;
use servotune::pes::{
    Asked, Figure, Noise, PesClock, Profile, QuickScene, QuickWork, Runout, Slopes, Spiral, StepScene, StepWork,
    WriteRecord, WriteScene,
};

const T: f64 = 39.6e-6;

fn profile() -> Profile {
    let runout = vec![Runout { order: 3, amplitude: 0.01, phase_deg: 40.0 }];
    Profile {
        spiral: Spiral { velocity: 350.0, distance: 1.0, acceleration_time_s: 2e-3, start_s: 2e-3, duration_s: 0.012 },
        pes: PesClock { sample_rate_hz: 27_480.0, window: [20, 220] },
        noise: Noise {
            encoder_rms: 0.003,
            windage_rms: 1e-3,
            windage_corner_hz: 60.0,
            spindle_hz: 120.0,
            runout,
            seed: 5,
        },
    }
}

fn still(profile: &Profile) -> Profile {
    let mut still = profile.clone();
    (still.noise.encoder_rms, still.noise.windage_rms) = (0.0, 0.0);
    still
}

/// A body with `modes` modes beside it.
fn plant(body: Body, modes: usize, delay_s: f64) -> DiscretePlant {
    let term = |re: f64, im: f64, residue: f64| {
        let residue = if im > 0.0 { Complex::new(0.0, -residue) } else { Complex::new(residue, 0.0) };
        ModalTerm { pole: Complex::new(re, im), residue }
    };
    let (mut terms, mut rigid2, mut rigid1) = (Vec::new(), 0.0, 0.0);
    match body {
        Body::Spring => terms.push(term(-81.0, 360.0, 1.4e4)),
        Body::Rigid => (rigid2, rigid1) = (1e7, -30.0),
        Body::Viscous => terms.extend([term(0.0, 0.0, 1e7 / 300.0), term(-300.0, 0.0, -1e7 / 300.0)]),
        // A magnetic bearing: s² = 200², one pole in the right half-plane.
        Body::Unstable => terms.extend([term(200.0, 0.0, 1e7 / 400.0), term(-200.0, 0.0, -1e7 / 400.0)]),
    }
    // An amplifier, faster than the clock.
    terms.push(term(-1e5, 0.0, 10.0));
    for i in 0..modes {
        let w = 9000.0 + 2500.0 * i as f64;
        terms.push(term(-0.025 * w, w, if i % 2 == 0 { 12.0 } else { -8.0 }));
    }
    DiscretePlant::of_modal(&ModalForm { terms, rigid2, rigid1, delay_s }, T).unwrap()
}

#[derive(Clone, Copy, Debug)]
enum Body {
    Spring,
    Rigid,
    Viscous,
    Unstable,
}

const BODIES: [Body; 4] = [Body::Spring, Body::Rigid, Body::Viscous, Body::Unstable];

fn controller(filters: usize) -> Controller {
    let lowpass = vec![Lowpass { frequency_hz: 7000.0, damping_ratio: 0.7 }; filters.min(2)];
    let notch = |i: usize| Notch {
        frequency_hz: 1522.0 + 1700.0 * i as f64,
        zero_damping_ratio: 0.2,
        pole_damping_ratio: 0.25,
    };
    Controller {
        sample_time_s: T,
        output_limit: Some(0.3),
        pid: Pid { kp: 0.1, ki_per_s: 20.0, kd_s: 1.3e-4, derivative_filter_s: 12e-6 },
        lowpass,
        notch: (0..filters.saturating_sub(2)).map(notch).collect(),
        biquad: vec![],
        feedforward: Some(Feedforward { factor: 0.5, velocity_s: 1e-5, acceleration_s2: 9.8e-8, ahead_samples: 0 }),
    }
}

#[test]
fn both_records_are_the_plain_ones_up_to_rounding() {
    let profile = profile();
    for (body, modes) in BODIES.into_iter().flat_map(|b| [0, 3, 6, 9, 17].map(|m| (b, m))) {
        for (delay_s, limit) in [(0.0, Some(0.02)), (65e-6, None), (130e-6, Some(0.02)), (7.92e-5, None)] {
            let sampled = plant(body, modes, delay_s);
            let c = controller(modes.min(6));
            let chain = c.sections().unwrap().chain;
            let quick = QuickScene::new(&profile, &sampled).unwrap();
            let mut work = QuickWork::default();
            let all = Asked { slopes: false, ..Asked::all() };
            let mut check = |asked: Asked, records: &[(WriteRecord, Profile)]| {
                quick.run(&chain, c.feedforward.as_ref(), limit, asked, &mut work);
                for (record, profile) in records {
                    let scene = WriteScene::new(profile, &sampled).unwrap();
                    let mut plain = scene.workspace(&sampled, chain.len());
                    scene.run(&sampled, &chain, c.feedforward.as_ref(), limit, &mut plain);
                    let expected = scene.window(&plain);
                    assert_eq!(work.window(*record).len(), expected.len());
                    let size = expected.iter().fold(0.0f64, |m, e| m.max(e.abs()));
                    assert!(size.is_finite() && size > 1e-3);
                    // Sums in another order: rounding of positions of order 10 over hundreds of steps. The bearing under its limit may
                    // fall, and falls then by e^(200 t).
                    for (a, b) in work.window(*record).iter().zip(expected) {
                        assert!((a - b).abs() < 1e-10 * (10.0 + size), "{body:?} {modes} {delay_s}: {a} {b}");
                    }
                    let command = work.command(*record);
                    assert!(if asked.whole { command.len() == plain.command.len() } else { command.len() > 200 });
                    for (a, b) in command.iter().zip(&plain.command) {
                        assert!((a - b).abs() < 1e-10 * (1.0 + size), "{body:?} {modes} {delay_s}: {a} {b}");
                    }
                    if asked.whole {
                        let peak = plain.command.iter().fold(0.0f64, |a, u| a.max(u.abs()));
                        assert!((work.peak(*record).1 - peak).abs() < 1e-10 * (1.0 + size));
                    }
                }
            };
            let (drawn, quiet) = ((WriteRecord::Drawn, profile.clone()), (WriteRecord::Still, still(&profile)));
            check(all, &[drawn.clone(), quiet.clone()]);
            check(Asked { still: false, whole: false, ..all }, &[drawn]);
            check(Asked { drawn: false, whole: false, ..all }, &[quiet]);
        }
    }
}

/// A straight figure of the plain simulation: weights on the window and on the command.
fn plain_figure(
    scene: &WriteScene,
    sampled: &DiscretePlant,
    law: (&[Section], [f64; 2], Option<f64>),
    weights: (&[f64], &[f64]),
) -> f64 {
    let mut plain = scene.workspace(sampled, law.0.len());
    let feedforward = Feedforward { factor: 1.0, velocity_s: law.1[0], acceleration_s2: law.1[1], ahead_samples: 0 };
    scene.run(sampled, law.0, Some(&feedforward), law.2, &mut plain);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(scene.window(&plain), weights.0) + dot(&plain.command, weights.1)
}

fn moved(chain: &[Section], section: usize, coefficient: usize, by: f64) -> Vec<Section> {
    let mut chain = chain.to_vec();
    let s = &mut chain[section];
    *[&mut s.b0, &mut s.b1, &mut s.b2, &mut s.a1, &mut s.a2][coefficient] += by;
    chain
}

/// Difference of fourth order.
fn difference(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

fn near(found: &Slopes, expected: &[Vec<f64>], forward: [f64; 2], what: &str) {
    assert_eq!(found.sections.len(), expected.len());
    for (found, expected) in found.sections.iter().zip(expected) {
        let size = expected.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        for (a, b) in found.iter().zip(expected) {
            // The difference: fourth power of h against fifth derivatives; rounding of a sum of order 10, 1e-13, over h = 1e-6.
            assert!((a - b).abs() < 1e-6 * size + 1e-7, "{what}: {found:?} {expected:?}");
        }
    }
    for (a, b) in found.forward.iter().zip(forward) {
        assert!((a - b).abs() < 1e-6 * b.abs() + 1e-7, "{what}: {:?} {forward:?}", found.forward);
    }
}

#[test]
fn slopes_are_those_of_differences_of_the_plain_simulation() {
    let profile = profile();
    let mut random = Random::new(3);
    let mut clipped = 0;
    for filters in 0..6 {
        for (i, body) in BODIES.into_iter().enumerate() {
            let delay_s = [0.0, 65e-6, 130e-6, 7.92e-5][(i + filters) % 4];
            let sampled = plant(body, [0, 3, 7, 10, 14][(i + 2 * filters) % 5], delay_s);
            let c = controller(filters);
            let chain = c.sections().unwrap().chain;
            let quick = QuickScene::new(&profile, &sampled).unwrap();
            let mut work = QuickWork::default();
            let ahead = [1e-5, 5e-8];
            let feedforward = Feedforward { factor: 0.5, velocity_s: 2e-5, acceleration_s2: 1e-7, ahead_samples: 0 };
            // Every other loop meets its limit on the way.
            quick.run(&chain, Some(&feedforward), None, Asked::all(), &mut work);
            let limit = ((i + filters) % 2 == 0).then(|| 0.8 * work.peak(WriteRecord::Drawn).1);
            quick.run(&chain, Some(&feedforward), limit, Asked::all(), &mut work);
            let samples = work.command(WriteRecord::Drawn).len();
            let mut weights = |n: usize| -> Vec<f64> { (0..n).map(|_| random.normal()).collect() };
            let (a, b, c) = (weights(200), weights(200), weights(samples));
            let peak = work.peak(WriteRecord::Drawn).0;
            let figures = [
                Figure { record: WriteRecord::Still, window: &a, command: (0, &[]) },
                Figure { record: WriteRecord::Drawn, window: &b, command: (0, &[]) },
                Figure { record: WriteRecord::Drawn, window: &[], command: (peak, &[1.0]) },
                Figure { record: WriteRecord::Still, window: &b, command: (0, &c) },
                Figure { record: WriteRecord::Drawn, window: &a, command: (100, &c[100..300]) },
            ];
            let mut slopes = Vec::new();
            quick.backward(&chain, &figures, &mut work, &mut slopes);
            for (figure, slopes) in figures.iter().zip(&slopes) {
                let of = if figure.record == WriteRecord::Still { still(&profile) } else { profile.clone() };
                let scene = WriteScene::new(&of, &sampled).unwrap();
                let mut command = vec![0.0; samples];
                command[figure.command.0..][..figure.command.1.len()].copy_from_slice(figure.command.1);
                let value = |chain: &[Section], ahead: [f64; 2]| {
                    plain_figure(&scene, &sampled, (chain, ahead, limit), (figure.window, &command))
                };
                let expected: Vec<Vec<f64>> = (0..chain.len())
                    .map(|s| (0..5).map(|k| difference(|h| value(&moved(&chain, s, k, h), ahead), 1e-6)).collect())
                    .collect();
                let forward = [
                    difference(|h| value(&chain, [ahead[0] + h, ahead[1]]), 1e-9),
                    difference(|h| value(&chain, [ahead[0], ahead[1] + h]), 1e-12),
                ];
                near(slopes, &expected, forward, &format!("{body:?}, {filters} filters, {figure:?}"));
            }
            if let Some(limit) = limit {
                clipped += work.command(WriteRecord::Drawn).iter().filter(|u| u.abs() == limit).count();
            }
        }
    }
    assert!(clipped > 50, "{clipped}");
}

#[test]
fn records_run_apart_have_the_slopes_of_records_run_together() {
    let profile = profile();
    let sampled = plant(Body::Spring, 5, 65e-6);
    let chain = controller(3).sections().unwrap().chain;
    let quick = QuickScene::new(&profile, &sampled).unwrap();
    let weights: Vec<f64> = (0..200).map(|i| (0.1 * f64::from(i)).sin()).collect();
    let figure = |record| Figure { record, window: &weights, command: (0, &[]) };
    let (mut together, mut apart) = (QuickWork::default(), QuickWork::default());
    quick.run(&chain, None, None, Asked::all(), &mut together);
    // Apart, the still record begins with the move, after a longer one has left its traces in the buffers.
    for asked in [Asked { still: false, ..Asked::all() }, Asked { drawn: false, whole: false, ..Asked::all() }] {
        quick.run(&chain, None, None, asked, &mut apart);
    }
    let (mut a, mut b) = (Vec::new(), Vec::new());
    let both = [figure(WriteRecord::Still), figure(WriteRecord::Drawn)];
    quick.backward(&chain, &both, &mut together, &mut a);
    quick.backward(&chain, &both[..1], &mut apart, &mut b);
    let scale = a[0].sections.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    for (x, y) in a[0].sections.iter().flatten().zip(b[0].sections.iter().flatten()) {
        // Lanes beside each other do not mix; sums in blocks that begin elsewhere.
        assert!((x - y).abs() < 1e-12 * scale, "{x} {y}");
    }
    assert!(a[0] != a[1]);
    let mut silent = profile.clone();
    (silent.noise.encoder_rms, silent.noise.windage_rms) = (0.0, 0.0);
    let silent = QuickScene::new(&silent, &sampled).unwrap();
    silent.run(&chain, None, None, Asked { still: false, ..Asked::all() }, &mut apart);
    assert!(!silent.has_noise() && apart.window(WriteRecord::Still) == apart.window(WriteRecord::Drawn));
}

#[test]
fn a_step_is_the_response_of_the_loop_and_has_its_slopes() {
    // The same loop sample by sample: plant and sections as the rest of the crate steps them.
    let plain = |plant: &DiscretePlant, chain: &[Section], limit: f64, samples: usize| {
        use servotune::lti::{PlantState, step_chain};
        let (mut state, mut memory) = (PlantState::at_rest(plant), vec![[0.0; 2]; chain.len()]);
        (0..samples)
            .map(|_| {
                let y = state.position();
                let u = step_chain(chain, &mut memory, 1.0 - y).clamp(-limit, limit);
                state.command(u);
                state.advance(plant);
                [y, u]
            })
            .collect::<Vec<_>>()
    };
    for (i, body) in BODIES.into_iter().enumerate() {
        let sampled = plant(body, 2 * i, [0.0, 65e-6, 3e-5, 1.2e-4][i]);
        let chain = controller(i).sections().unwrap().chain;
        let samples = 300;
        let limit = if i == 2 { Some(1.5) } else { None };
        let scene = StepScene::new(&sampled, samples);
        let mut work = StepWork::default();
        scene.run(&chain, None, limit, samples, &mut work);
        let expected = plain(&sampled, &chain, limit.unwrap_or(f64::INFINITY), samples);
        assert_eq!((work.position.len(), work.command().len()), (samples, samples));
        for ((y, u), [a, b]) in work.position.iter().zip(work.command()).zip(&expected) {
            // Rounding over 300 steps.
            assert!((y - a).abs() < 1e-10 && (u - b).abs() < 1e-9, "{body:?}: {y} {a} {u} {b}");
        }
        let position: Vec<f64> = (0..250).map(|k| (0.05 * f64::from(k)).cos()).collect();
        let command: Vec<f64> = (0..100).map(|k| (0.09 * f64::from(k)).sin()).collect();
        let mut slopes = Slopes::default();
        scene.backward(&chain, &position, &command, &mut work, &mut slopes);
        let value = |chain: &[Section]| {
            let all = plain(&sampled, chain, limit.unwrap_or(f64::INFINITY), samples);
            let of = |weights: &[f64], i: usize| all.iter().zip(weights).map(|(a, w)| a[i] * w).sum::<f64>();
            of(&position, 0) + of(&command, 1)
        };
        let expected: Vec<Vec<f64>> = (0..chain.len())
            .map(|s| (0..5).map(|k| difference(|h| value(&moved(&chain, s, k, h)), 1e-6)).collect())
            .collect();
        near(&slopes, &expected, slopes.forward, &format!("{body:?}"));
    }
}

#[test]
fn the_step_sees_feed_forward_one_sample_ahead() {
    // A plant that is nothing but a delay-free integrator under no feedback: the command is the feed-forward alone.
    let form = ModalForm {
        terms: vec![ModalTerm { pole: Complex::new(0.0, 0.0), residue: Complex::new(1.0, 0.0) }],
        rigid2: 0.0,
        rigid1: 0.0,
        delay_s: 0.0,
    };
    let sampled = DiscretePlant::of_modal(&form, T).unwrap();
    let open = [Section { b0: 0.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0 }];
    let feedforward = Feedforward { factor: 2.0, velocity_s: 3.0, acceleration_s2: 0.0, ahead_samples: 0 };
    let mut work = StepWork::default();
    StepScene::new(&sampled, 10).run(&open, Some(&feedforward), None, 10, &mut work);
    // 6 r' with r' = 1/(2T) for the sample before the step and for its own: 3 T of it at the step, 6 from one sample later on.
    for (k, y) in work.position.iter().enumerate() {
        assert!((y - if k == 0 { 3.0 } else { 6.0 }).abs() < 1e-12, "{k}: {y}");
    }
}
