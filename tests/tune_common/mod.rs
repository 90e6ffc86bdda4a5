//! The machine and the spec that the tuning tests share.
#![allow(dead_code, clippy::unwrap_used)]

use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::frf::Frf;
use servotune::lti::{Body, FrequencyResponse, Mode, Plant};
use servotune::pes::{Noise, PesClock, Profile, Spiral};
use servotune::tune::{
    Bounds, Limits, Machine, MarginLimits, Minimise, Objective, Outcome, Search, Spec, Structure, TuneSettings, tune,
};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// The body of the paper's eq. (20), its delay, its first mode and two above it.
pub fn paper_plant() -> Plant {
    let mode = |zero_rad_s: f64, zero_damping_ratio: f64, pole_rad_s: f64, pole_damping_ratio: f64| Mode {
        zero_rad_s,
        zero_damping_ratio,
        pole_rad_s,
        pole_damping_ratio,
    };
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body: Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes: vec![
            mode(7483.0, 0.038, 7681.0, 0.037),
            mode(14_200.0, 0.03, 13_500.0, 0.025),
            mode(27_500.0, 0.02, 26_400.0, 0.02),
        ],
        physics: vec![],
    }
}

/// The write of the paper's window, with noise.
pub fn paper_profile() -> Profile {
    Profile {
        spiral: Spiral { velocity: 350.0, distance: 15.0, acceleration_time_s: 2e-3, start_s: 8e-3, duration_s: 0.06 },
        pes: PesClock { sample_rate_hz: 27_480.0, window: [200, 400] },
        noise: Noise {
            encoder_rms: 0.003,
            windage_rms: 2e-4,
            windage_corner_hz: 60.0,
            spindle_hz: 120.0,
            runout: vec![],
            seed: 1,
        },
    }
}

pub fn paper_spec() -> Spec {
    Spec {
        profile: Some(paper_profile()),
        sample_time_s: Some(39.6e-6),
        guard: 0.0,
        further_room: vec![],
        objective: Objective { minimise: Minimise::Dft, bands_hz: Objective::usual_bands() },
        disturbance: None,
        structure: Structure::default(),
        margins: MarginLimits {
            phase_margin_deg: Some(35.0),
            gain_margin_db: Some(5.0),
            max_sensitivity: Some(2.2),
            gain_crossover_hz: Some([400.0, 900.0]),
            ..MarginLimits::default()
        },
        limits: Limits { dft_low: Some(0.02), dft_high: Some(0.02), command_peak: Some(2.0), ..Limits::default() },
        search: Search {
            seed: 1,
            notches: 1,
            lowpasses: 1,
            bounds: Bounds {
                kp: Some([1e-3, 10.0]),
                ki_per_s: Some([0.1, 1e4]),
                kd_s: Some([1e-6, 0.1]),
                lowpass_hz: Some([2000.0, 12_000.0]),
                notch_hz: Some([500.0, 6000.0]),
            },
        },
    }
}

/// The controller of the contract's example.
pub fn start_controller() -> Controller {
    Controller {
        sample_time_s: 39.6e-6,
        output_limit: Some(10.0),
        pid: Pid { kp: 0.27, ki_per_s: 60.0, kd_s: 3.7e-4, derivative_filter_s: 12e-6 },
        lowpass: vec![Lowpass { frequency_hz: 7000.0, damping_ratio: 0.7 }],
        notch: vec![Notch { frequency_hz: 1222.0, zero_damping_ratio: 0.05, pole_damping_ratio: 0.25 }],
        biquad: vec![],
        feedforward: None,
    }
}

/// The continuous plant on a sweep of `points` from `from_hz` to `to_hz`, equal steps in ln f.
pub fn sweep(plant: &Plant, from_hz: f64, to_hz: f64, points: usize) -> Frf {
    let at = |i: usize| TAU * from_hz * (to_hz / from_hz).powf(i as f64 / (points - 1) as f64);
    let w: Vec<f64> = (0..points).map(at).collect();
    let value = w.iter().map(|w| plant.at(*w)).collect();
    Frf::new(w, value, None).unwrap()
}

/// A sweep like the positioner's own: 10 Hz to 12 kHz.
pub fn paper_response() -> Frf {
    sweep(&paper_plant(), 10.0, 12_000.0, 600)
}

/// A short search: half of the starts that it has unless told otherwise.
pub fn quick() -> TuneSettings {
    TuneSettings { starts: 6, ..TuneSettings::default() }
}

/// The paper's spec tuned over the paper's plant from the contract's example, by a short search on this many threads.
pub fn tuned_on(threads: usize) -> Outcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (plant, start) = (paper_plant(), start_controller());
    pool.install(|| tune(&Machine::Model(&plant), &paper_spec(), Some(&start), &quick()).unwrap())
}

/// The same on two threads, made once for all that look at it.
pub static TUNED: LazyLock<Outcome> = LazyLock::new(|| tuned_on(2));
