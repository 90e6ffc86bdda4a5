//! A slow stage of another make: millimetres, amperes, no spring, friction with a rise at low speed; stepped by Runge and Kutta's fourth order.
//!
//! In: numbers of the stage, reference and excitation. Out: a record as a logger would write it. Nothing of `physics` or `lti` is used.

use servotune::controller::{Controller, Pid};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::f64::consts::TAU;
use std::path::PathBuf;

use super::StudyError;

/// Sample time (s), steps of the integrator a sample, samples of a record.
const T: f64 = 5e-4;
const STEPS: usize = 25;
const N: usize = 4000;

/// What acts beside mass and command (A); 0 is absent.
#[derive(Clone, Copy)]
pub(super) struct Stage {
    /// Acceleration per command (mm/s² per A), viscous rate (1/s).
    pub body: [f64; 2],
    /// Level, rise of it at rest (share), speed of the rise (mm/s), deflection of the bristles (mm), their damping (s): LuGre.
    pub friction: [f64; 5],
    /// Half width of the amplifier's dead band (A).
    pub dead_band: f64,
    /// Noise of the encoder (mm rms).
    pub noise: f64,
    /// Draws phases and noise.
    pub seed: u64,
}

/// A stage with nothing beside its mass: 1.4 m/s² per ampere.
pub(super) const BARE: Stage =
    Stage { body: [1400.0, 6.0], friction: [0.0, 0.0, 1.0, 1.0, 0.0], dead_band: 0.0, noise: 2e-4, seed: 0 };

/// Gains of the controller: A/mm, A/(mm s), A s/mm, s.
const GAINS: [f64; 4] = [7.0, 60.0, 0.11, 1e-3];

type State = [f64; 3];

impl Stage {
    fn slope(&self, [_, v, z]: State, u: f64) -> State {
        let [b, c] = self.body;
        let [level, rise, slow, length, damping] = self.friction;
        if level == 0.0 {
            return [v, b * u - c * v, 0.0];
        }
        let most = level * (1.0 + rise * (-(v / slow).powi(2)).exp());
        let stiffness = level / length;
        let dz = v - stiffness * v.abs() / most * z;
        [v, b * (u - stiffness * z - stiffness * damping * dz) - c * v, dz]
    }

    fn step(&self, s: State, u: f64) -> State {
        let h = T / STEPS as f64;
        let moved = |d: State, by: f64| -> State { std::array::from_fn(|i| s[i] + by * d[i]) };
        let k1 = self.slope(s, u);
        let k2 = self.slope(moved(k1, 0.5 * h), u);
        let k3 = self.slope(moved(k2, 0.5 * h), u);
        let k4 = self.slope(moved(k3, h), u);
        std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }

    /// Reference and excitation to command and position, in closed loop from rest; commands act one sample late.
    pub fn record(&self, reference: &[f64], excitation: &[f64], seed: u64) -> [Vec<f64>; 2] {
        let mut noise = Random::new(seed);
        let [kp, ki, kd, filter] = GAINS;
        let (mut sum, mut rate, mut last, mut acting) = (0.0, 0.0, 0.0, 0.0);
        let mut s: State = [0.0; 3];
        let (mut command, mut position) = (Vec::new(), Vec::new());
        for (r, x) in reference.iter().zip(excitation) {
            let y = s[0] + self.noise * noise.normal();
            let e = r - y;
            sum += ki * T * e;
            rate = (filter * rate + kd * (e - last)) / (T + filter);
            last = e;
            let u: f64 = kp * e + sum + rate;
            command.push(u);
            position.push(y);
            for _ in 0..STEPS {
                s = self.step(s, acting);
            }
            let into = u + x;
            acting = into.signum() * (into.abs() - self.dead_band).max(0.0);
        }
        [command, position]
    }

