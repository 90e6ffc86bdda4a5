//! The simulated write against a Runge-Kutta integration of the differential equation, and against closed forms.
#![allow(clippy::unwrap_used)]

use servotune::controller::{Controller, Feedforward, Lowpass, Notch, Pid};
use servotune::lti::{Body, Mode, Plant};
use servotune::pes::{Noise, PesClock, Profile, Reference, Runout, Spiral, figures, simulate};

const T: f64 = 39.6e-6;

fn plant() -> Plant {
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body: Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes: vec![Mode {
            zero_rad_s: 7483.0,
            zero_damping_ratio: 0.038,
            pole_rad_s: 7681.0,
            pole_damping_ratio: 0.037,
        }],
        physics: vec![],
    }
}

fn controller() -> Controller {
    Controller {
        sample_time_s: T,
        output_limit: Some(10.0),
        pid: Pid { kp: 0.27, ki_per_s: 60.0, kd_s: 3.7e-4, derivative_filter_s: 12e-6 },
        lowpass: vec![Lowpass { frequency_hz: 7000.0, damping_ratio: 0.7 }],
        notch: vec![Notch { frequency_hz: 1222.0, zero_damping_ratio: 0.05, pole_damping_ratio: 0.25 }],
        biquad: vec![],
        feedforward: Some(Feedforward { factor: 0.5, velocity_s: 1e-5, acceleration_s2: 9.8e-8, ahead_samples: 0 }),
    }
}

fn profile() -> Profile {
    Profile {
        spiral: Spiral { velocity: 350.0, distance: 1.0, acceleration_time_s: 2e-3, start_s: 2e-3, duration_s: 0.012 },
        pes: PesClock { sample_rate_hz: 27_480.0, window: [20, 220] },
        noise: Noise::default(),
    }
}

/// Position at the servo instants by Runge-Kutta of order 4 on the chain body, mode; no modal form, no exponentials.
fn integrated(profile: &Profile, c: &Controller, p: &Plant) -> Vec<f64> {
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, damping_ratio: z0 } = p.body else { panic!("body") };
    let m = p.modes[0];
    let deriv = |x: &[f64; 4], u: f64| {
        let y0 = x[0];
        let a0 = dc_gain * w0 * w0 * u - 2.0 * z0 * w0 * x[1] - w0 * w0 * x[0];
        // Controllable form of the mode behind the body: x[2] driven by y0, output with the numerator's coefficients.
        let a2 = y0 - 2.0 * m.pole_damping_ratio * m.pole_rad_s * x[3] - m.pole_rad_s.powi(2) * x[2];
        ([x[1], a0, x[3], a2], a2 + 2.0 * m.zero_damping_ratio * m.zero_rad_s * x[3] + m.zero_rad_s.powi(2) * x[2])
    };
    let h = 0.2e-6;
    let per_sample = 198;
    let delay_steps = 325; // 65 us
    let r = Reference::of(&profile.spiral);
    let chain = c.sections().unwrap().chain;
    let mut memory = vec![[0.0; 2]; chain.len()];
    let (mut x, mut commands) = ([0.0; 4], vec![]);
    let mut out: Vec<f64> = vec![];
    let mut step = 0usize;
    let mut before = (0.0, 0.0);
    let ff = c.feedforward.unwrap();
    while out.len() < profile.servo_samples() {
        let y = deriv(&x, 0.0).1;
        let now = step as f64 * h;
        while out.len() < profile.servo_samples() && (out.len() as f64 / 27_480.0) <= now + 1e-12 {
            let at = out.len() as f64 / 27_480.0;
            let share = if step == 0 { 1.0 } else { (at - before.0) / h };
            out.push(before.1 + share * (y - before.1));
        }
        before = (now, y);
        if step.is_multiple_of(per_sample) {
            let t = (step / per_sample) as f64 * T;
            let mut s = r.at(t) - y;
            for (q, z) in chain.iter().zip(memory.iter_mut()) {
                let o = q.b0 * s + z[0];
                *z = [q.b1 * s - q.a1 * o + z[1], q.b2 * s - q.a2 * o];
                s = o;
            }
            let slope = (r.at(t + T) - r.at(t - T)) / (2.0 * T);
            let bend = (r.at(t + T) - 2.0 * r.at(t) + r.at(t - T)) / (T * T);
            commands.push((s + ff.factor * (ff.velocity_s * slope + ff.acceleration_s2 * bend)).clamp(-10.0, 10.0));
        }
        let u = if step < delay_steps { 0.0 } else { commands[(step - delay_steps) / per_sample] };
        let add = |a: &[f64; 4], k: &[f64; 4], s: f64| std::array::from_fn(|i| a[i] + s * k[i]);
        let k1 = deriv(&x, u).0;
        let k2 = deriv(&add(&x, &k1, h / 2.0), u).0;
        let k3 = deriv(&add(&x, &k2, h / 2.0), u).0;
        let k4 = deriv(&add(&x, &k3, h), u).0;
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        step += 1;
    }
    out
}

#[test]
fn the_write_agrees_with_a_runge_kutta_integration() {
    let (p, c, profile) = (plant(), controller(), profile());
    let run = simulate(&p, &c, &profile).unwrap();
    let r = Reference::of(&profile.spiral);
    let truth = integrated(&profile, &c, &p);
    assert_eq!(run.pes.len(), truth.len());
    for (j, (pes, y)) in run.pes.iter().zip(&truth).enumerate() {
        let expected = r.at(j as f64 / 27_480.0) - y;
        // Linear reading between steps of 0.2 us: h²/8 times the acceleration, 1.8e5 track/s², is 1e-9.
        assert!((pes - expected).abs() < 3e-9, "servo sample {j}: {pes} {expected}");
    }
}

#[test]
fn runout_alone_shows_its_own_harmonic() {
    // 550 Hz x 4 lies on bin 16 of 200 samples at 27 500 Hz; run-out is added at the head, so the loop does not see it.
    let mut profile = profile();
    profile.pes.sample_rate_hz = 27_500.0;
    profile.noise = Noise {
        spindle_hz: 550.0,
        runout: vec![Runout { order: 4, amplitude: 0.01, phase_deg: 25.0 }],
        ..Noise::default()
    };
    profile.spiral.distance = 1e-12;
    let run = simulate(&plant(), &controller(), &profile).unwrap();
    let f = figures(&run.pes, &profile);
    assert!((f.harmonics[15].amplitude - 0.005).abs() < 1e-11, "half the amplitude by eq. (41)");
    assert!((f.harmonics[15].hz - 2200.0).abs() < 1e-9);
    assert!((f.dft_high.unwrap() - 0.005).abs() < 1e-11 && f.dft_low.unwrap() < 1e-11);
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_does_not() {
    let mut profile = profile();
    profile.noise =
        Noise { encoder_rms: 0.003, windage_rms: 2e-4, windage_corner_hz: 60.0, seed: 4, ..Noise::default() };
    let a = simulate(&plant(), &controller(), &profile).unwrap();
    let b = simulate(&plant(), &controller(), &profile).unwrap();
    assert_eq!(a, b);
    profile.noise.seed = 5;
    assert_ne!(a.pes, simulate(&plant(), &controller(), &profile).unwrap().pes);
}
