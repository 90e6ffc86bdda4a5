//! What the parts of one candidate cost on several machines. Run: `cargo bench --bench kernel`.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use divan::{Bencher, black_box};
use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::feedback::{LoopOnGrid, SampledPlant};
use servotune::lti::{Body, DiscretePlant, Mode, Plant, PlantFile, Section};
use servotune::pes::{
    Asked, Figure, Noise, NoisePower, NoisePowerWork, PesClock, Profile, QuickScene, QuickWork, Spiral, StepScene,
    StepWork, WindowDft, WriteRecord,
};
use std::path::Path;

fn main() {
    let at = |name: &str| {
        let (plant, _) = machine(name);
        let grid = SampledPlant::of_model(&plant);
        println!("{name}: {} points a grid, {} terms", grid.w_rad_s().len(), plant.terms().len());
    };
    MACHINES.iter().for_each(|m| at(m));
    divan::main();
}

const MACHINES: [&str; 7] = ["healthy", "loose_pushpin", "sensor_fault", "tunable", "stage", "galvo", "vcm"];

fn mode(hz: f64, ratio: f64, damping: f64) -> Mode {
    let w = std::f64::consts::TAU * hz;
    Mode { zero_rad_s: ratio * w, zero_damping_ratio: damping, pole_rad_s: w, pole_damping_ratio: damping }
}

/// The plant and a controller that is stable on it.
fn machine(name: &str) -> (DiscretePlant, Controller) {
    let (body, delay_s, modes, sample_time_s, crossover_hz) = match name {
        "stage" => {
            let body = Body::FreeInertia { acceleration_gain: 2e6, viscous_rate_per_s: 0.0 };
            (body, 1.2e-4, vec![mode(310.0, 0.9, 0.01), mode(840.0, 1.05, 0.01)], 1e-4, 40.0)
        }
        "galvo" => {
            let body = Body::SecondOrder { dc_gain: 20.0, natural_frequency_rad_s: 60.0, damping_ratio: 0.1 };
            (body, 4e-6, vec![mode(14_000.0, 1.05, 0.004), mode(29_000.0, 0.9, 0.006)], 1e-5, 1500.0)
        }
        "vcm" => {
            let body = Body::SecondOrder { dc_gain: 100.0, natural_frequency_rad_s: 250.0, damping_ratio: 0.3 };
            let modes = vec![mode(2200.0, 1.03, 0.02), mode(4900.0, 0.7, 0.01), mode(7400.0, 1.1, 0.02)];
            (body, 1e-5, modes, 5e-5, 900.0)
        }
        _ => {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("specs/machines/{name}.toml"));
            let plant: Plant =
                toml::from_str::<PlantFile>(&std::fs::read_to_string(file).unwrap()).unwrap().try_into().unwrap();
            return (DiscretePlant::of(&plant, 39.6e-6).unwrap(), paper());
        }
    };
    let acceleration = body.acceleration_gain();
    let (position_unit, command_unit) = ("um".into(), "A".into());
    let plant = Plant { position_unit, command_unit, body, delay_s, resonance_gain: 1.0, modes, physics: vec![] };
    // The textbook lead on an inertia: |L| = 1 at the crossover, a third of it for the corner of the lead.
    let w = std::f64::consts::TAU * crossover_hz;
    let kp = w * w / (acceleration * 3.2);
    let c = Controller {
        sample_time_s,
        output_limit: None,
        pid: Pid { kp, ki_per_s: kp * w / 15.0, kd_s: 3.0 * kp / w, derivative_filter_s: 0.1 / w },
        lowpass: vec![Lowpass { frequency_hz: 0.3 / sample_time_s, damping_ratio: 0.7 }],
        notch: vec![Notch {
            frequency_hz: plant.modes[0].pole_rad_s / std::f64::consts::TAU,
            zero_damping_ratio: 0.05,
            pole_damping_ratio: 0.3,
        }],
        biquad: vec![],
        feedforward: None,
    };
    (DiscretePlant::of(&plant, sample_time_s).unwrap(), c)
}

fn paper() -> Controller {
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("specs/controllers/nominal.toml")).unwrap();
    toml::from_str(&text).unwrap()
}

/// The paper's write with its clock scaled to the machine's: 570 controller samples up to the window's end, 1515 in all.
fn profile(t: f64) -> Profile {
    let s = t / 39.6e-6;
    Profile {
        spiral: Spiral {
            velocity: 350.0,
            distance: 15.0 * s,
            acceleration_time_s: 2e-3 * s,
            start_s: 8e-3 * s,
            duration_s: 0.06 * s,
        },
        pes: PesClock { sample_rate_hz: 27_480.0 / s, window: [200, 400] },
        noise: Noise { encoder_rms: 0.003, windage_rms: 2e-4, windage_corner_hz: 60.0, seed: 1, ..Noise::default() },
    }
}

