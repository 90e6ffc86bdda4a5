//! What a law may look at: the motion at one sample, and the machine it happens on.

use crate::lti::Plant;

/// The motion at one controller sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time since the start of the record (s).
    pub t: f64,
    /// Time since the start of the session, its records taken one after another (s); `t` where there is one record only.
    pub session: f64,
    /// Position of the arm, without the sensor's errors (position_unit).
    pub x: f64,
    /// Velocity (position_unit/s).
    pub v: f64,
    /// Command of this sample, before the delay (command_unit).
    pub u: f64,
    /// Mean of the delayed command that acts on the arm from this sample to the next (command_unit).
    pub i: f64,
    /// Spindle angle (rad); spindle frequency times time where no index was recorded.
    pub spindle_rad: f64,
    /// Temperature above the record's first (°C); 0 where not recorded.
    pub temperature: f64,
}

/// The machine and the size of its motion: what grids and units are made from.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionScene {
    /// The linear plant.
    pub plant: Plant,
    /// Sample time (s).
    pub sample_time_s: f64,
    /// Spindle frequency (Hz), where there is a spindle.
    pub spindle_hz: Option<f64>,
    /// Largest distance from the records' middle position (position_unit).
    pub travel: f64,
    /// Middle of the positions (position_unit).
    pub centre: f64,
    /// Largest speed (position_unit/s).
    pub speed: f64,
    /// Largest command (command_unit).
    pub command: f64,
    /// Largest change of the command from sample to sample (command_unit).
    pub command_step: f64,
    /// White noise of the position sensor, rms (position_unit).
    pub noise: f64,
    /// Longest record (s).
    pub duration_s: f64,
    /// All records one after another (s).
    pub session_s: f64,
    /// Whether any record carries a spindle index.
    pub indexed: bool,
    /// Whether any record carries a temperature.
    pub warm: bool,
}

impl MotionScene {
    /// Half the sample rate (Hz).
    pub fn nyquist_hz(&self) -> f64 {
        0.5 / self.sample_time_s
    }

    /// The arm's own position over the recorded one, at rest: monic modes carry a static gain of their own, and what acts on the
    /// arm (friction, springs, the torque factor) acts in front of them.
    pub fn arm_over_record(&self) -> f64 {
        let at_rest: f64 = self.plant.modes.iter().map(|m| (m.zero_rad_s / m.pole_rad_s).powi(2)).product();
        if at_rest > 0.0 && at_rest.is_finite() { at_rest.recip() } else { 1.0 }
    }

    /// Acceleration per command of the body, resonance gain included (position_unit/s² per command_unit).
    pub fn acceleration_gain(&self) -> f64 {
        self.plant.body.acceleration_gain() * self.plant.resonance_gain
    }
}

impl Sample {
    /// The same sample with the motion scaled: from the recorded position to the arm's own.
    pub fn scaled(self, by: f64) -> Sample {
        Sample { x: self.x * by, v: self.v * by, ..self }
    }
}

/// `count` points from `low` to `high`, evenly spread in the logarithm; empty where the range is empty.
pub fn logarithmic(low: f64, high: f64, count: usize) -> Vec<f64> {
    if !(low > 0.0 && high >= low && high.is_finite()) || count == 0 {
        return Vec::new();
    }
    if count == 1 {
        return vec![(low * high).sqrt()];
    }
    (0..count).map(|i| low * (high / low).powf(i as f64 / (count - 1) as f64)).collect()
}
