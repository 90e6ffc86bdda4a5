//! The linear plant as a vector of parameters, and its answer to a given input.
//!
//! Parameters are relative to the plant that the case came with: 0 everywhere is that plant.

use crate::lti::{Body, DiscretePlant, LtiError, Mode, Plant};
use crate::physics::Sample;
use nalgebra::Complex;
use std::f64::consts::PI;

/// One parameter of the linear plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FreeParameter {
    /// Logarithm of the acceleration gain's ratio.
    Gain,
    /// Change of the stiffness over the given one.
    Stiffness,
    /// Change of the viscous rate over the given natural frequency (or over 1/s for a free inertia).
    Viscous,
    /// Change of the delay (samples).
    Delay,
    /// Logarithm of the ratio of a mode's pole frequency.
    Pole(usize),
    /// Logarithm of the ratio of a mode's pole damping.
    PoleDamping(usize),
    /// Logarithm of the ratio of a mode's zero frequency.
    Zero(usize),
    /// Change of a mode's zero damping over its pole damping.
    ZeroDamping(usize),
}

/// Which parameters are free, around which plant.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearForm {
    /// The plant of the case.
    pub given: Plant,
    /// Free parameters, in order.
    pub free_parameters: Vec<FreeParameter>,
    pub(in crate::diagnose) sample_time_s: f64,
}

/// Share of half the sample rate above which a mode is left as it is: records hold nothing about it.
const HIGHEST_MODE: f64 = 0.95;

/// The plant that carries a simulation: gain, delay and modes as the parameters have them, the body's spring and damper as
/// given. Their change acts as a torque along the recorded motion, which is exact for any change and linear in it.
#[derive(Clone, Debug, PartialEq)]
pub struct NominalModel {
    /// The plant.
    pub plant: Plant,
    /// Torque per position (command_unit per position_unit).
    pub spring: f64,
    /// Torque per velocity (command_unit s per position_unit).
    pub damper: f64,
}

impl NominalModel {
    /// The arm's own position over the recorded one, both at rest: 1 over the modes' gain at rest.
    pub fn arm_over_record(&self) -> f64 {
        self.plant.modes.iter().map(|m| (m.pole_rad_s / m.zero_rad_s).powi(2)).product()
    }

    /// The torque of spring and damper along a recorded motion (command_unit): the mean over each interval, by the trapezium.
    pub(in crate::diagnose) fn torque(&self, motion: &[Sample]) -> Vec<f64> {
        let by = self.arm_over_record();
        let at = |s: &Sample| by * (self.spring * s.x + self.damper * s.v);
        let last = motion.len().saturating_sub(1);
        (0..motion.len()).map(|k| 0.5 * (at(&motion[k]) + at(&motion[(k + 1).min(last)]))).collect()
    }
}

impl LinearForm {
    /// All parameters that records at this sample time can tell.
    pub fn new(given: &Plant, sample_time_s: f64) -> LinearForm {
        let mut free_parameters = vec![FreeParameter::Gain];
        if matches!(given.body, Body::SecondOrder { .. }) {
            free_parameters.push(FreeParameter::Stiffness);
        }
        free_parameters.extend([FreeParameter::Viscous, FreeParameter::Delay]);
        let highest = HIGHEST_MODE * std::f64::consts::PI / sample_time_s;
        for (i, m) in given.modes.iter().enumerate() {
            if m.pole_rad_s < highest {
                free_parameters.extend([
                    FreeParameter::Pole(i),
                    FreeParameter::PoleDamping(i),
                    FreeParameter::Zero(i),
                    FreeParameter::ZeroDamping(i),
                ]);
            }
        }
        LinearForm { given: given.clone(), free_parameters, sample_time_s }
    }

    /// The parameters of a plant that differs from the given one in body and delay; none where its gain is of the other sign.
    pub fn numbers_of(&self, plant: &Plant) -> Option<Vec<f64>> {
        let (b0, k0, c0) = body_numbers(&self.given.body);
        let (b, k, c) = body_numbers(&plant.body);
        let ratio = b * plant.resonance_gain / (b0 * self.given.resonance_gain);
        let number = |free_parameter: &FreeParameter| match free_parameter {
            FreeParameter::Gain => ratio.ln(),
            FreeParameter::Stiffness => k / k0 - 1.0,
            FreeParameter::Viscous => (c - c0) / rate_of(&self.given.body),
            FreeParameter::Delay => (plant.delay_s - self.given.delay_s) / self.sample_time_s,
            _ => 0.0,
        };
        let all: Vec<f64> = self.free_parameters.iter().map(number).collect();
        (ratio > 0.0 && all.iter().all(|v| v.is_finite())).then_some(all)
    }

