//! The laws of the physics room against closed forms: truth that is not this program's own output.
#![allow(clippy::unwrap_used)]

use crate::physics_common::{T, along, close, df, law, run, scene};
use nalgebra::Complex;
use servotune::physics::aerodynamic_drag::AerodynamicDrag;
use servotune::physics::amplifier_lag::AmplifierLag;
use servotune::physics::backlash::Backlash;
use servotune::physics::base_mode::BaseMode;
use servotune::physics::bearing_bias::BearingBias;
use servotune::physics::cable_spring::CableSpring;
use servotune::physics::coulomb_friction::CoulombFriction;
use servotune::physics::current_saturation::CurrentSaturation;
use servotune::physics::dead_band::DeadBand;
use servotune::physics::encoder_scale_error::EncoderScaleError;
use servotune::physics::extra_delay::ExtraDelay;
use servotune::physics::gain_drift::{GainDrift, Start};
use servotune::physics::line_disturbance::LineDisturbance;
use servotune::physics::nonlinear_spring::{NonlinearSpring, Stiffening};
use servotune::physics::offset_drift::OffsetDrift;
use servotune::physics::parametric_gain::{Clock, ParametricGain};
use servotune::physics::pivot_friction::{Loading, PivotFriction};
use servotune::physics::repeatable_runout::RepeatableRunout;
use servotune::physics::sensor_lag::SensorLag;
use servotune::physics::shock::Shock;
use servotune::physics::slew_limit::SlewLimit;
use servotune::physics::torque_factor_rolloff::{Shape, TorqueFactorRolloff};
use servotune::physics::torque_ripple::TorqueRipple;
use servotune::physics::unmodelled_resonance::UnmodelledResonance;
use servotune::physics::{AnyLaw, Sample};
use std::f64::consts::{PI, TAU};

#[test]
fn describing_functions_of_the_textbook() {
    let (a, w) = (0.8, TAU * 40.0);
    // Gelb, Vander Velde: saturation at d, 2/pi (asin r + r sqrt(1 - r²)), r = d/A; the dead zone is its complement.
    let r: f64 = 0.3 / a;
    let saturates = |r: f64| 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt());
    let clipped = saturates(r);
    // 4096 steps: a kink is met within one step, its error in the harmonic is of the step squared.
    close(df(CurrentSaturation { limit: 0.3, knee: None }, 1.0, a, w), Complex::new(clipped - 1.0, 0.0), 1e-6);
    // A soft knee is the mean of sharp corners that lie evenly over its width.
    let evenly: f64 = (0..2000).map(|i| saturates(r * (0.8 + 0.4 * (f64::from(i) + 0.5) / 2000.0))).sum();
    let soft = CurrentSaturation { limit: 0.3, knee: Some(0.2) };
    close(df(soft, 1.0, a, w), Complex::new(evenly / 2000.0 - 1.0, 0.0), 1e-6);
    close(df(DeadBand { half_width: 0.3, gain_inside: None }, 1.0, a, w), Complex::new(-clipped, 0.0), 1e-6);
    // Dead time: two gains about a break point, g inside and 1 outside.
    let fades = DeadBand { half_width: 0.3, gain_inside: Some(0.35) };
    close(df(fades, 1.0, a, w), Complex::new(-0.65 * clipped, 0.0), 1e-6);
    // Coulomb F with a pre-sliding length of 1e-5 A: 4F/(pi A) against the velocity; the length turns the phase by about sqrt.
    close(df(CoulombFriction::sticking(1e-5, None), 0.03, a, w), Complex::new(0.0, -4.0 * 0.03 / (PI * a)), 1e-2);
    // A drag that creeps, tanh(v/v_c): F/v_c of a slow motion, but for its square over four; a sign of a fast one.
    let creeps = |v_c: f64| df(CoulombFriction::creeping(v_c), 0.03, a, w);
    close(creeps(1e3 * a * w), Complex::new(0.0, -0.03 / (1e3 * a)), 1e-6);
    close(creeps(1e-4 * a * w), Complex::new(0.0, -4.0 * 0.03 / (PI * a)), 1e-3);
    let cubic = NonlinearSpring { centre: 0.0, stiffening: Stiffening::Cubic };
    // x³: 3/4 k A²; sin³ has no kink, and Simpson's rule is exact for a cubic of a straight path.
    close(df(cubic, 2.0, a, w), Complex::new(-0.75 * 2.0 * a * a, 0.0), 1e-5);
    // v|v|: 8/(3 pi) w² A.
    close(df(AerodynamicDrag, 1.0, a, w), Complex::new(0.0, -8.0 / (3.0 * PI) * w * w * a), 1e-5);
    // First-order lag 1/(1 + j w tau) - 1.
    let lag = 1.0 / Complex::new(1.0, w * 2e-3) - 1.0;
    close(df(SensorLag { time_constant_s: 2e-3 }, 1.0, a, w), lag, 1e-5);
    // Amplifier: the command is held for a step, half a step of 1/4096 cycle late.
    close(df(AmplifierLag { time_constant_s: 2e-3 }, 1.0, a, w), lag, 3e-3);
    // Play of gap g: fundamental of the loop; energy (area) 2 g (2 A - g) a cycle is pi A² Im N.
    let g = 0.4;
    let n = df(Backlash { gap: g, contact: None }, 1.0, a, w);
    assert!((n.im.abs() * PI * a * a - g * (2.0 * a - g)).abs() < 1e-5, "{n}");
}