    /// Case, plant and controller; the plant is fitted to a multisine of `size` while everything acts, or the bare stage's own.
    pub fn made(&self, id: &str, size: Option<f64>) -> Result<(Case, Plant, Controller), StudyError> {
        let still = vec![0.0; N];
        let move_to = |distance: f64, seconds: f64| -> Vec<f64> {
            let at = |t: f64| {
                let s = (t / seconds).clamp(0.0, 1.0);
                distance * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
            };
            (0..N).map(|k| at(k as f64 * T - 0.1)).collect()
        };
        let there_and_back = |distance: f64, period: f64| -> Vec<f64> {
            (0..N).map(|k| 0.5 * distance * (1.0 - (TAU * k as f64 * T / period).cos())).collect()
        };
        let of = |rms, seed| multisine(rms, seed + 100 * self.seed);
        let (fit, held) = (Role::Fit, Role::Holdout);
        type Wanted = (&'static str, usize, Role, Vec<f64>, Vec<f64>);
        let wanted: Vec<Wanted> = vec![
            ("multisine_a", 3, fit, still.clone(), of(0.25, 31)),
            ("multisine_b", 2, fit, still.clone(), of(0.8, 32)),
            ("move_a", 2, fit, move_to(30.0, 0.6), still.clone()),
            ("back_a", 2, fit, there_and_back(4.0, 1.0), still.clone()),
            ("holdout_multisine", 1, held, still.clone(), of(0.5, 33)),
            ("holdout_move", 1, held, move_to(-18.0, 0.5), still),
        ];
        let mut records = Vec::new();
        for (group, count, role, reference, excitation) in wanted {
            for i in 0..count {
                let [command, position] =
                    self.record(&reference, &excitation, 500 + 100 * self.seed + records.len() as u64);
                let file = PathBuf::from(format!("{group}_{i}.csv"));
                let entry = RecordEntry { file: file.clone(), role, repeat_group: Some(group.into()) };
                let record = Record {
                    file,
                    sample_time_s: T,
                    gaps: vec![],
                    reference: Some(reference.clone()),
                    excitation: excitation.clone(),
                    command,
                    position,
                    pes: None,
                    spindle_rad: None,
                    temperature_c: None,
                    further: vec![],
                };
                records.push((entry, record));
            }
        }
        let controller_file = Some(PathBuf::from("controller.toml"));
        let case = Case {
            id: id.into(),
            plant: PathBuf::new(),
            controller: controller_file,
            spindle_hz: None,
            further_inputs: vec![],
            records,
        };
        let [kp, ki_per_s, kd_s, derivative_filter_s] = GAINS;
        let controller = Controller {
            sample_time_s: T,
            output_limit: None,
            pid: Pid { kp, ki_per_s, kd_s, derivative_filter_s },
            lowpass: vec![],
            notch: vec![],
            biquad: vec![],
            feedforward: None,
        };
        Ok((case, self.plant(size)?, controller))
    }

    fn plant(&self, size: Option<f64>) -> Result<Plant, StudyError> {
        let [acceleration_gain, viscous_rate_per_s] = self.body;
        let exact = Plant {
            position_unit: "mm".into(),
            command_unit: "A".into(),
            body: Body::FreeInertia { acceleration_gain, viscous_rate_per_s },
            delay_s: T,
            resonance_gain: 1.0,
            modes: vec![],
            physics: vec![],
        };
        let Some(size) = size else { return Ok(exact) };
        let excitation: Vec<f64> = multisine(size, 17 + 100 * self.seed).iter().cycle().take(5 * N).copied().collect();
        let [command, position] = self.record(&vec![0.0; 5 * N], &excitation, 1 + 100 * self.seed);
        let input: Vec<f64> = command.iter().zip(&excitation).map(|(c, x)| c + x).collect();
        let how = PeriodicSettings { period: N, discard: 1, least_amplitude: 0.02, ..PeriodicSettings::default() };
        let settings = IdentifySettings {
            position_unit: "mm".into(),
            command_unit: "A".into(),
            body: BodyChoice::SecondOrder,
            order: OrderChoice::Fixed(0),
            ..IdentifySettings::default()
        };
        Ok(identify(&periodic(&input, &position, T, &how)?.frf, &settings)?.plant)
    }
}

/// A multisine of this rms (A), 60 lines evenly spread in the logarithm from 0.5 to 400 Hz.
fn multisine(rms: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let base = 1.0 / (N as f64 * T);
    let lines: Vec<(f64, f64)> = (0..60)
        .map(|i| ((0.5 * 800f64.powf(f64::from(i) / 59.0) / base).round().max(1.0) * base, random.between(0.0, TAU)))
        .collect();
    let size = rms * (2.0 / lines.len() as f64).sqrt();
    (0..N).map(|k| size * lines.iter().map(|(hz, p)| (TAU * hz * k as f64 * T + p).cos()).sum::<f64>()).collect()
}
