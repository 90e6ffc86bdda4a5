//! The search's margins against the exact ones, on machines of several clocks and random filters.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::feedback::{
    CurveLimit, CurveSide, LoopOnGrid, Magnitude, ModelLoop, SampledPlant, closed_loop_bandwidth, margins,
};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant, PlantFile, Section, Sections};
use servotune::numeric::random::Random;
use std::f64::consts::TAU;
use std::path::Path;

fn mode(hz: f64, ratio: f64, damping: f64) -> Mode {
    let w = TAU * hz;
    Mode { zero_rad_s: ratio * w, zero_damping_ratio: damping, pole_rad_s: w, pole_damping_ratio: damping }
}

/// Plant, sample time and where its loops cross (Hz).
fn machines() -> Vec<(&'static str, Plant, f64, f64)> {
    let build = |body, delay_s, modes| {
        let (position_unit, command_unit) = ("um".into(), "A".into());
        Plant { position_unit, command_unit, body, delay_s, resonance_gain: 1.0, modes, physics: vec![] }
    };
    let stage = Body::FreeInertia { acceleration_gain: 2e6, viscous_rate_per_s: 0.0 };
    let galvo = Body::SecondOrder { dc_gain: 20.0, natural_frequency_rad_s: 60.0, damping_ratio: 0.1 };
    let vcm = Body::SecondOrder { dc_gain: 100.0, natural_frequency_rad_s: 250.0, damping_ratio: 0.3 };
    let mut all = vec![
        ("stage", build(stage.clone(), 1.2e-4, vec![mode(310.0, 0.9, 0.01), mode(840.0, 1.05, 0.01)]), 1e-4, 40.0),
        ("galvo", build(galvo, 4e-6, vec![mode(14_000.0, 1.05, 0.004), mode(29_000.0, 0.9, 0.006)]), 1e-5, 1500.0),
        (
            "vcm",
            build(vcm, 1e-5, vec![mode(2200.0, 1.03, 0.02), mode(4900.0, 0.7, 0.01), mode(7400.0, 1.1, 0.02)]),
            5e-5,
            900.0,
        ),
        ("late", build(stage, 1.5e-3, vec![mode(310.0, 0.9, 0.01)]), 1e-4, 25.0),
    ];
    for name in ["healthy", "loose_pushpin", "sensor_fault", "tunable"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("specs/machines/{name}.toml"));
        let text = std::fs::read_to_string(file).unwrap();
        all.push((name, toml::from_str::<PlantFile>(&text).unwrap().try_into().unwrap(), 39.6e-6, 600.0));
    }
    all
}

/// A controller drawn around the textbook lead for a crossover, with filters anywhere.
fn draw(r: &mut Random, plant: &DiscretePlant, crossover_hz: f64) -> Vec<Section> {
    let t = plant.sample_time_s();
    let w = TAU * crossover_hz * r.between(-0.7, 0.7).exp();
    let shape = Pid {
        kp: 1.0,
        ki_per_s: w / r.between(6.0, 40.0),
        kd_s: r.between(1.5, 4.0) / w,
        derivative_filter_s: r.between(0.02, 0.2) / w,
    };
    let at = shape.section(t).at_delay(Complex::from_polar(1.0, -w * t)) * plant.at(w);
    let k = 1.0 / at.norm();
    let pid = Pid { kp: k, ki_per_s: k * shape.ki_per_s, kd_s: k * shape.kd_s, ..shape };
    let any = |r: &mut Random, low: f64| (low.ln() + r.uniform() * (0.45 / t / low).ln()).exp();
    let mut c = Controller {
        sample_time_s: t,
        output_limit: None,
        pid,
        lowpass: vec![Lowpass { frequency_hz: any(r, 4.0 * crossover_hz), damping_ratio: r.between(0.4, 1.0) }],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    };
    for _ in 0..(r.uniform() * 3.0) as usize {
        let pole_damping_ratio = r.between(0.05, 0.6);
        c.notch.push(Notch {
            frequency_hz: any(r, 0.8 * crossover_hz),
            zero_damping_ratio: pole_damping_ratio * (0.01f64.ln() * r.uniform()).exp(),
            pole_damping_ratio,
        });
    }
    c.sections().unwrap().chain
}