#[test]
fn dahl_loses_the_area_of_its_loop() {
    // Quadrature of dz/dx = (1 - s z)/x_s over a half-cycle of length 2A in the steady loop: z runs from -zm to zm with
    // zm = tanh(A/x_s), and one half-cycle takes F (2A - 2 x_s zm).
    let (f, x_s, a) = (0.03, 2.0, 3.0);
    let area = 2.0 * f * (2.0 * a - 2.0 * x_s * f64::tanh(a / x_s));
    let n = df(PivotFriction::of(x_s, Loading::Dahl), f, a, TAU * 20.0);
    // Only the fundamental does work on a sine.
    assert!((-n.im * PI * a * a / area - 1.0).abs() < 1e-5, "{n} {area}");
}

#[test]
fn the_oscillator_is_exact_for_a_held_command() {
    let (hz, z) = (700.0, 0.02);
    let samples = along(400, |_| Sample { i: 1.0, ..Sample::default() });
    let all = run(law(UnmodelledResonance { frequency_hz: hz, damping_ratio: z }).as_mut(), &samples);
    let base = run(law(BaseMode { frequency_hz: hz, damping_ratio: z }).as_mut(), &samples);
    let w = TAU * hz;
    let wd = w * (1.0 - z * z).sqrt();
    for (k, out) in all.iter().enumerate() {
        let t = (k + 1) as f64 * T;
        let keep = (-z * w * t).exp();
        let step = 1.0 - keep * ((wd * t).cos() + z * w / wd * (wd * t).sin());
        let rate = keep * w / wd * (wd * t).sin();
        // 400 steps of rounding.
        assert!((out[0] - step).abs() < 1e-11 && (out[1] - rate).abs() < 1e-11 && base[k][0] == out[0]);
    }
}

