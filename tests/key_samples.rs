//! Valid files in which every key stands at least once, and the readers that judge them.
#![allow(clippy::unwrap_used)]

use crate::program_common::folder;
use servotune::controller::{CONTROLLER_KEYS, Controller};
use servotune::document::{KeyFile, parse_toml};
use servotune::lti::{PLANT_KEYS, Plant, PlantFile};
use servotune::pes::{PROFILE_KEYS, Profile};
use servotune::recording::{CASE_KEYS, Case, NominalNoise};
use servotune::tune::{GAIN_TABLE_KEYS, GainTable, SPEC_KEYS, Spec};
use servotune_fleet::{FLEET_KEYS, Fleet};
use std::path::Path;
use toml::{Table, Value};

/// The lists of keys.
pub const FILES: [KeyFile; 7] =
    [PLANT_KEYS, CONTROLLER_KEYS, GAIN_TABLE_KEYS, SPEC_KEYS, PROFILE_KEYS, CASE_KEYS, FLEET_KEYS];

/// The reader's answer, as it prints what it read, or its refusal.
pub fn judge(file: &str, table: &Table) -> Result<String, String> {
    let text = table.to_string();
    let path = Path::new(file);
    match file {
        "plant.toml" => {
            let read: PlantFile = parse_toml(path, &text).map_err(|e| e.to_string())?;
            Plant::try_from(read).map(|p| format!("{p:?}")).map_err(|e| e.to_string())
        }
        "controller.toml" => {
            let read: Controller = parse_toml(path, &text).map_err(|e| e.to_string())?;
            read.check().map(|()| format!("{read:?}")).map_err(|e| e.to_string())
        }
        "gains.toml" => GainTable::parse(path, &text).map(|t| format!("{t:?}")).map_err(|e| e.to_string()),
        "profile.toml" => {
            let read: Profile = parse_toml(path, &text).map_err(|e| e.to_string())?;
            read.check().map(|()| format!("{read:?}")).map_err(|e| e.to_string())
        }
        "FLEET.toml" => Fleet::parse(path, &text).map(|f| format!("{:?}", f.file)).map_err(|e| e.to_string()),
        "spec.toml" => {
            let dir = own_folder();
            std::fs::write(dir.join("profile.toml"), PROFILE).unwrap();
            std::fs::write(dir.join("density.csv"), "frequency_hz,density\n1,1e-6\n100,1e-8\n").unwrap();
            std::fs::write(dir.join(file), text).unwrap();
            Spec::read(&dir.join(file)).map(|s| format!("{s:?}")).map_err(|e| e.to_string())
        }
        _ => {
            let dir = own_folder();
            let inputs: Vec<String> = (1..=9).map(|i| format!("x{i}")).collect();
            let mut record = format!("time_s,reference,command,position,{}\n", inputs.join(","));
            for k in 0..64 {
                record += &format!("{},0,0,{}{}\n", f64::from(k) * 1e-3, f64::from(k) * 0.1, ",0".repeat(9));
            }
            for name in ["one.csv", "two.csv"] {
                std::fs::write(dir.join(name), &record).unwrap();
            }
            std::fs::write(dir.join(file), text).unwrap();
            let noise = NominalNoise::read(&dir).map_err(|e| e.to_string())?;
            Case::read(&dir, &Default::default()).map(|c| format!("{noise:?} {c:?}")).map_err(|e| e.to_string())
        }
    }
}

/// Tests run side by side: each has its folder.
fn own_folder() -> std::path::PathBuf {
    folder(&std::thread::current().name().unwrap_or("key_samples").replace("::", "_"))
}

const PROFILE: &str = include_str!("../specs/profiles/spiral.toml");

