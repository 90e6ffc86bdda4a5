//! What a write leaves, and when it is looked at.
//!
//! In: sample time and profile. Out: instants of the window, the record, the sizes that rounding is a share of. Spec: `specs/certificate.md`.

use crate::controller::Controller;
use crate::pes::Profile;

/// What a write leaves: the window of the PES and every command.
pub(super) struct Record {
    /// PES at the servo samples of the window (position_unit).
    pub window: Vec<f64>,
    /// Command of every controller sample, clipped (command_unit).
    pub command: Vec<f64>,
    pub sizes: Sizes,
}

/// Largest sizes that the recursion went through: rounding is a share of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Sizes {
    /// Of each state, between samples too.
    pub state: Vec<f64>,
    /// Of each section's memory.
    pub memory: Vec<f64>,
    /// Of |reference| + |position| + |encoder noise|, and of the plant's input.
    pub error: f64,
    pub input: f64,
    /// Whether a command was clipped.
    pub clipped: bool,
}

impl Sizes {
    pub fn watch(kept: &mut Vec<f64>, seen: impl Iterator<Item = f64>) {
        for (i, x) in seen.enumerate() {
            if i == kept.len() {
                kept.push(0.0);
            }
            kept[i] = kept[i].max(x.abs());
        }
    }
}

/// Where the servo samples of the window lie: controller sample and the time since.
pub(super) struct Clock {
    t: f64,
    rate: f64,
    /// First servo sample of the window, and the one past its end.
    pub window: [usize; 2],
    /// Controller samples of the record.
    pub ticks: usize,
}

impl Clock {
    pub fn of(c: &Controller, profile: &Profile) -> Clock {
        let start = profile.first_servo_sample();
        let window = profile.pes.window.map(|n| start + n);
        let mut clock = Clock { t: c.sample_time_s, rate: profile.pes.sample_rate_hz, window, ticks: 0 };
        clock.ticks = clock.place(profile.servo_samples() - 1).0 + 1;
        clock
    }

    /// Instant j/rate as a controller sample and the time since; one within rounding of the next sample is that sample.
    pub fn place(&self, j: usize) -> (usize, f64) {
        let at = j as f64 / self.rate;
        let k = (at / self.t).floor();
        let since = at - k * self.t;
        if since > self.t * (1.0 - 1e-9) { (k as usize + 1, 0.0) } else { (k as usize, since.max(0.0)) }
    }
}
