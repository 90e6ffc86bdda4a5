//! One axis with a mode, samples along a path, and how the tests of the laws run a law over them.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::lti::{Body, Mode, Plant};
use servotune::physics::{AnyLaw, COLUMNS, Law, LawSetting, MotionScene, Sample, describing};

pub const T: f64 = 39.6e-6;

pub fn scene() -> MotionScene {
    let mode = Mode { zero_rad_s: 7483.0, zero_damping_ratio: 0.038, pole_rad_s: 7681.0, pole_damping_ratio: 0.037 };
    let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
    let plant = Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body,
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes: vec![mode],
        physics: vec![],
    };
    MotionScene {
        plant,
        sample_time_s: T,
        spindle_hz: Some(120.0),
        travel: 15.0,
        centre: 0.5,
        speed: 400.0,
        command: 0.5,
        command_step: 0.1,
        noise: 0.003,
        duration_s: 0.25,
        session_s: 0.25,
        indexed: true,
        warm: true,
    }
}

/// Runs a law along samples; the columns of every step.
pub fn run(law: &mut dyn Law, samples: &[Sample]) -> Vec<[f64; COLUMNS]> {
    let mut all = Vec::new();
    for pair in samples.windows(2) {
        let mut out = [0.0; COLUMNS];
        law.columns(&pair[0], &pair[1], &mut out);
        law.commit(&pair[0], &pair[1]);
        all.push(out);
    }
    all
}

pub fn along(count: usize, mut at: impl FnMut(f64) -> Sample) -> Vec<Sample> {
    (0..count).map(|k| Sample { t: k as f64 * T, ..at(k as f64 * T) }).collect()
}

pub fn law(of: impl Into<AnyLaw>) -> Box<dyn Law> {
    of.into().in_motion(&scene())
}

pub fn df(of: impl Into<AnyLaw>, strength: f64, amplitude: f64, w: f64) -> Complex<f64> {
    describing(&LawSetting::new(of, vec![strength]), &scene(), amplitude, w).unwrap()
}

pub fn close(found: Complex<f64>, expected: Complex<f64>, tolerance: f64) {
    assert!((found - expected).norm() <= tolerance * expected.norm(), "{found} against {expected}");
}

/// The states at every sample, from rest under a held input, by the classical method of Runge and Kutta with `steps` steps a sample.
pub fn runge_kutta<const N: usize>(
    u: &[f64],
    sample_time_s: f64,
    steps: usize,
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
) -> Vec<[f64; N]> {
    let add = |s: [f64; N], k: [f64; N], h: f64| -> [f64; N] { std::array::from_fn(|i| s[i] + h * k[i]) };
    let (mut s, h, mut out) = ([0.0; N], sample_time_s / steps as f64, Vec::new());
    for u in u {
        out.push(s);
        for _ in 0..steps {
            let k1 = slope(*u, s);
            let k2 = slope(*u, add(s, k1, 0.5 * h));
            let k3 = slope(*u, add(s, k2, 0.5 * h));
            let k4 = slope(*u, add(s, k3, h));
            s = std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
    out
}