/// Valid files.
const SAMPLES: [(&str, &str); 20] = [
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\ndc_gain = 75\nnatural_frequency_rad_s = 369\ndamping_ratio = 0.2\nresonance_gain = 1.2
         delay_s = 1e-4\nmodes = [{ zero_rad_s = 700, zero_damping_ratio = 0.1, pole_rad_s = 800, pole_damping_ratio = 0.1 }]
         physics = [{ effect = 'coulomb_friction', level = 0.1 }]",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\nnatural_frequency_rad_s = 0\nacceleration_gain = 2.0\nviscous_rate_per_s = 1.0
         delay_s = 0\nlag_rad_s = [900.0, 20.0]\nlead_rad_s = [50.0]",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\nnatural_frequency_rad_s = 0\nacceleration_gain = 2.0\nviscous_rate_per_s = 1.0
         delay_s = 0\nlag_hz = [900.0, 20.0]\nlead_hz = [50.0]",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\ngain = 2.0\npoles_rad_s = [-3.0, -4.0]\nzeros_rad_s = [-2.0]\ndelay_s = 0",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\ngain = 2.0\npoles_hz = [-3.0, -4.0]\nzeros_hz = [-2.0]\ndelay_s = 0",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\nnumerator = [1.0]\ndenominator = [1.0, 2.0, 3.0]\ndelay_s = 0",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\na = [[-1.0]]\nb = [1.0]\nc = [1.0]\nd = 0\ndelay_s = 0",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\ndelay_s = 0
         residue = [{ gain = -4.0, frequency_rad_s = 300, damping_ratio = 0.03 }, { gain = 3.0, frequency_rad_s = 0 }]",
    ),
    (
        "plant.toml",
        "position_unit = 'um'\ncommand_unit = 'A'\n[plant]\ndelay_s = 0
         residue = [{ gain = -4.0, frequency_hz = 300, damping_ratio = 0.03 }, { gain = 3.0, frequency_rad_s = 0 }]",
    ),
    ("controller.toml", CONTROLLER),
    ("gains.toml", GAINS),
    ("spec.toml", "profile = 'profile.toml'\nobjective = { minimise = 'room' }\ndisturbance = { psd = 'density.csv' }"),
    (
        "spec.toml",
        "profile = 'profile.toml'\nsample_time_s = 1e-4\nguard = 0.1\nobjective = { minimise = 'dft', bands_hz = [[600, 1500], [1500, 3000]] }
         [disturbance]\nrms = 0.02\ncorner_hz = 15
         [margins]\nphase_margin_deg = 30\ngain_margin_db = 6\nmax_sensitivity = 2\ngain_crossover_hz = [100, 900]\nbandwidth_hz = 50\nphase_stabilised_hz = [[20, 30]]
         [limits]\ndft_low = 1\ndft_high = 1\ncommand_peak = 5\ncommand_rms = 2\novershoot_percent = 30\nsettling_s = 1
         harmonics = [{ k = 1, amplitude = 0.1 }]\nmove = { overshoot = 0.1, settling_s = 1e-4, band = 0.1 }
         curve = [{ of = 'S', side = 'at_most', hz = [1, 5], db = [-40, -20] }]
         [structure]\ncontroller = 'lead'\nderivative_filter_s = 1e-5\npeaks = 1\nfeedforward = true
         [search]\nseed = 3\nnotches = 1\nlowpasses = 2
         bounds = { kp = [0.1, 3], ki_per_s = [1, 100], kd_s = [1e-5, 1e-2], lowpass_hz = [2000, 9000], notch_hz = [500, 6000] }",
    ),
    ("spec.toml", "objective = { minimise = 'disturbance' }\ndisturbance = { psd = 'density.csv' }"),
    (
        "profile.toml",
        "spiral = { velocity = 350, distance = 15, acceleration_time_s = 2e-3, start_s = 8e-3, duration_s = 0.06 }
         pes = { sample_rate_hz = 27480, window = [200, 400] }
         noise = { encoder_rms = 0.1, windage_corner_hz = 60, spindle_hz = 120, seed = 4 }",
    ),
    (
        "profile.toml",
        "spiral = { velocity = 350, distance = 15, acceleration_time_s = 2e-3, start_s = 8e-3, duration_s = 0.06 }
         pes = { sample_rate_hz = 27480, window = [200, 400] }
         noise = { windage_rms = 0.1, windage_corner_hz = 60, spindle_hz = 120, runout = [{ order = 2, amplitude = 0.1, phase_deg = 30 }] }",
    ),
    (
        "case.toml",
        "id = 'one'\nplant = 'plant.toml'\ncontroller = 'controller.toml'\nspindle_hz = 120\nfurther_inputs = ['x1']
         noise = { encoder_rms = 0.1, windage_rms = 0.2 }
         records = [{ file = 'one.csv', role = 'fit', repeat_group = 'a' }, { file = 'two.csv', role = 'fit' }]",
    ),
    (
        "FLEET.toml",
        "gate = 'gate.json'\nspec = 'spec.toml'\ncontroller = 'controller.toml'\nstore = 'store.db'
         input = { hold_included = true, twin = { slots = 32, seed = 3, run = 2 } }
         robust = { draws = 3, seed = 2, guard = 0.02 }
         temperature = { cases_c = [10, 40], measured_c = 25, gain_per_c = 1e-3, frequency_per_c = 1e-4, delay_per_c = 1e-7 }
         tables = { pilots = 8, scouts = 10, candidates = 200, most = 5, coverage = 0.9 }
         untunable = { explained = 3, largest_change = 2 }",
    ),
    ("FLEET.toml", "spec = 'spec.toml'\ncontroller = 'controller.toml'\ninput = { tree = 'floor' }"),
    ("FLEET.toml", "spec = 'spec.toml'\ncontroller = 'controller.toml'\ninput = { table = 'floor.csv' }"),
];

