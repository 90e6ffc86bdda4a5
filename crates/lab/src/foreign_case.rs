//! Cases of a machine of another make: its records, and the linear model that a user would have given.

use super::StudyError;
use super::foreign::{Foreign, GAINS, Joint, OUTPUT, SOUND, T};
use rayon::prelude::*;
use servotune::controller::{Controller, Pid};
use servotune::frf::{PeriodicSettings, periodic};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Samples of a record.
const N: usize = 4000;
/// Lines of an excitation.
const LINES: usize = 70;

/// Which linear model the user gives.
#[derive(Clone, Copy)]
pub(super) enum Model {
    /// The machine's own linear part.
    Exact,
    /// The one fitted to a multisine of this size while everything acted.
    Fitted(f64),
}

/// One case and what a servo engineer expects.
pub(super) struct Foretold {
    pub id: &'static str,
    pub what: &'static str,
    pub expected: &'static [&'static str],
    pub machine: Foreign,
    pub model: Model,
    /// Sizes of the two multisines (rms of the excitation).
    pub sizes: [f64; 2],
}

/// The cases of the page.
pub(super) fn foretold() -> Vec<Foretold> {
    let sizes = [0.05, 0.2];
    let all = |id, what, expected, machine, model| Foretold { id, what, expected, machine, model, sizes };
    let joint = |behind| Foreign { joint: Some(Joint { gap: 0.05, contact_hz: 2400.0, share: 0.15, behind }), ..SOUND };
    let dry = |level| Foreign { bristles: [level, 0.004], ..SOUND };
    let dead = |half| Foreign { dead_band: half, ..SOUND };
    let bearing = Foreign { bearing: [0.05, 3.0], ..SOUND };
    vec![
        all("sound", "nothing", &[], SOUND, Model::Exact),
        all(
            "linear_off",
            "linear part fitted at another place",
            &[],
            Foreign { body: [1.1e7, 1.6e5, 140.0], ..SOUND },
            Model::Exact,
        ),
        all(
            "friction_hidden_1",
            "dry friction 0.05 V, model fitted under it at the small multisine",
            &["coulomb_friction"],
            dry(0.05),
            Model::Fitted(0.05),
        ),
        all(
            "friction_hidden_2",
            "dry friction 0.12 V, model fitted under it at the large multisine",
            &["coulomb_friction"],
            dry(0.12),
            Model::Fitted(0.2),
        ),
        all(
            "dead_band_hidden_1",
            "dead band of 0.03 V, model fitted under it at the small multisine",
            &["dead_band"],
            dead(0.03),
            Model::Fitted(0.05),
        ),
        all(
            "dead_band_hidden_2",
            "dead band of 0.06 V, model fitted under it at the large multisine",
            &["dead_band"],
            dead(0.06),
            Model::Fitted(0.2),
        ),
        all(
            "lattice",
            "encoder counts of 0.06 track",
            &["quantisation"],
            Foreign { lattice: 0.06, ..SOUND },
            Model::Exact,
        ),
        all(
            "lattice_bearing",
            "encoder counts of 0.05 track beside pivot friction",
            &["pivot_friction", "quantisation"],
            Foreign { lattice: 0.05, ..bearing },
            Model::Exact,
        ),
        all(
            "wind",
            "torque noise of 0.04 V with a corner of 250 Hz",
            &["broadband_disturbance"],
            Foreign { wind: [0.04, 250.0], ..SOUND },
            Model::Exact,
        ),
        all(
            "play_before",
            "play of 0.05 track, contact of 2.4 kHz, encoder on the motor's side",
            &["backlash"],
            joint(false),
            Model::Exact,
        ),
        all("play_behind", "the same, encoder behind the play", &["backlash"], joint(true), Model::Exact),
        Foretold {
            sizes: [0.1, 0.16],
            ..all(
                "bristles",
                "dry friction of 0.09 V whose bristles give way over 0.02 track, small motion",
                &["coulomb_friction"],
                Foreign { bristles: [0.09, 0.02], ..SOUND },
                Model::Exact,
            )
        },
        all(
            "bearing_runout",
            "pivot friction beside run-out of 0.02 track at 120 Hz",
            &["pivot_friction", "repeatable_runout"],
            Foreign { runout: [0.02, 120.0], ..bearing },
            Model::Exact,
        ),
        all(
            "limit_runout",
            "an amplifier limited to 0.6 V beside run-out of 0.02 track at 120 Hz",
            &["current_saturation", "repeatable_runout"],
            Foreign { limit: 0.6, runout: [0.02, 120.0], ..SOUND },
            Model::Exact,
        ),
        all(
            "friction_cyclic",
            "dry friction of 0.05 V beside a cyclic error of 0.02 track over 1.3 track",
            &["coulomb_friction", "encoder_cyclic_error"],
            Foreign { cyclic: [0.02, 1.3], ..dry(0.05) },
            Model::Exact,
        ),
        all(
            "push",
            "a push of 0.3 V over 4 ms at 0.08 s of every record",
            &["shock"],
            Foreign { push: [0.08, 0.004, 0.3], ..SOUND },
            Model::Exact,
        ),
    ]
}

