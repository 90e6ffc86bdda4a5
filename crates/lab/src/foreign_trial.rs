//! A trial of a machine of another make: its records, and the linear model that a user would have given.

use super::StudyError;
use super::foreign::{Foreign, GAINS, OUTPUT, T};
use rayon::prelude::*;
use servotune::controller::{Controller, Pid};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Lines of an excitation.
const LINES: usize = 70;

/// Which linear model the user gives.
#[derive(Clone, Copy)]
pub(super) enum Model {
    /// The nominal one.
    Exact,
    /// The one fitted to a multisine of this size while everything acted.
    Fitted(f64),
}

/// A machine, what it is driven by, and which model of it is given.
#[derive(Clone, Copy)]
pub(super) struct Trial {
    pub machine: Foreign,
    /// Body of the nominal model, as in [`Foreign::body`].
    pub nominal: [f64; 3],
    pub model: Model,
    /// Sizes of the two multisines (rms of the excitation).
    pub sizes: [f64; 2],
    /// Samples of a record.
    pub samples: usize,
    /// Draws phases and noise.
    pub seed: u64,
}

/// A multisine of this rms, lines evenly spread in the logarithm from 13 Hz to 5 kHz.
fn multisine(rms: f64, samples: usize, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let base = 1.0 / (samples as f64 * T);
    let lines: Vec<(f64, f64)> = (0..LINES)
        .map(|i| {
            (
                (13.0 * (5000.0f64 / 13.0).powf(i as f64 / (LINES - 1) as f64) / base).round().max(1.0) * base,
                random.between(0.0, TAU),
            )
        })
        .collect();
    let size = rms * (2.0 / LINES as f64).sqrt();
    (0..samples).map(|k| size * lines.iter().map(|(hz, p)| (TAU * hz * k as f64 * T + p).cos()).sum::<f64>()).collect()
}

/// A move over `distance` at `velocity`, reached in 2 ms, begun at 8 ms.
fn spiral(velocity: f64, distance: f64, samples: usize) -> Vec<f64> {
    let (start, rise) = (8e-3, 2e-3);
    let cruise = (distance / velocity - rise).max(0.0);
    let ramp = |t: f64| {
        if t <= 0.0 {
            0.0
        } else if t < rise {
            0.5 * velocity * t * t / rise
        } else {
            velocity * (t - 0.5 * rise)
        }
    };
    let at = |t: f64| ramp(t) - ramp(t - rise - cruise);
    (0..samples).map(|k| at(k as f64 * T - start)).collect()
}

/// Group, number of repeats, role, reference and excitation.
type Wanted = (&'static str, usize, Role, Vec<f64>, Vec<f64>);
/// File, group, role, reference and excitation of one record.
type Single<'a> = (String, &'a str, Role, &'a [f64], &'a [f64]);

impl Trial {
    fn plant(&self) -> Result<Plant, StudyError> {
        let [b, k, c] = self.nominal;
        let n = self.samples;
        let delay_s = self.machine.delay as f64 * T / 40.0;
        let exact = Plant {
            position_unit: "track".into(),
            command_unit: "V".into(),
            body: Body::SecondOrder {
                dc_gain: b / k,
                natural_frequency_rad_s: k.sqrt(),
                damping_ratio: 0.5 * c / k.sqrt(),
            },
            delay_s,
            resonance_gain: 1.0,
            modes: vec![],
            physics: vec![],
        };
        let Model::Fitted(size) = self.model else { return Ok(exact) };
        let period = multisine(size, n, 17 + 100 * self.seed);
        let excitation: Vec<f64> = period.iter().cycle().take(5 * n).copied().collect();
        let [command, position] = self.machine.record(&vec![0.0; 5 * n], &excitation, 1 + 100 * self.seed);
        let input: Vec<f64> = command.iter().zip(&excitation).map(|(c, x)| c + x).collect();
        let how = PeriodicSettings { period: n, discard: 1, least_amplitude: 0.02, ..PeriodicSettings::default() };
        let settings = IdentifySettings {
            position_unit: "track".into(),
            command_unit: "V".into(),
            body: BodyChoice::SecondOrder,
            order: OrderChoice::Fixed(0),
            ..IdentifySettings::default()
        };
        Ok(identify(&periodic(&input, &position, T, &how)?.frf, &settings)?.plant)
    }

