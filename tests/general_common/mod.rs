//! The plants of any poles and zeros and the controllers that several tests take.
#![allow(dead_code, clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, Lowpass, Pid};
use servotune::lti::{Body, Plant, PlantFile, Rational};
use servotune::numeric::random::Random;

/// Sample time, s.
pub const T: f64 = 1e-4;

pub fn c(re: f64, im: f64) -> Complex<f64> {
    Complex::new(re, im)
}

pub fn rational(gain: f64, zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>, delay_s: f64) -> Plant {
    Plant {
        position_unit: "um".into(),
        command_unit: "A".into(),
        body: Body::Rational(Rational { gain, zeros, poles }),
        delay_s,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    }
}

pub fn read(text: &str) -> Plant {
    let text = format!("position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\n{text}");
    Plant::try_from(toml::from_str::<PlantFile>(&text).unwrap()).unwrap()
}

pub fn controller(kp: f64, kd_s: f64, ki_per_s: f64, r: &mut Random) -> Controller {
    Controller {
        sample_time_s: T,
        output_limit: None,
        pid: Pid { kp, ki_per_s, kd_s, derivative_filter_s: 0.5 * T },
        lowpass: vec![Lowpass { frequency_hz: r.between(1500.0, 4500.0), damping_ratio: 0.8 }],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    }
}
