//! What a machine of the line is: its plant, its controller, its disturbances, and how far its fault has gone.
//!
//! In: a class and a random stream. Out: [`Truth`]. Severity 0 is healthy, 1 is the paper's machine of the class; between and
//! beyond, frequencies, gains and noise go by the same ratios (`specs/gate_twin.md`).

use super::unknown_kind::UnknownKind;
use crate::controller::Controller;
use crate::lti::{Body, Plant};
use crate::numeric::random::Random;
use crate::pes::Profile;
use crate::twin::{MachineClass, TwinError, nominal_controller, paper_machine, paper_profile};

/// One machine as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Its class; `None` for a kind that no class knows.
    pub class: Option<MachineClass>,
    /// Its unknown kind.
    pub kind: Option<UnknownKind>,
    /// How far its fault has gone: 0 healthy, 1 the paper's.
    pub severity: f64,
    /// The plant.
    pub plant: Plant,
    /// The controller in its slot.
    pub controller: Controller,
    /// Its write with its own disturbances.
    pub profile: Profile,
    /// Relative complex noise of its swept sine.
    pub sweep_noise: f64,
    /// Its servo clock over the clock that its record states.
    pub clock_ratio: f64,
    /// Share of servo samples that its record loses.
    pub lost_share: f64,
}

/// Machine-to-machine deviations of healthy machines (relative, one standard deviation).
const SPREAD_GAIN: f64 = 0.02;
const SPREAD_BODY: f64 = 0.015;
const SPREAD_BODY_DAMPING: f64 = 0.06;
const SPREAD_MODE: f64 = 0.01;
const SPREAD_MODE_DAMPING: f64 = 0.1;
const SPREAD_DELAY: f64 = 0.03;
const SPREAD_NOISE: f64 = 0.1;
const SPREAD_WINDAGE: f64 = 0.25;
/// Deviations beyond this many are sent back by the incoming inspection.
const INSPECTED: f64 = 2.5;
/// Relative complex noise of a healthy machine's sweep: 0.1 dB on each point, as in figure 5.
const SWEEP_NOISE: f64 = 0.012;
/// Least and largest severity of the classes 1 to 3; see `specs/gate_twin.md`.
const SEVERITY: [[f64; 2]; 3] = [[0.3, 1.25], [0.75, 1.1], [0.35, 1.6]];
/// A third of the encoder voltage at severity 1: three times the noise (section 2.7, figure 17).
const ENCODER_RATIO: f64 = 3.0;
/// Largest loss of loop gain in the slot of a tunable machine at severity 1 (natural logarithm).
const DRIFT: f64 = 0.08;

/// A ratio around 1, even in its logarithm, inside what inspection lets pass.
fn spread(random: &mut Random, deviation: f64) -> f64 {
    loop {
        let z = random.normal();
        if z.abs() <= INSPECTED {
            return (deviation * z).exp();
        }
    }
}

/// Between `a` at share 0 and `b` at share 1 by equal ratios, and on beyond.
fn blend(a: f64, b: f64, share: f64) -> f64 {
    a * (b / a).powf(share)
}

impl Truth {
    /// A machine of a class.
    pub fn of_class(class: MachineClass, random: &mut Random) -> Result<Truth, TwinError> {
        let severity = match class {
            MachineClass::Healthy => 0.0,
            _ => {
                let [low, high] = SEVERITY[class as usize - 1];
                // The mean of two even draws: ends are rarer than the middle, and nothing lies outside.
                low + (high - low) * 0.5 * (random.uniform() + random.uniform())
            }
        };
        let mut truth = Truth::healthy(random)?;
        truth.class = Some(class);
        truth.severity = severity;
        truth.wear(class, random)?;
        Ok(truth)
    }

    /// A healthy machine with its own deviations.
    pub(super) fn healthy(random: &mut Random) -> Result<Truth, TwinError> {
        let mut plant = paper_machine(MachineClass::Healthy)?;
        if let Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } = &mut plant.body {
            *dc_gain *= spread(random, SPREAD_GAIN);
            *natural_frequency_rad_s *= spread(random, SPREAD_BODY);
            *damping_ratio *= spread(random, SPREAD_BODY_DAMPING);
        }
        plant.delay_s *= spread(random, SPREAD_DELAY);
        for mode in &mut plant.modes {
            // Pole and zero of a pair move together; their distance, which is the height, changes a little.
            let together = spread(random, SPREAD_MODE);
            let apart = spread(random, SPREAD_MODE_DAMPING);
            mode.zero_rad_s = mode.pole_rad_s * together * (mode.zero_rad_s / mode.pole_rad_s).powf(apart);
            mode.pole_rad_s *= together;
            let damping = spread(random, SPREAD_MODE_DAMPING);
            mode.pole_damping_ratio *= damping;
            mode.zero_damping_ratio *= damping;
        }
        let mut profile = paper_profile(MachineClass::Healthy)?;
        profile.noise.encoder_rms *= spread(random, SPREAD_NOISE);
        profile.noise.windage_rms *= spread(random, SPREAD_WINDAGE);
        profile.noise.seed = random.bits() >> 1;
        Ok(Truth {
            class: Some(MachineClass::Healthy),
            kind: None,
            severity: 0.0,
            plant,
            controller: nominal_controller()?,
            profile,
            sweep_noise: SWEEP_NOISE * spread(random, SPREAD_NOISE),
            clock_ratio: 1.0,
            lost_share: 0.0,
        })
    }

    /// Lets the fault of a class go as far as the severity says: the paper's machine of the class is severity 1.
    fn wear(&mut self, class: MachineClass, random: &mut Random) -> Result<(), TwinError> {
        let (whole, worn) = (paper_machine(MachineClass::Healthy)?, paper_machine(class)?);
        let share = self.severity;
        if let (
            Body::SecondOrder { dc_gain: k, natural_frequency_rad_s: w, damping_ratio: z },
            Body::SecondOrder { dc_gain: k0, natural_frequency_rad_s: w0, damping_ratio: z0 },
            Body::SecondOrder { dc_gain: k1, natural_frequency_rad_s: w1, damping_ratio: z1 },
        ) = (&mut self.plant.body, &whole.body, &worn.body)
        {
            *k *= blend(1.0, k1 / k0, share);
            *w *= blend(1.0, w1 / w0, share);
            *z *= blend(1.0, z1 / z0, share);
        }
        for ((mode, a), b) in self.plant.modes.iter_mut().zip(&whole.modes).zip(&worn.modes) {
            mode.zero_rad_s *= blend(1.0, b.zero_rad_s / a.zero_rad_s, share);
            mode.pole_rad_s *= blend(1.0, b.pole_rad_s / a.pole_rad_s, share);
            mode.zero_damping_ratio *= blend(1.0, b.zero_damping_ratio / a.zero_damping_ratio, share);
            mode.pole_damping_ratio *= blend(1.0, b.pole_damping_ratio / a.pole_damping_ratio, share);
        }
        match class {
            MachineClass::SensorFault => {
                self.profile.noise.encoder_rms *= blend(1.0, ENCODER_RATIO, share);
                // The sweep reads the same encoder; most of a healthy sweep's noise is not the encoder's.
                self.sweep_noise *= blend(1.0, ENCODER_RATIO, 0.3 * share);
            }
            MachineClass::Tunable => {
                let less = (-DRIFT * share * random.uniform()).exp();
                let pid = &mut self.controller.pid;
                pid.kp *= less;
                pid.ki_per_s *= less;
                pid.kd_s *= less;
            }
            MachineClass::Healthy | MachineClass::LoosePushpin => {}
        }
        Ok(())
    }
}