#[test]
fn margins_of_the_grid_are_the_exact_ones() {
    let mut r = Random::new(8);
    let (mut judged, mut stable) = (0, 0);
    for (name, plant, t, crossover_hz) in machines() {
        let sampled = DiscretePlant::of(&plant, t).unwrap();
        let grid = SampledPlant::of_model(&sampled);
        let mut on = LoopOnGrid::default();
        assert!(grid.w_rad_s().len() < 600, "{name}: {}", grid.w_rad_s().len());
        let mut alike = 0;
        for _ in 0..60 {
            let sections = Sections { chain: draw(&mut r, &sampled, crossover_hz), sample_time_s: t };
            let l = ModelLoop::new(&sampled, &sections).unwrap();
            let exact = margins(&l);
            grid.judge(&sections.chain, &mut on);
            let q = &on.quick;
            judged += 1;
            assert_eq!(q.unstable_poles, exact.unstable_poles, "{name}: {sections:?}");
            if exact.unstable_poles != 0 {
                continue;
            }
            stable += 1;
            let what = format!("{name}: {sections:?}\n{q:?}\n{exact:?}");
            assert!((q.max_sensitivity() / exact.max_sensitivity - 1.0).abs() < 0.01, "{what}");
            // Every crossing that the grid has is one of the loop's.
            for e in &q.gain_crossings {
                let near = exact.gain_crossings.iter().find(|c| (c.hz * TAU / e.w_rad_s - 1.0).abs() < 1e-4);
                assert!(near.is_some_and(|c| (c.value - e.value).abs() < 0.02), "{e:?} {what}");
            }
            for e in &q.phase_crossings {
                let near = exact.phase_crossings.iter().find(|c| (c.hz * TAU / e.w_rad_s - 1.0).abs() < 1e-4);
                assert!(near.is_some_and(|c| (c.value - e.value).abs() < 0.05), "{e:?} {what}");
            }
            // None is missed, but pairs closer together than the grid, which it says are near.
            let missed = exact.gain_crossings.len() - q.gain_crossings.len();
            assert!(missed == 0 || !q.grazes.is_empty(), "{missed} {what}");
            if let (0, Some(a), Some(b)) = (missed, q.worst_gain_crossing(), exact.phase_margin_deg) {
                alike += 1;
                assert!((a.value.abs() - b.abs()).abs() < 0.02, "{what}");
            }
            if let (Some(a), Some(b)) = (q.worst_phase_crossing(), exact.gain_margin_db) {
                assert!((a.value.abs() - b.abs()).abs() < 0.05, "{what}");
            }
        }
        assert!(alike > 5, "{name}: {alike}");
    }
    assert!(judged == 480 && stable > 240, "{stable} of {judged}");
}

#[test]
fn events_carry_the_slope_of_the_loop() {
    let (_, plant, t, crossover_hz) = machines().remove(2);
    let sampled = DiscretePlant::of(&plant, t).unwrap();
    let sections = Sections { chain: draw(&mut Random::new(4), &sampled, crossover_hz), sample_time_s: t };
    let l = |w: f64| sampled.at(w) * sections.at(w);
    let grid = SampledPlant::of_model(&sampled);
    let mut on = LoopOnGrid::default();
    grid.judge(&sections.chain, &mut on);
    let q = &on.quick;
    let dips = q.dips.iter().filter(|d| d.slope.norm() > 0.0);
    let mut seen = 0;
    for e in q.gain_crossings.iter().chain(&q.phase_crossings).chain(dips) {
        let h = 1e-5;
        let w = e.w_rad_s;
        let slope = (l(w * (1.0 + h)) / l(w * (1.0 - h))).ln() / (2.0 * h);
        if w * t > 3.1 {
            continue;
        }
        seen += 1;
        // The plant's cubic: 5e-5 over an interval of 0.03, and less where events lie.
        assert!(
            (e.l / l(w) - 1.0).norm() < 2e-4 && (e.slope - slope).norm() < 0.02 * (1.0 + slope.norm()),
            "{e:?} {slope}"
        );
    }
    assert!(seen >= 3);
    let bandwidth = grid.closed_loop_bandwidth(&sections.chain, &on).unwrap();
    let exact = closed_loop_bandwidth(&ModelLoop::new(&sampled, &sections).unwrap()).unwrap();
    assert!((bandwidth.value / exact - 1.0).abs() < 1e-4, "{bandwidth:?} {exact}");
    let size = |w: f64| 20.0 * (l(w) / (1.0 + l(w))).norm().log10();
    // Rounding of a root found to 1e-13 in frequency; below it |T| is above, beyond it falls.
    assert!((size(exact * TAU) + 3.0).abs() < 1e-9 && size(exact * TAU * 1.01) < -3.0);
    assert!((1..1000).all(|i| size(exact * TAU * f64::from(i) / 1000.0) > -3.0));
    let h = 1e-5;
    let w = bandwidth.w_rad_s;
    let slope = (size(w * (1.0 + h)) - size(w * (1.0 - h))) / (2.0 * h) / (20.0 * std::f64::consts::LOG10_E);
    assert!((bandwidth.slope.re - slope).abs() < 0.02 * (1.0 + slope.abs()), "{bandwidth:?} {slope}");
}