fn prepared(name: &str) -> (DiscretePlant, Vec<Section>) {
    let (plant, c) = machine(name);
    let chain = c.sections().unwrap().chain;
    (plant, chain)
}

#[divan::bench(args = MACHINES)]
fn margins(b: Bencher, name: &str) {
    let (plant, chain) = prepared(name);
    let grid = SampledPlant::of_model(&plant);
    let mut on = LoopOnGrid::default();
    b.bench_local(|| grid.judge(black_box(&chain), &mut on));
}

fn write(b: Bencher, name: &str, asked: Asked) {
    let (plant, chain) = prepared(name);
    let scene = QuickScene::new(&profile(plant.sample_time_s()), &plant).unwrap();
    let mut work = QuickWork::default();
    b.bench_local(|| scene.run(black_box(&chain), None, Some(1e3), asked, &mut work));
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn write_still(b: Bencher, name: &str) {
    write(b, name, Asked { still: true, ..Asked::default() });
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn write_both(b: Bencher, name: &str) {
    write(b, name, Asked { still: true, drawn: true, ..Asked::default() });
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn write_both_kept(b: Bencher, name: &str) {
    write(b, name, Asked { whole: false, ..Asked::all() });
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn write_both_whole(b: Bencher, name: &str) {
    write(b, name, Asked { slopes: false, ..Asked::all() });
}

fn backward(b: Bencher, name: &str, figures: usize) {
    let (plant, chain) = prepared(name);
    let scene = QuickScene::new(&profile(plant.sample_time_s()), &plant).unwrap();
    let mut work = QuickWork::default();
    scene.run(&chain, None, Some(1e3), Asked { whole: false, ..Asked::all() }, &mut work);
    let weights = [WriteRecord::Still, WriteRecord::Drawn].map(|r| work.window(r).to_vec());
    let of = |record, w| Figure { record, window: w, command: (0, &[]) };
    let all = [of(WriteRecord::Still, weights[0].as_slice()), of(WriteRecord::Drawn, &weights[1])];
    let mut out = Vec::new();
    b.bench_local(|| scene.backward(black_box(&chain), &all[..figures], &mut work, &mut out));
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn backward_one_figure(b: Bencher, name: &str) {
    backward(b, name, 1);
}

#[divan::bench(args = ["healthy", "galvo", "stage"])]
fn backward_two_figures(b: Bencher, name: &str) {
    backward(b, name, 2);
}

#[divan::bench(args = ["healthy", "stage"])]
fn step_of_500_samples(b: Bencher, name: &str) {
    let (plant, chain) = prepared(name);
    let scene = StepScene::new(&plant, 500);
    let mut work = StepWork::default();
    b.bench_local(|| scene.run(black_box(&chain), None, None, 500, &mut work));
}

fn noise(b: Bencher, slopes: bool) {
    let (plant, chain) = prepared("healthy");
    let grid = SampledPlant::of_model(&plant);
    let dft = WindowDft::new(200, 27_480.0, (5..=21).collect());
    let power = NoisePower::of(&profile(plant.sample_time_s()), &grid, &dft).unwrap();
    let (mut on, mut work) = (LoopOnGrid::default(), NoisePowerWork::default());
    grid.judge(&chain, &mut on);
    let (mut bins, mut out) = (Vec::new(), Vec::new());
    let shares = [1.0; 17];
    b.bench_local(|| {
        if slopes {
            power.slopes(&grid, black_box(&chain), &on, &shares, [1.0, 1.0], &mut work, &mut out);
            out.len() as f64
        } else {
            power.bins(black_box(&on), &mut work, &mut bins);
            power.position.variance(&on)
        }
    });
}

#[divan::bench]
fn noise_of_bins_and_window(b: Bencher) {
    noise(b, false);
}

#[divan::bench]
fn noise_slopes(b: Bencher) {
    noise(b, true);
}

#[divan::bench]
fn dft_of_17_bins(b: Bencher) {
    let dft = WindowDft::new(200, 27_480.0, (5..=21).collect());
    let window: Vec<f64> = (0..200).map(|i| f64::from(i * i % 13)).collect();
    let mut amplitude = Vec::new();
    b.bench_local(|| dft.amplitudes(black_box(&window), &mut amplitude));
}