const CONTROLLER: &str = "sample_time_s = 40e-6\noutput_limit = 10
pid = { kp = 0.27, ki_per_s = 60, kd_s = 3e-4, derivative_filter_s = 12e-6 }
lowpass = [{ frequency_hz = 7000, damping_ratio = 0.7 }]
notch = [{ frequency_hz = 1200, zero_damping_ratio = 0.05, pole_damping_ratio = 0.25 }]
biquad = [{ b0 = 1, b1 = 0.1, b2 = 0.1, a1 = 0, a2 = 0.5 }]
feedforward = { factor = 1, velocity_s = 0.1, acceleration_s2 = 0.1, ahead_samples = 2 }";

/// A gain table's own keys beside a controller; its sections come from the controller.
const GAINS: &str = "position_unit = 'um'\ncommand_unit = 'A'\nsample_time_s = 40e-6\npid = { kp = 0.27 }
before = { stable = true, phase_margin_deg = 40, gain_crossover_hz = 300, gain_margin_db = 9, phase_crossover_hz = 900, max_sensitivity = 2, \
    max_sensitivity_hz = 500, modulus_margin = 0.5, delay_margin_s = 1e-4, disk_margin = 0.6, dft_low = 0.1, dft_high = 0.1, command_peak = 2, \
    gain_crossings = [{ hz = 300, value = 40 }], phase_crossings = [{ hz = 900, value = 9 }] }
provenance = { program = '0.1.0', route = 'model', feasible = true, seed = 1, evaluations = 100, spec_sha256 = 'ab', gate_class = 'sound', \
    gate_action = 'tune', gate_probability = 0.9, gate_override = 'asked', physics = ['backlash'], inputs = [{ role = 'plant', sha256 = 'cd' }] }";

/// The valid files of a kind.
pub fn samples(file: &str) -> Vec<Table> {
    let texts = SAMPLES.iter().filter(|(name, _)| *name == file).map(|(_, text)| text.parse::<Table>().unwrap());
    let mut all: Vec<Table> = texts.collect();
    for table in all.iter_mut().filter(|_| file == "gains.toml") {
        let sections = Controller::new(40e-6, table["pid"].clone().try_into().unwrap()).sections().unwrap().chain;
        table.insert("section".into(), Value::try_from(sections).unwrap());
        table.insert("after".into(), table["before"].clone());
    }
    all
}
