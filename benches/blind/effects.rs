//! The effects that a sealed machine may have: how strong, with which true figures, and where they act.

use crate::machine::{Mode, Plant};
use crate::physics::{Outside, Physics, Slip};
use crate::random::Random;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// A true figure: name, value in track and V, powers of the length and the command unit.
pub type Figure = (&'static str, f64, i32, i32);

/// Faults of the data, applied after the record is taken.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Samples that position lags.
    pub shift: f64,
    /// (sample as a share of the record, count) of lost rows.
    pub lost: Vec<(f64, usize)>,
    pub stuck: Vec<(f64, usize)>,
    /// Factor on the position column.
    pub factor: f64,
    /// Records that the fault touches; empty for all.
    pub only: Vec<usize>,
}

/// Everything that makes one case's truth.
#[derive(Clone, Debug)]
pub struct Truth {
    pub plant: Plant,
    pub physics: Physics,
    pub faults: Faults,
    /// Record that a shock falls into.
    pub shocked: Option<usize>,
}

/// What an effect is, for the answer.
#[derive(Clone, Debug, Default)]
pub struct Fact {
    pub figures: Vec<Figure>,
    pub place: Value,
}

/// Single effects within the library; the first eight are the commonest.
pub const SINGLES: [&str; 33] = [
    "pivot_friction",
    "coulomb_friction",
    "torque_factor_rolloff",
    "encoder_cyclic_error",
    "current_saturation",
    "repeatable_runout",
    "unmodelled_resonance",
    "cable_spring",
    "extra_delay",
    "bearing_bias",
    "nonlinear_spring",
    "torque_ripple",
    "slew_limit",
    "dead_band",
    "amplifier_lag",
    "sensor_lag",
    "gain_drift",
    "parametric_gain",
    "encoder_scale_error",
    "quantisation",
    "encoder_noise",
    "jitter",
    "mode_shift",
    "backlash",
    "base_mode",
    "modal_damping",
    "line_disturbance",
    "broadband_disturbance",
    "shock",
    "offset_drift",
    "aerodynamic_drag",
    "controller_mismatch",
    "time_base_drift",
];

pub const PAIRS: [(&str, &str); 10] = [
    ("pivot_friction", "torque_factor_rolloff"),
    ("extra_delay", "coulomb_friction"),
    ("encoder_cyclic_error", "repeatable_runout"),
    ("cable_spring", "coulomb_friction"),
    ("current_saturation", "pivot_friction"),
    ("torque_factor_rolloff", "gain_drift"),
    ("coulomb_friction", "encoder_cyclic_error"),
    ("unmodelled_resonance", "pivot_friction"),
    ("torque_factor_rolloff", "line_disturbance"),
    ("nonlinear_spring", "dead_band"),
];

pub const OUTSIDE: [(&str, Outside); 8] = [
    ("preisach_incongruent", Outside::Preisach),
    ("squeeze_film_delay", Outside::SqueezeFilm),
    ("fractional_cable", Outside::FractionalCable),
    ("random_telegraph_torque", Outside::Telegraph),
    ("cogging_with_latch", Outside::CoggingLatch),
    ("two_arm_coupling", Outside::TwoArm),
    ("gyroscopic_shock", Outside::Gyroscopic),
    ("rate_dependent_hysteresis", Outside::RateHysteresis),
];

pub const FAULTS: [&str; 8] = [
    "misalignment_whole",
    "misalignment_part",
    "lost_samples",
    "stuck_samples",
    "sign_flip",
    "unit_factor",
    "time_base_drift",
    "misalignment_whole",
];

/// `from` at q = 0 to `to` at q = 1, by equal factors.
fn grow(q: f64, from: f64, to: f64) -> f64 {
    from * (to / from).powf(q)
}