#[test]
fn a_curve_limit_is_missed_by_the_most_of_a_fine_scan() {
    let mut r = Random::new(5);
    let mut missed = 0;
    for (name, plant, t, crossover_hz) in machines() {
        let sampled = DiscretePlant::of(&plant, t).unwrap();
        for of in [Magnitude::L, Magnitude::S, Magnitude::T, Magnitude::PS, Magnitude::CS] {
            let sections = Sections { chain: draw(&mut r, &sampled, crossover_hz), sample_time_s: t };
            let l = ModelLoop::new(&sampled, &sections).unwrap();
            let side = if r.uniform() < 0.5 { CurveSide::AtMost } else { CurveSide::AtLeast };
            let limit = CurveLimit {
                of,
                side,
                hz: [0.1, 1.0, 6.0].map(|x| x * crossover_hz).into(),
                db: vec![-30.0, 6.0, -10.0],
            };
            let found = limit.worst(&l, |w| sampled.at(w)).unwrap();
            // The gang by its definition, at 200000 points.
            let scan = (0..=200_000).map(|i| {
                let hz = 0.1 * crossover_hz * 60f64.powf(f64::from(i) / 200_000.0);
                let (p, c) = (sampled.at(TAU * hz), sections.at(TAU * hz));
                let size = match of {
                    Magnitude::L => (p * c).norm(),
                    Magnitude::S => 1.0 / (1.0 + p * c).norm(),
                    Magnitude::T => (p * c / (1.0 + p * c)).norm(),
                    Magnitude::PS => (p / (1.0 + p * c)).norm(),
                    Magnitude::CS => (c / (1.0 + p * c)).norm(),
                };
                let line = if hz < crossover_hz {
                    -30.0 + 36.0 * (hz / (0.1 * crossover_hz)).log10()
                } else {
                    6.0 - 16.0 * (hz / crossover_hz).log10() / 6f64.log10()
                };
                let over = 20.0 * size.log10() - line;
                if side == CurveSide::AtMost { over } else { -over }
            });
            let worst = scan.fold(f64::NEG_INFINITY, f64::max);
            missed += usize::from(worst > 0.0);
            // A scan of 2e-5 a step misses a mode's top of a hundredth by less than 1e-4 dB.
            assert!((found.db - worst).abs() < 1e-3, "{name} {limit:?}: {found:?} {worst}");
            assert!(
                limit
                    .excess(
                        found.hz,
                        of.of(sampled.at(found.hz * TAU), sampled.at(found.hz * TAU) * sections.at(found.hz * TAU))
                    )
                    .unwrap()
                    > found.db - 1e-6
            );
        }
    }
    assert!(missed > 10);
}

/// A low-pass that comes down turns the curve until it crosses the negative real axis there and back between two points of the grid.
#[test]
fn a_pair_of_phase_crossings_between_two_points_is_announced() {
    let mut r = Random::new(21);
    let (mut hidden, mut announced) = (0, 0);
    for (_, plant, t, crossover_hz) in machines() {
        let sampled = DiscretePlant::of(&plant, t).unwrap();
        let grid = SampledPlant::of_model(&sampled);
        let w = grid.w_rad_s().to_vec();
        let mut on = LoopOnGrid::default();
        for _ in 0..4 {
            let chain = draw(&mut r, &sampled, crossover_hz);
            for step in 0..400 {
                let hz = 0.45 / t * (1.0 - f64::from(step) / 530.0);
                let mut sections = Sections { chain: chain.clone(), sample_time_s: t };
                sections.chain.push(Section::lowpass(hz, 0.7, t).unwrap());
                let l = ModelLoop::new(&sampled, &sections).unwrap();
                let exact = margins(&l);
                let seen: Vec<f64> =
                    exact.phase_crossings.iter().filter(|c| c.value < 30.0).map(|c| c.hz * TAU).collect();
                for pair in seen.windows(2) {
                    let interval = w.partition_point(|x| *x < pair[0]);
                    if interval == 0 || interval != w.partition_point(|x| *x < pair[1]) || interval + 1 >= w.len() {
                        continue;
                    }
                    hidden += 1;
                    grid.judge(&sections.chain, &mut on);
                    let near = |x: f64| x > w[interval.saturating_sub(2)] && x < w[(interval + 1).min(w.len() - 1)];
                    announced += usize::from(on.quick.turns_back.iter().any(|e| near(e.w_rad_s)));
                }
            }
        }
    }
    assert!(hidden >= 5 && announced == hidden, "{announced} of {hidden}");
}