/// A multisine of this rms, lines evenly spread in the logarithm from 13 Hz to 5 kHz.
fn multisine(rms: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let base = 1.0 / (N as f64 * T);
    let lines: Vec<(f64, f64)> = (0..LINES)
        .map(|i| {
            (
                (13.0 * (5000.0f64 / 13.0).powf(i as f64 / (LINES - 1) as f64) / base).round().max(1.0) * base,
                random.between(0.0, TAU),
            )
        })
        .collect();
    let size = rms * (2.0 / LINES as f64).sqrt();
    (0..N).map(|k| size * lines.iter().map(|(hz, p)| (TAU * hz * k as f64 * T + p).cos()).sum::<f64>()).collect()
}

/// A move over `distance` at `velocity`, reached in 2 ms, begun at 8 ms.
fn spiral(velocity: f64, distance: f64) -> Vec<f64> {
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
    (0..N).map(|k| at(k as f64 * T - start)).collect()
}

/// Group, number of repeats, role, reference and excitation.
type Wanted = (&'static str, usize, Role, Vec<f64>, Vec<f64>);
/// File, group, role, reference and excitation of one record.
type Single<'a> = (String, &'a str, Role, &'a [f64], &'a [f64]);

impl Foretold {
    fn plant(&self) -> Result<Plant, StudyError> {
        let [b, k, c] = match self.id {
            "linear_off" => SOUND.body,
            _ => self.machine.body,
        };
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
        let period = multisine(size, 17);
        let excitation: Vec<f64> = period.iter().cycle().take(5 * N).copied().collect();
        let [command, position] = self.machine.record(&vec![0.0; 5 * N], &excitation, 1);
        let input: Vec<f64> = command.iter().zip(&excitation).map(|(c, x)| c + x).collect();
        let how = PeriodicSettings { period: N, discard: 1, least_amplitude: 0.02, ..PeriodicSettings::default() };
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
    pub fn made(&self) -> Result<(Case, Plant, Controller), StudyError> {
        let still = vec![0.0; N];
        let [small, large] = self.sizes;
        let mut wanted: Vec<Wanted> = Vec::new();
        let fit = Role::Fit;
        wanted.push(("multisine_a", 4, fit, still.clone(), multisine(small, 21)));
        wanted.push(("multisine_b", 2, fit, still.clone(), multisine(large, 22)));
        wanted.push(("spiral_a", 2, fit, spiral(120.0, 4.0), still.clone()));
        wanted.push(("spiral_b", 2, fit, spiral(-350.0, -15.0), still.clone()));
        wanted.push(("holdout_multisine", 1, Role::Holdout, still.clone(), multisine(0.7 * large, 23)));
        wanted.push(("holdout_spiral", 1, Role::Holdout, spiral(250.0, 10.0), still));
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
                let [command, position] = self.machine.record(reference, excitation, 1000 + i as u64);
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
                };
                (entry, record)
            })
            .collect();
        let case = Case {
            id: self.id.into(),
            plant: PathBuf::new(),
            controller: Some(PathBuf::from("controller.toml")),
            spindle_hz: (self.machine.runout[0] > 0.0).then_some(120.0),
            records,
        };
        let [kp, ki_per_s, kd_s, derivative_filter_s] = GAINS;
        let pid = Pid { kp, ki_per_s, kd_s, derivative_filter_s };
        let controller = Controller {
            sample_time_s: T,
            output_limit: Some(OUTPUT),
            pid,
            lowpass: vec![],
            notch: vec![],
            biquad: vec![],
            feedforward: None,
        };
        Ok((case, self.plant()?, controller))
    }
}