/// Adds effect `name` of strength `q` in 0..1; the shape `u` (uniform draws) fixes everything else.
pub fn add(name: &str, q: f64, u: &[f64; 8], ts: f64, t: &mut Truth) -> Fact {
    let p = &mut t.physics;
    let at = |i: usize, low: f64, high: f64| low * (high / low).powf(u[i]);
    let sign = |i: usize| if u[i] < 0.5 { -1.0 } else { 1.0 };
    let b = t.plant.b * t.plant.gain;
    let mut place = json!({});
    let figures: Vec<Figure> = match name {
        "pivot_friction" => {
            // Friction takes over a share of the small-signal stiffness (all of it when strong).
            let share = grow(q, 1e-7, 1.0);
            let whole = if t.plant.k > 0.0 { t.plant.k } else { 250.0f64.powi(2) };
            let mut r = Random::new((u[1] * 1e15) as u64, 77);
            let elements = 20 + (u[2] * 20.99) as usize;
            p.slip = Slip::draw(&mut r, elements, share * whole, at(0, 0.5, 6.0));
            if t.plant.k > 0.0 {
                t.plant.k = (t.plant.k - p.slip.stiffness()).max(0.0);
            }
            vec![
                ("sliding_length", p.slip.length(), 1, 0),
                ("level_command", p.slip.level() / b, 0, 1),
                ("stiffness_per_s2", p.slip.stiffness(), 0, 0),
            ]
        }
        "coulomb_friction" => {
            p.coulomb = grow(q, 1e-7, 0.08);
            vec![("level_command", p.coulomb, 0, 1)]
        }
        "bearing_bias" => {
            p.bias_level = grow(q, 1e-5, 0.06);
            p.bias_length = at(0, 1.0, 6.0);
            p.bias_tau = at(1, 0.02, 0.08);
            vec![("level_command", p.bias_level, 0, 1), ("length", p.bias_length, 1, 0), ("tau_s", p.bias_tau, 0, 0)]
        }
        "cable_spring" => {
            let s = grow(q, 1e-4, 1.0);
            p.cable_offset = 0.03 * s * (2.0 * u[0] - 1.0);
            p.cable_quadratic = 2.5e-4 * s * sign(1) * (0.4 + u[2]);
            p.cable_creep = 0.005 * s * (0.3 + u[3]);
            p.cable_tau = at(4, 0.008, 0.06);
            place = json!({"position_power": 2});
            vec![
                ("offset_command", p.cable_offset, 0, 1),
                ("quadratic_command", p.cable_quadratic, -2, 1),
                ("creep_stiffness_command", p.cable_creep, -1, 1),
                ("creep_s", p.cable_tau, 0, 0),
            ]
        }
        "nonlinear_spring" => {
            p.cubic = grow(q, 1e-9, 4e-5);
            vec![("cubic_command", p.cubic, -3, 1)]
        }
        "torque_factor_rolloff" => {
            p.rolloff = grow(q, 1e-6, 0.35);
            place = json!({"position_ends": true});
            vec![("drop_at_15", p.rolloff, 0, 0)]
        }
        "torque_ripple" => {
            p.ripple = grow(q, 1e-4, 0.3);
            p.ripple_period = at(0, 2.0, 8.0);
            p.ripple_phase = TAU * u[1];
            vec![("amplitude", p.ripple, 0, 0), ("period", p.ripple_period, 1, 0)]
        }
        "current_saturation" => {
            p.saturation = grow(q, 0.8, 0.1);
            vec![("limit", p.saturation, 0, 1)]
        }
        "slew_limit" => {
            p.slew = grow(q, 3e4, 250.0);
            vec![("limit_per_s", p.slew, 0, 1)]
        }
        "dead_band" => {
            p.dead_band = grow(q, 1e-5, 0.03);
            vec![("half_width", p.dead_band, 0, 1)]
        }
        "amplifier_lag" => {
            p.amplifier_hz = grow(q, 60e3, 1500.0);
            vec![("bandwidth_hz", p.amplifier_hz, 0, 0)]
        }
        "sensor_lag" => {
            p.sensor_hz = grow(q, 60e3, 1500.0);
            vec![("bandwidth_hz", p.sensor_hz, 0, 0)]
        }
        "extra_delay" => {
            p.extra_delay = grow(q, 1e-7, 90e-6);
            vec![("delay_s", p.extra_delay, 0, 0)]
        }
        "gain_drift" => {
            p.gain_drift = sign(0) * grow(q, 1e-4, 0.3);
            p.gain_tau = at(1, 0.3, 4.0);
            vec![("drift_relative", p.gain_drift, 0, 0), ("tau_s", p.gain_tau, 0, 0)]
        }
        "parametric_gain" => {
            p.gain_ripple = grow(q, 1e-4, 0.4);
            p.gain_ripple_hz = at(0, 15.0, 250.0);
            place = json!({"modulation_hz": p.gain_ripple_hz});
            vec![("depth", p.gain_ripple, 0, 0), ("frequency_hz", p.gain_ripple_hz, 0, 0)]
        }
        "encoder_cyclic_error" => {
            p.cyclic = grow(q, 2e-5, 0.09);
            p.cyclic_second = p.cyclic * 0.3 * u[2];
            p.cyclic_period = at(0, 0.6, 4.0);
            p.cyclic_phase = TAU * u[1];
            vec![("amplitude", p.cyclic, 1, 0), ("period", p.cyclic_period, 1, 0)]
        }
        "encoder_scale_error" => {
            p.scale_amplitude = grow(q, 1e-4, 0.6);
            p.scale_period = at(0, 25.0, 60.0);
            p.scale_phase = TAU * u[1];
            vec![("amplitude", p.scale_amplitude, 1, 0), ("period", p.scale_period, 1, 0)]
        }
        "quantisation" => {
            p.quantum = grow(q, 1e-4, 0.06);
            vec![("step", p.quantum, 1, 0)]
        }
        "encoder_noise" => {
            p.speed_noise = grow(q, 3e-7, 1e-4);
            vec![("rms_per_speed_s", p.speed_noise, 0, 0)]
        }
        "jitter" => {
            p.jitter = grow(q, 1e-7, 0.6 * ts);
            vec![("rms_s", p.jitter, 0, 0)]
        }
        "time_base_drift" => {
            p.clock = sign(0) * grow(q, 3e-5, 0.03);
            vec![("relative", p.clock, 0, 0)]
        }
        "unmodelled_resonance" => {
            let gap = grow(q, 2e-5, 0.08);
            let wp = TAU * at(0, 500.0, (0.35 / ts).min(4800.0));
            let zp = at(1, 0.008, 0.04);
            let wz = wp * (1.0 + sign(2) * gap);
            t.plant.modes.push(Mode { wz, zz: zp, wp, zp });
            // The plant below the mode stays as it is.
            t.plant.gain *= (wp / wz).powi(2);
            let f = wp / TAU;
            place = json!({"frequency_hz": [[f * (1.0 - 3.0 * zp - gap), f * (1.0 + 3.0 * zp + gap)]]});
            vec![("frequency_hz", f, 0, 0), ("damping_ratio", zp, 0, 0)]
        }
        "mode_shift" => {
            p.shift_mode = (u[0] * t.plant.modes.len() as f64) as usize;
            p.mode_shift = sign(1) * grow(q, 1e-4, 0.08);
            let f = t.plant.modes[p.shift_mode].wp / TAU;
            place = json!({"frequency_hz": [[f * 0.9, f * 1.1]]});
            vec![("frequency_hz", f, 0, 0), ("shift_at_15", p.mode_shift, 0, 0)]
        }
        "modal_damping" => {
            p.damp_mode = (u[0] * 1.99) as usize;
            p.damp_growth = grow(q, 0.3, 800.0);
            let f = t.plant.modes[p.damp_mode].wp / TAU;
            place = json!({"frequency_hz": [[f * 0.9, f * 1.1]]});
            vec![("frequency_hz", f, 0, 0), ("growth", p.damp_growth, -1, 0)]
        }
        "backlash" => {
            p.play = grow(q, 2e-5, 0.15);
            vec![("gap", p.play, 1, 0)]
        }
        "base_mode" => {
            p.base_ratio = grow(q, 1e-5, 0.1);
            p.base_hz = at(0, 12.0, 60.0);
            p.base_damping = at(1, 0.015, 0.08);
            place = json!({"frequency_hz": [[p.base_hz * 0.7, p.base_hz * 1.4]]});
            vec![
                ("frequency_hz", p.base_hz, 0, 0),
                ("damping_ratio", p.base_damping, 0, 0),
                ("mass_ratio", p.base_ratio, 0, 0),
            ]
        }
        "repeatable_runout" => {
            p.runout = grow(q, 5e-5, 0.25);
            p.runout_second = p.runout * 0.4 * u[0];
            p.runout_phase = TAU * u[1];
            place = json!({"frequency_hz": [[p.spindle_hz - 4.0, p.spindle_hz + 4.0]]});
            vec![("amplitude", p.runout, 1, 0), ("base_hz", p.spindle_hz, 0, 0)]
        }
        "line_disturbance" => {
            p.line = grow(q, 1e-6, 0.06);
            p.line_hz = [50.0, 60.0, 100.0, 180.0, 300.0, at(1, 35.0, 420.0)][(u[0] * 5.99) as usize];
            place = json!({"frequency_hz": [[p.line_hz - 4.0, p.line_hz + 4.0]]});
            vec![("amplitude_command", p.line, 0, 1), ("frequency_hz", p.line_hz, 0, 0)]
        }
        "broadband_disturbance" => {
            p.windage = grow(q, 1e-6, 0.02);
            p.windage_hz = at(0, 40.0, 200.0);
            vec![("rms_command", p.windage, 0, 1), ("corner_hz", p.windage_hz, 0, 0)]
        }
        "shock" => {
            p.shock = sign(0) * grow(q, 1e-5, 0.6);
            p.shock_at = 0.05 + 0.12 * u[1];
            p.shock_length = at(2, 1e-3, 6e-3);
            t.shocked = Some(0);
            place = json!({"time_s": [[p.shock_at, p.shock_at + p.shock_length + 0.01]], "one_record": true});
            vec![
                ("amplitude_command", p.shock, 0, 1),
                ("time_s", p.shock_at, 0, 0),
                ("duration_s", p.shock_length, 0, 0),
            ]
        }
        "offset_drift" => {
            p.offset_rate = sign(0) * grow(q, 1e-5, 0.3);
            p.offset_walk = 0.15 * p.offset_rate.abs() * u[1];
            vec![("rate_command_per_s", p.offset_rate, 0, 1)]
        }
        "aerodynamic_drag" => {
            p.drag = grow(q, 1e-11, 6e-7);
            vec![("command_per_speed2", p.drag, -2, 1)]
        }
        "controller_mismatch" => {
            if u[0] < 0.5 {
                p.law_gain = sign(1) * grow(q, 3e-3, 0.15);
                vec![("gain_relative", p.law_gain, 0, 0)]
            } else {
                p.law_notch = sign(1) * grow(q, 3e-3, 0.12);
                vec![("notch_relative", p.law_notch, 0, 0)]
            }
        }
        "misalignment_whole" => {
            t.faults.shift = sign(0) * (1.0 + (u[1] * 2.99).floor());
            vec![("samples", t.faults.shift, 0, 0)]
        }
        "misalignment_part" => {
            t.faults.shift = sign(0) * (0.25 + 1.5 * u[1]);
            vec![("samples", t.faults.shift, 0, 0)]
        }
        "lost_samples" | "stuck_samples" => {
            let many = 1 + (u[0] * 2.99) as usize;
            let list =
                (0..many).map(|i| (0.15 + 0.7 * (u[1 + i] + i as f64) / many as f64, 1 + (u[5] * 7.99) as usize));
            let list: Vec<(f64, usize)> = list.collect();
            let count: usize = list.iter().map(|l| l.1).sum();
            if name == "lost_samples" {
                t.faults.lost = list
            } else {
                t.faults.stuck = list.iter().map(|l| (l.0, l.1 * 6)).collect()
            }
            t.faults.only = vec![1];
            place = json!({"one_record": true});
            vec![("count", if name == "lost_samples" { count } else { 6 * count } as f64, 0, 0)]
        }
        "sign_flip" => {
            t.faults.factor = -1.0;
            vec![("factor", -1.0, 0, 0)]
        }
        "unit_factor" => {
            t.faults.factor = [TAU, 1.0 / TAU, 1000.0, 1e-3, 0.5, 2.0, 1.0 / 1.188502][(u[0] * 6.99) as usize];
            vec![("factor", t.faults.factor, 0, 0)]
        }
        _ => Vec::new(),
    };
    Fact { figures, place }
}

/// Adds an effect that the library does not hold.
pub fn add_outside(kind: Outside, q: f64, u: &[f64; 8], t: &mut Truth) -> Fact {
    t.physics.outside = kind;
    t.physics.outside_level = grow(q, 1e-7, 0.3);
    t.physics.outside_scale = match kind {
        Outside::SqueezeFilm | Outside::Gyroscopic | Outside::TwoArm => 100.0 + 150.0 * u[0],
        Outside::CoggingLatch => 1.5 + 3.0 * u[0],
        Outside::FractionalCable => 1.0,
        _ => 1.0 + 3.0 * u[0],
    };
    Fact { figures: vec![("level_command", t.physics.outside_level, 0, 1)], place: json!({}) }
}