    /// The plant that carries a simulation at these parameters.
    pub fn nominal(&self, p: &[f64]) -> NominalModel {
        let mut held = p.to_vec();
        let (mut spring, mut damper) = (0.0, 0.0);
        let (b, k, _) = body_numbers(&self.given.body);
        let mut gain = b * self.given.resonance_gain;
        for (free_parameter, value) in self.free_parameters.iter().zip(held.iter_mut()) {
            match free_parameter {
                FreeParameter::Gain => gain *= value.exp(),
                FreeParameter::Stiffness => spring = -k * std::mem::take(value),
                FreeParameter::Viscous => damper = -rate_of(&self.given.body) * std::mem::take(value),
                _ => {}
            }
        }
        NominalModel { plant: self.plant(&held), spring: spring / gain, damper: damper / gain }
    }

    /// The plant at these parameters; values that make no plant are taken to the nearest that do.
    pub fn plant(&self, p: &[f64]) -> Plant {
        let mut plant = self.given.clone();
        let (mut gain, mut stiffness, mut viscous) = body_numbers(&plant.body);
        let (k0, rate) = (stiffness, rate_of(&plant.body));
        for (free_parameter, &value) in self.free_parameters.iter().zip(p) {
            match *free_parameter {
                FreeParameter::Gain => gain *= value.exp(),
                FreeParameter::Stiffness => stiffness = k0 * (1.0 + value),
                FreeParameter::Viscous => viscous += rate * value,
                FreeParameter::Delay => plant.delay_s = (plant.delay_s + value * self.sample_time_s).max(0.0),
                FreeParameter::Pole(i) => plant.modes[i].pole_rad_s *= value.exp(),
                FreeParameter::PoleDamping(i) => plant.modes[i].pole_damping_ratio *= value.exp(),
                FreeParameter::Zero(i) => plant.modes[i].zero_rad_s *= value.exp(),
                FreeParameter::ZeroDamping(i) => {
                    plant.modes[i].zero_damping_ratio += value * self.given.modes[i].pole_damping_ratio;
                }
            }
        }
        plant.body = match self.given.body {
            Body::SecondOrder { .. } => {
                let k = stiffness.max(1e-6 * k0);
                let w0 = k.sqrt();
                Body::SecondOrder {
                    dc_gain: gain / k,
                    natural_frequency_rad_s: w0,
                    damping_ratio: (viscous / (2.0 * w0)).max(1e-6 * (k0 / k).sqrt()),
                }
                .on_a_spring()
            }
            Body::FreeInertia { .. } => {
                Body::FreeInertia { acceleration_gain: gain, viscous_rate_per_s: viscous.max(0.0) }
            }
            Body::Rational(ref r) => Body::Rational(r.clone()),
        };
        plant
    }
}

/// Acceleration gain, stiffness (1/s²) and viscous rate (1/s) of a body: x'' = gain u - viscous x' - stiffness x.
pub fn body_numbers(body: &Body) -> (f64, f64, f64) {
    match *body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
            (dc_gain * w * w, w * w, 2.0 * damping_ratio * w)
        }
        Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => (acceleration_gain, 0.0, viscous_rate_per_s),
        // Refused at the door of the room.
        Body::Rational(ref r) => (r.gain, 0.0, 0.0),
    }
}

/// The unit of the viscous parameter (1/s).
pub(in crate::diagnose) fn rate_of(body: &Body) -> f64 {
    match *body {
        Body::SecondOrder { natural_frequency_rad_s, .. } => natural_frequency_rad_s,
        Body::FreeInertia { viscous_rate_per_s, .. } => viscous_rate_per_s.max(1.0),
        Body::Rational(_) => 1.0,
    }
}

/// The sampled plant for commands (with its delay) and for torques on the arm (without).
#[derive(Clone, Debug)]
pub struct Sampled {
    /// With the delay.
    pub delayed: DiscretePlant,
    /// Without.
    pub direct: DiscretePlant,
}