#[test]
fn a_delay_reads_the_past_and_a_lag_falls_behind() {
    let cubic = |t: f64| 3.0 + 40.0 * t - 9e3 * t * t + 5e5 * t.powi(3);
    let slope = |t: f64| 40.0 - 1.8e4 * t + 1.5e6 * t * t;
    let samples = along(60, |t| Sample { x: cubic(t), v: slope(t), ..Sample::default() });
    for n in [0.3, 1.0, 2.45, 16.0] {
        let all = run(law(ExtraDelay::Constant { delay_s: n * T }).as_mut(), &samples);
        for (k, out) in all.iter().enumerate().skip(18) {
            let t = (k + 1) as f64 * T;
            // Hermite's cubic through a cubic is the cubic.
            assert!((out[0] - (cubic(t - n * T) - cubic(t))).abs() < 1e-12);
        }
    }
    let straight = along(60, |t| Sample { x: 100.0 * t, v: 100.0, ..Sample::default() });
    let late = 2.5 * T;
    for late in [AnyLaw::from(SensorLag { time_constant_s: late }), ExtraDelay::Constant { delay_s: late }.into()] {
        let all = run(law(late.clone()).as_mut(), &straight);
        assert!(all.iter().all(|o| (o[0] + 250.0 * T).abs() < 1e-12), "{late:?}");
    }
    // A unit step of the command through the lag: the sum of what is missing is the time constant.
    let step = along(400, |t| Sample { u: f64::from(u8::from(t > 0.5 * T)), ..Sample::default() });
    let missing: f64 = run(law(AmplifierLag { time_constant_s: 5.0 * T }).as_mut(), &step).iter().map(|o| o[0]).sum();
    assert!((missing + 5.0).abs() < 1e-9);
    // A limiter climbs in equal steps: 1 - k/4 is missing.
    let slew = run(law(SlewLimit { max_slope: 0.25 / T, between_samples: false }).as_mut(), &step);
    assert!((0..5).all(|k| (slew[k][0] + 1.0 - 0.25 * (k + 1).min(4) as f64).abs() < 1e-12));
    // Ramping between the samples, the triangle above the ramp is missing: height 1, base 1/S.
    for slope in [0.3, 0.25, 2.5] {
        let ramp = run(law(SlewLimit { max_slope: slope / T, between_samples: true }).as_mut(), &step);
        assert!((ramp.iter().map(|o| o[0]).sum::<f64>() + 0.5 / slope).abs() < 1e-12, "{slope}");
    }
}

#[test]
fn waves_and_pulses_are_means_over_the_interval() {
    let samples =
        along(200, |t| Sample { x: 300.0 * t, v: 300.0, i: 1.0, spindle_rad: TAU * 120.0 * t, ..Sample::default() });
    let shock = run(law(Shock { time_s: 10.3 * T, width_s: 40.7 * T }).as_mut(), &samples);
    // The area of a half-sine is 2 w/pi.
    assert!((shock.iter().map(|o| o[0]).sum::<f64>() * T - 2.0 * 40.7 * T / PI).abs() < 1e-15);
    let drift = run(law(OffsetDrift).as_mut(), &samples);
    let end = 199.0 * T;
    assert!((drift.iter().map(|o| o[0]).sum::<f64>() * T - end.powi(2) / 2.0).abs() < 1e-15);
    assert!((drift.iter().map(|o| o[1]).sum::<f64>() * T - end.powi(3) / 3.0).abs() < 1e-15);
    let sine = |w: f64| ((w * end).sin() / w, (1.0 - (w * end).cos()) / w);
    let swing = |frequency_hz, clock| AnyLaw::from(ParametricGain { frequency_hz, clock });
    for (wave, w) in [
        (LineDisturbance { frequency_hz: 317.0 }.into(), TAU * 317.0),
        (TorqueRipple { period: 0.5, of_factor: false }.into(), TAU * 300.0 / 0.5),
        (swing(61.0, Clock::Time), TAU * 61.0),
        (swing(240.0, Clock::Spindle(2)), TAU * 240.0),
    ] {
        let all = run(law(wave.clone()).as_mut(), &samples);
        let sum = |c: usize| all.iter().map(|o| o[c]).sum::<f64>() * T;
        // Simpson's rule on the ripple: (w T)^4/2880 of the wave, 2e-7 here.
        assert!((sum(0) - sine(w).0).abs() < 1e-6 / w && (sum(1) - sine(w).1).abs() < 1e-6 / w, "{wave:?}");
    }
    let warm = run(law(GainDrift::Warming { time_constant_s: 3e-3, from: Start::Record }).as_mut(), &samples);
    let area = end - 3e-3 * (1.0 - (-end / 3e-3).exp());
    assert!((warm.iter().map(|o| o[0]).sum::<f64>() * T - area).abs() < 1e-14);
    let runout = run(law(RepeatableRunout { base_hz: 240.0 }).as_mut(), &samples);
    let t = 100.0 * T;
    assert!((runout[99][4] - (3.0 * TAU * 240.0 * t).cos()).abs() < 1e-9);
    let scale = run(law(EncoderScaleError { centre: 0.5 }).as_mut(), &samples);
    let d = 300.0 * t - 0.5;
    assert!((scale[99][0] - d * d).abs() < 1e-12 && (scale[99][1] - d.powi(3)).abs() < 1e-12);
}