    /// Case, plant and controller.
    pub fn made(&self, id: &str) -> Result<(Case, Plant, Controller), StudyError> {
        Ok((self.case(id), self.plant()?, controller()))
    }

    fn noise_seed(&self, record: usize) -> u64 {
        1000 + 100 * self.seed + record as u64
    }

    /// What the machine itself, simulated without the encoder's noise, leaves of some of the records (mean square): nothing explains that. In a
    /// loop it is more than the noise, which moves the machine.
    pub fn left_by_itself(&self, records: &[usize]) -> f64 {
        let quiet = Foreign { noise: 0.0, ..self.machine };
        let wanted = self.wanted();
        let all: Vec<&Wanted> = wanted.iter().flat_map(|w| (0..w.1).map(move |_| w)).collect();
        let squares = records.iter().map(|&i| {
            let (_, _, _, reference, excitation) = all[i];
            let [heard, still] = [&self.machine, &quiet].map(|m| m.record(reference, excitation, self.noise_seed(i)));
            heard[1].iter().zip(&still[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        });
        squares.sum::<f64>() / (records.len() * self.samples) as f64
    }

    /// The records that are made: name of the group, repeats, role, reference, excitation.
    fn wanted(&self) -> Vec<Wanted> {
        let n = self.samples;
        let still = vec![0.0; n];
        let of = |rms, seed| multisine(rms, n, seed + 100 * self.seed);
        let [small, large] = self.sizes;
        let fit = Role::Fit;
        vec![
            ("multisine_a", 4, fit, still.clone(), of(small, 21)),
            ("multisine_b", 2, fit, still.clone(), of(large, 22)),
            ("spiral_a", 2, fit, spiral(120.0, 4.0, n), still.clone()),
            ("spiral_b", 2, fit, spiral(-350.0, -15.0, n), still.clone()),
            ("holdout_multisine", 1, Role::Holdout, still.clone(), of(0.7 * large, 23)),
            ("holdout_spiral", 1, Role::Holdout, spiral(250.0, 10.0, n), still),
        ]
    }

    /// The records.
    pub fn case(&self, id: &str) -> Case {
        let wanted = self.wanted();
        let single: Vec<Single<'_>> = wanted
            .iter()
            .flat_map(|(group, n, role, r, x)| {
                (0..*n).map(move |i| (format!("{group}_{i}.csv"), *group, *role, &r[..], &x[..]))
            })
            .collect();
        let records = single
            .into_par_iter()
            .enumerate()
            .map(|(i, (name, group, role, reference, excitation))| {
                let [command, position] = self.machine.record(reference, excitation, self.noise_seed(i));
                let file = PathBuf::from(name);
                let entry = RecordEntry { file: file.clone(), role, repeat_group: Some(group.into()) };
                let record = Record {
                    file,
                    sample_time_s: T,
                    gaps: vec![],
                    reference: Some(reference.to_vec()),
                    excitation: excitation.to_vec(),
                    command,
                    position,
                    pes: None,
                    spindle_rad: None,
                    temperature_c: None,
                    further: vec![],
                };
                (entry, record)
            })
            .collect();
        Case {
            id: id.into(),
            plant: PathBuf::new(),
            controller: Some(PathBuf::from("controller.toml")),
            spindle_hz: (self.machine.runout[0] > 0.0).then_some(self.machine.runout[1]),
            further_inputs: vec![],
            records,
        }
    }
}

/// The controller that made the records.
fn controller() -> Controller {
    let [kp, ki_per_s, kd_s, derivative_filter_s] = GAINS;
    Controller {
        sample_time_s: T,
        output_limit: Some(OUTPUT),
        pid: Pid { kp, ki_per_s, kd_s, derivative_filter_s },
        lowpass: vec![],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    }
}