impl Sampled {
    /// Samples a plant both ways.
    pub fn of(plant: &Plant, sample_time_s: f64) -> Result<Sampled, LtiError> {
        let delayed = DiscretePlant::of(plant, sample_time_s)?;
        let direct = DiscretePlant::of(&Plant { delay_s: 0.0, ..plant.clone() }, sample_time_s)?;
        Ok(Sampled { delayed, direct })
    }
}

/// Sizes of the free motions: position, velocity (1/s), acceleration (1/s²) at the start.
pub fn free_scales(body: &Body, sample_time_s: f64, n: usize) -> [f64; 3] {
    let (_, k, _) = body_numbers(body);
    let rate = 1.0 / (n as f64 * sample_time_s);
    [1.0, k.sqrt().max(rate), k.max(rate * rate)]
}

/// Free motions of the body over `n` samples: from a position, from a velocity, and under a constant torque. Each has a
/// size near 1, so that they stay apart in a fit.
pub fn free_motions(body: &Body, sample_time_s: f64, n: usize) -> [Vec<f64>; 3] {
    let (_, k, c) = body_numbers(body);
    let step = nalgebra::Matrix3::new(0.0, 1.0, 0.0, -k, -c, 1.0, 0.0, 0.0, 0.0) * sample_time_s;
    let step = step.exp();
    let scale = free_scales(body, sample_time_s, n);
    std::array::from_fn(|i| {
        let mut z = nalgebra::Vector3::zeros();
        z[i] = scale[i];
        (0..n)
            .map(|_| {
                let x = z[0];
                z = step * z;
                x
            })
            .collect()
    })
}

/// Samples over which a mode must ring to be seen.
const RINGS: f64 = 4.0;
/// Most commands on their way as a record begins, the newest.
const ON_THEIR_WAY: usize = 32;

/// What a record carries over from before it beside the body's motion, each of a size near 1: none where it begins at rest. A log may be cut out of a
/// running machine, or its drive may set in with its first sample.
pub fn carried_over(plant: &Plant, rested: bool, sample_time_s: f64, n: usize) -> Vec<Vec<f64>> {
    if rested { Vec::new() } else { [ringing(plant, sample_time_s, n), arriving(plant, sample_time_s, n)].concat() }
}

/// What modes ring, two motions each; none of those that die within few samples or lie above half the sample rate.
fn ringing(plant: &Plant, sample_time_s: f64, n: usize) -> Vec<Vec<f64>> {
    let seen = |m: &&Mode| {
        let (w, z) = (m.pole_rad_s * sample_time_s, m.pole_damping_ratio);
        z < 1.0 && w < PI && z * w * RINGS < 1.0
    };
    let swing = |m: &Mode| {
        let (w, z) = (m.pole_rad_s * sample_time_s, m.pole_damping_ratio);
        let step = Complex::new(-z * w, w * (1.0 - z * z).sqrt()).exp();
        let all: Vec<Complex<f64>> =
            std::iter::successors(Some(Complex::new(1.0, 0.0)), |q| Some(q * step)).take(n).collect();
        [all.iter().map(|q| q.re).collect(), all.iter().map(|q| q.im).collect::<Vec<f64>>()]
    };
    plant.modes.iter().filter(seen).flat_map(swing).collect()
}

/// What commands before the record make that the plant's delay still holds back: nobody recorded them.
fn arriving(plant: &Plant, sample_time_s: f64, n: usize) -> Vec<Vec<f64>> {
    let Some(delayed) = DiscretePlant::of(plant, sample_time_s).ok().filter(|_| plant.delay_s > 0.0) else {
        return Vec::new();
    };
    let held_back = (delayed.whole_delay_samples() + 1).min(ON_THEIR_WAY);
    let mut pulse = vec![0.0; n + held_back];
    pulse[0] = 1.0;
    let mut answer = vec![0.0; n + held_back];
    delayed.add_response(&pulse, &mut answer);
    let most = answer.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    answer.iter_mut().for_each(|v| *v /= most.max(f64::MIN_POSITIVE));
    (1..=held_back).map(|early| answer[early..early + n].to_vec()).collect()
}

/// Motions that a record may begin with: free motions of the body under a constant torque, and what it carries over.
pub fn starts(plant: &Plant, rested: bool, sample_time_s: f64, n: usize) -> Vec<Vec<f64>> {
    let over = carried_over(plant, rested, sample_time_s, n);
    free_motions(&plant.body, sample_time_s, n).into_iter().chain(over).collect()
}