#[test]
fn springs_and_memory_follow_their_equations() {
    // A ramp at speed v: stretch of a creeping cable v tau (1 - exp(-t/tau)); its area is v tau (t - tau (1 - exp(-t/tau))).
    let (v, tau) = (300.0, 4e-3);
    let samples = along(500, |t| Sample { x: v * t, v, ..Sample::default() });
    let (end, keep) = (499.0 * T, (-499.0 * T / tau).exp());
    let all = run(law(CableSpring { creep_time_s: Some(tau), centre: 0.0 }).as_mut(), &samples);
    let area = -all.iter().map(|o| o[0]).sum::<f64>() * T;
    assert!((area / (v * tau * (end - tau * (1.0 - keep))) - 1.0).abs() < 1e-10);
    let square = -all.iter().map(|o| o[1]).sum::<f64>() * T;
    assert!((square / (v * v * end.powi(3) / 3.0) - 1.0).abs() < 1e-10);
    // Into a stop at 2: the area of the triangle (v t - 2)²/2v, the crossing within a step included.
    for side in [1.0, -1.0] {
        let way = along(500, |t| Sample { x: side * v * t, v: side * v, ..Sample::default() });
        let stiffening = Stiffening::Stop { offset: 2.0 * side };
        let stop = run(law(NonlinearSpring { centre: 0.0, stiffening }).as_mut(), &way);
        let area = -side * stop.iter().map(|o| o[0]).sum::<f64>() * T;
        assert!((area / ((v * end - 2.0).powi(2) / (2.0 * v)) - 1.0).abs() < 1e-10);
    }
    // A move of 1.5 with critical length 3, then rest: the bias settles at half its largest; a longer move saturates it.
    let bearing = BearingBias { critical_length: 3.0, relaxation_time_s: 2e-3, shortest_move: 0.018 };
    for (length, level) in [(1.5, 0.5), (9.0, 1.0)] {
        let moved = along(3000, |t| Sample { x: (v * t).min(length), ..Sample::default() });
        let bias = run(law(bearing.clone()).as_mut(), &moved);
        // 0.08 s of rest at least: exp(-40).
        assert!((bias[2998][0] + level).abs() < 1e-9, "{}", bias[2998][0]);
    }
}

#[test]
fn a_torque_factor_may_fall_up_to_a_corner_or_from_one() {
    // Arm at rest: the mean over the interval is the value. Positions are told by the record, the law sees the arm's own.
    let ratio = scene().arm_over_record();
    let column = |shape: Shape, z: f64| {
        let here = Sample { x: 15.0 * ratio * z, i: 0.4, ..Sample::default() };
        run(law(TorqueFactorRolloff { shape }).as_mut(), &[here, here])[0][1]
    };
    for z in [-1.0f64, -0.6, 0.2, 0.7, 0.9] {
        let (size, corner): (f64, f64) = (z.abs(), 0.7);
        assert!((column(Shape::Parabola, z) + 0.4 * size * size).abs() < 1e-12, "{z}");
        assert!((column(Shape::Begins { corner }, z) + 0.4 * (size - corner).max(0.0).powi(2)).abs() < 1e-12, "{z}");
        assert!((column(Shape::Ends { corner }, z) + 0.4 * size.min(corner).powi(2)).abs() < 1e-12, "{z}");
    }
}
