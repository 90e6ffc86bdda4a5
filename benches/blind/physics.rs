//! What a sealed machine may do beyond its linear model. Every field at rest (zero, empty) is absent.
//! Units: track, V, s; torques are in V at the amplifier's input unless the name says otherwise.

use crate::random::Random;

/// Parallel Maxwell-slip elements with yields drawn at random (generalised Maxwell slip without rate effect).
#[derive(Clone, Debug, Default)]
pub struct Slip {
    /// Stiffness of each element, 1/s^2.
    pub k: Vec<f64>,
    /// Yield displacement of each element, track.
    pub reach: Vec<f64>,
}

impl Slip {
    /// `stiffness` in 1/s^2, mean yield (stiffness-weighted) `length` in track.
    pub fn draw(r: &mut Random, elements: usize, stiffness: f64, length: f64) -> Self {
        let shape = r.range(0.5, 1.1);
        let mut k: Vec<f64> = (0..elements).map(|_| r.range(0.3, 1.0)).collect();
        let mut reach: Vec<f64> =
            (0..elements).map(|i| ((i as f64 + r.unit()) / elements as f64 * 1.9 + 0.05).powf(shape)).collect();
        let total: f64 = k.iter().sum();
        k.iter_mut().for_each(|x| *x *= stiffness / total);
        let mean: f64 = k.iter().zip(&reach).map(|(k, x)| k * x).sum::<f64>() / stiffness;
        reach.iter_mut().for_each(|x| *x *= length / mean);
        Self { k, reach }
    }
    pub fn stiffness(&self) -> f64 {
        self.k.iter().sum()
    }
    pub fn level(&self) -> f64 {
        self.k.iter().zip(&self.reach).map(|(k, x)| k * x).sum()
    }
    pub fn length(&self) -> f64 {
        self.level() / self.stiffness()
    }
}

/// Effects outside the library that the product is tried on.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Outside {
    #[default]
    None,
    /// Relay hysteresis operators whose thresholds widen with position: congruency is violated.
    Preisach,
    /// Torque of a fluid film that follows v|x-rate memory| with its own delay.
    SqueezeFilm,
    /// Cable of fractional order (sum of many relaxation times).
    FractionalCable,
    /// Torque that jumps between two levels at random times.
    Telegraph,
    /// Cogging in position that latches near its minima.
    CoggingLatch,
    /// A second arm on the same pivot, driven by its own moves.
    TwoArm,
    /// Shocks whose torque is proportional to the speed of the arm.
    Gyroscopic,
    /// Hysteresis that widens with speed and differs by direction.
    RateHysteresis,
}

#[derive(Clone, Debug, Default)]
pub struct Physics {
    pub slip: Slip,
    pub coulomb: f64,
    pub bias_level: f64,
    pub bias_length: f64,
    pub bias_tau: f64,
    pub cable_offset: f64,
    pub cable_linear: f64,
    pub cable_quadratic: f64,
    pub cable_creep: f64,
    pub cable_tau: f64,
    pub cubic: f64,
    /// Relative loss at 15 track; the law is a magnet's edge field, not a polynomial.
    pub rolloff: f64,
    pub ripple: f64,
    pub ripple_period: f64,
    pub ripple_phase: f64,
    pub saturation: f64,
    pub slew: f64,
    pub dead_band: f64,
    pub amplifier_hz: f64,
    pub extra_delay: f64,
    pub sensor_hz: f64,
    pub gain_drift: f64,
    pub gain_tau: f64,
    pub gain_ripple: f64,
    pub gain_ripple_hz: f64,
    pub cyclic: f64,
    pub cyclic_second: f64,
    pub cyclic_period: f64,
    pub cyclic_phase: f64,
    pub scale_amplitude: f64,
    pub scale_period: f64,
    pub scale_phase: f64,
    pub quantum: f64,
    /// Extra reading noise per speed, s.
    pub speed_noise: f64,
    pub jitter: f64,
    pub clock: f64,
    /// Index of the mode that moves with position, relative shift at 15 track.
    pub shift_mode: usize,
    pub mode_shift: f64,
    pub damp_mode: usize,
    /// Growth of the damping ratio per amplitude of the mode, 1/track of its own velocity state.
    pub damp_growth: f64,
    pub play: f64,
    pub base_ratio: f64,
    pub base_hz: f64,
    pub base_damping: f64,
    pub runout: f64,
    pub runout_second: f64,
    pub runout_phase: f64,
    pub spindle_hz: f64,
    pub line: f64,
    pub line_hz: f64,
    pub windage: f64,
    pub windage_hz: f64,
    pub shock: f64,
    pub shock_at: f64,
    pub shock_length: f64,
    pub offset_rate: f64,
    pub offset_walk: f64,
    pub drag: f64,
    /// Relative error of the controller's gains, and of its notch frequency.
    pub law_gain: f64,
    pub law_notch: f64,
    pub outside: Outside,
    pub outside_level: f64,
    pub outside_scale: f64,
}
