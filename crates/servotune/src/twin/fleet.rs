//! A made-up floor: testers of sixteen slots, each slot measured as the factory does, run after run.
//!
//! In: a seed, a number of testers, the number of the run. Out: one [`FleetSlot`] for any index, by itself: a floor of a hundred thousand
//! slots needs no disk and no memory. Spread between testers, three batches of arms, wear from run to run and temperature come on top of
//! the machines of [`crate::twin::line`]. Spec: `specs/fleet.md`, "The made-up floor".

use super::line::{LineMachine, MachineFiles, Truth, UnknownKind, machine_files, measured};
use super::{MachineClass, TwinError};
use crate::lti::{Body, Plant};
use crate::numeric::random::Random;

/// A made-up floor.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetSettings {
    /// Fixes every draw.
    pub seed: u64,
    /// Testers on the floor.
    pub testers: usize,
    /// Slots of each tester, the paper's sixteen.
    pub slots: usize,
    /// Which measurement of the floor, from 0: slots wear from run to run, and each run has its own noise.
    pub run: u64,
}

impl Default for FleetSettings {
    fn default() -> Self {
        FleetSettings { seed: 1, testers: 4, slots: 16, run: 0 }
    }
}

/// One slot of the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetSlot {
    /// Tester, from 1.
    pub tester: usize,
    /// Slot in its tester, from 1.
    pub slot: usize,
    /// What the factory has of it, and the truth behind it: plant as measured, gains in the slot, class.
    pub machine: LineMachine,
    /// Temperature of the base while it was measured (deg C).
    pub temperature_c: f64,
}

/// Share of slots of each class in the paper's order; what is left over is of kinds that no class knows.
const MIX: [f64; 4] = [0.52, 0.05, 0.05, 0.36];
/// Slot-independent spread between testers (relative, one standard deviation): supply voltage and mounting.
const TESTER_GAIN: f64 = 0.02;
const TESTER_FREQUENCY: f64 = 0.006;
/// Batches of arms: factor on the first mode's frequency, and the share of slots.
const BATCHES: [(f64, f64); 3] = [(0.97, 0.2), (1.0, 0.6), (1.03, 0.2)];
/// Wear of one run (relative): gain and mode frequency fall by this, times the slot's own rate (median 1).
const WEAR_GAIN: f64 = 0.003;
const WEAR_FREQUENCY: f64 = 0.0005;
/// Share of slots that wear fast, and how much faster.
const FAST: (f64, f64) = (0.03, 6.0);
/// Temperature at which the machines of the line were measured (deg C), and what a degree does (relative).
pub const REFERENCE_C: f64 = 24.0;
/// Change of the torque constant with a degree (relative): a permanent magnet's.
pub const GAIN_PER_C: f64 = -1.2e-3;
/// Change of natural frequencies with a degree (relative): half of the change of aluminium's modulus.
pub const FREQUENCY_PER_C: f64 = -2.5e-4;
/// Streams: testers, then slots, then the noise of each run.
const TESTERS: u64 = 1 << 40;
const NOISE: u64 = 1 << 41;

impl FleetSettings {
    /// Slots in all.
    pub fn count(&self) -> usize {
        self.testers * self.slots
    }

    /// Name of the slot at `index`: `T001/S01`.
    pub fn id(&self, index: usize) -> String {
        let (tester, slot) = (index / self.slots + 1, index % self.slots + 1);
        format!("T{tester:03}/S{slot:02}")
    }

    /// The slot at `index`, testers in order and slots within.
    pub fn slot(&self, index: usize) -> Result<FleetSlot, TwinError> {
        let (tester, slot) = (index / self.slots, index % self.slots);
        let mut place = Random::stream(self.seed, TESTERS + tester as u64);
        let gain = (TESTER_GAIN * place.normal()).exp();
        let frequency = (TESTER_FREQUENCY * place.normal()).exp();
        let mut own = Random::stream(self.seed, index as u64);
        let mut truth = drawn(&mut own)?;
        let batch = batch(own.uniform());
        if let Some(first) = truth.plant.modes.first_mut() {
            first.zero_rad_s *= batch;
            first.pole_rad_s *= batch;
        }
        let mut rate = (0.5 * own.normal()).exp();
        if own.uniform() < FAST.0 {
            rate *= FAST.1;
        }
        let age = self.run as f64 * rate;
        scale(&mut truth.plant, gain * (-WEAR_GAIN * age).exp(), frequency * (-WEAR_FREQUENCY * age).exp());
        let mut random = Random::stream(self.seed, NOISE + self.run * (1 << 24) + index as u64);
        let pc = slot / 4;
        let temperature_c = REFERENCE_C + 0.8 * pc as f64 - 1.2 + 0.7 * random.normal();
        let warmer = temperature_c - REFERENCE_C;
        scale(&mut truth.plant, (GAIN_PER_C * warmer).exp(), (FREQUENCY_PER_C * warmer).exp());
        truth.profile.noise.seed = random.bits() >> 1;
        let mut machine = measured(self.id(index), truth, &mut random)?;
        for entry in &mut machine.record.log {
            match entry.key.as_str() {
                // The log's tester is the computer that drives four slots.
                "tester" => entry.value = pc as f64,
                "slot" => entry.value = slot as f64,
                "base_temperature_c" => entry.value = temperature_c,
                "base_temperature_f" => entry.value = 32.0 + 1.8 * temperature_c,
                "motor_temperature_c" => entry.value = temperature_c + 6.0 + 0.15 * random.normal(),
                _ => {}
            }
        }
        Ok(FleetSlot { tester: tester + 1, slot: slot + 1, machine, temperature_c })
    }
}

/// A machine of the floor's mix.
fn drawn(random: &mut Random) -> Result<Truth, TwinError> {
    let mut left = random.uniform();
    for (class, share) in MachineClass::ALL.into_iter().zip(MIX) {
        if left < share {
            return Truth::of_class(class, random);
        }
        left -= share;
    }
    let kinds = UnknownKind::ALL;
    let kind = kinds[((random.uniform() * kinds.len() as f64) as usize).min(kinds.len() - 1)];
    Truth::unknown(kind, random)
}

fn batch(mut left: f64) -> f64 {
    for (factor, share) in BATCHES {
        if left < share {
            return factor;
        }
        left -= share;
    }
    1.0
}

/// Gain times `gain`, every mode's and the body's frequency times `frequency`.
fn scale(plant: &mut Plant, gain: f64, frequency: f64) {
    match &mut plant.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s, .. } => {
            *dc_gain *= gain;
            *natural_frequency_rad_s *= frequency;
        }
        Body::FreeInertia { acceleration_gain, .. } => *acceleration_gain *= gain,
        Body::Rational(r) => r.gain *= gain,
    }
    for mode in &mut plant.modes {
        mode.zero_rad_s *= frequency;
        mode.pole_rad_s *= frequency;
    }
}

impl FleetSlot {
    /// The files of the slot's folder: response, PES, log, and the gains in the slot. The log tells no class.
    pub fn files(mut self) -> Result<MachineFiles, TwinError> {
        self.machine.record.label = None;
        self.machine.words.clear();
        let controller = toml::to_string(&self.machine.truth.controller)?;
        let mut files = machine_files(&self.machine)?;
        files.files.push(("controller.toml", controller));
        Ok(files)
    }
}
