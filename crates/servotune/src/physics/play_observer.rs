//! A play with a contact, followed by an observer: an extended Kalman filter from reading to reading.
//!
//! Two masses that rattle in a gap forget their start within a few contacts: no simulation over a whole record repeats them, nor does the
//! machine itself. The reading corrects the observer before it has lost them. In: what the linear plant leaves of the recorded positions and the
//! acceleration of the centre of mass. Out: the deviance of the readings (minus twice the log-likelihood, less n ln 2 pi).
//! With q the share of the distance between the masses that the encoder reads, G the gap as it reads it, w the frequency in contact:
//! q'' = d a - w² over(q, G/2) - 2 z w c q' + noise, c being 1 in contact. Over the spread s of q, over and c are taken as their
//! mean: over = (x + sqrt(x² + 2 s²/pi))/2 at each side, which is s/sqrt(2 pi) at x = 0 as for a normal q.
//! Source: B. D. O. Anderson, J. B. Moore, Optimal Filtering, 1979, section 8.2; Nordin, Gutman 2002 for the contact.

use std::f64::consts::{FRAC_2_PI, TAU};

/// Phase of the contact within a step (rad), and most steps a sample.
const PHASE: f64 = 0.25;
const STEPS: f64 = 24.0;

/// What is known of one stretch of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// Recorded position less that of the linear plant (position_unit).
    pub rest: Vec<f64>,
    /// Mean acceleration of the centre of mass from each sample to the next (position_unit/s²).
    pub acceleration: Vec<f64>,
}

/// The observer and its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayObserver {
    /// Gap as the encoder reads it (position_unit); 0 is a plain resonance.
    pub gap: f64,
    /// Frequency of the two masses against one another in contact (Hz).
    pub contact_hz: f64,
    /// Damping ratio there.
    pub damping_ratio: f64,
    /// Acceleration of what is read per acceleration of the centre of mass: -1 behind the play, s/(1 - s) before it.
    pub drive: f64,
    /// Density of the noise of that acceleration (position_unit/s² per root Hz).
    pub process: f64,
    /// Noise of a reading (position_unit).
    pub sensor_rms: f64,
}

/// What following some readings comes to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Followed {
    /// Minus twice the log-likelihood, less n ln 2 pi.
    pub deviance: f64,
    /// Share of the samples in contact.
    pub touching: f64,
    /// What the play adds to each reading (position_unit), by the readings up to it.
    pub added: Vec<f64>,
}

impl PlayObserver {
    /// Deviance of readings at a sample time (s); infinite where the observer loses them.
    pub fn deviance(&self, readings: &Readings, sample_time_s: f64) -> f64 {
        self.walk(readings, sample_time_s, |_, _| {})
    }

    /// The same with what was added.
    pub fn follow(&self, readings: &Readings, sample_time_s: f64) -> Followed {
        let (mut added, mut touching) = (Vec::with_capacity(readings.rest.len()), 0.0);
        let deviance = self.walk(readings, sample_time_s, |q, c| {
            added.push(q);
            touching += c;
        });
        Followed { deviance, touching: touching / added.len().max(1) as f64, added }
    }

    fn walk(&self, readings: &Readings, sample_time_s: f64, mut seen: impl FnMut(f64, f64)) -> f64 {
        let w = TAU * self.contact_hz;
        let steps = (w * sample_time_s / PHASE).ceil().clamp(1.0, STEPS);
        let (h, half) = (sample_time_s / steps, 0.5 * self.gap);
        let (stiff, damping) = (w * w, 2.0 * self.damping_ratio * w);
        let shaken = self.process * self.process * h;
        let r = self.sensor_rms * self.sensor_rms;
        let [mut q, mut v] = [0.0; 2];
        // Anywhere in the gap, at the speed that the contact gives a tenth of it.
        let [mut p11, mut p12, mut p22] = [half * half / 3.0 + r, 0.0, stiff * (0.1 * half * half + r)];
        let mut deviance = 0.0;
        for (y, a) in readings.rest.iter().zip(&readings.acceleration) {
            let (s, off) = (p11 + r, y - q);
            deviance += s.ln() + off * off / s;
            let [k1, k2] = [p11 / s, p12 / s];
            q += k1 * off;
            v += k2 * off;
            [p11, p12, p22] = [p11 - k1 * p11, p12 - k1 * p12, p22 - k2 * p12];
            let (read, push) = (q, self.drive * a);
            let mut first = None;
            for _ in 0..steps as usize {
                let spread = FRAC_2_PI * p11 + f64::MIN_POSITIVE;
                let [up, down] = [q - half, -q - half];
                let [far_up, far_down] = [up, down].map(|x| (x * x + spread).sqrt());
                let over = 0.5 * (up + far_up - down - far_down);
                let contact = 0.5 * (2.0 + up / far_up + down / far_down);
                first.get_or_insert(contact);
                v += h * (push - stiff * over - damping * contact * v);
                q += h * v;
                let [f21, f22] = [-h * stiff * contact, 1.0 - h * damping * contact];
                let [f11, f12] = [1.0 + h * f21, h * f22];
                let [m11, m12] = [f11 * p11 + f12 * p12, f11 * p12 + f12 * p22];
                let [m21, m22] = [f21 * p11 + f22 * p12, f21 * p12 + f22 * p22];
                [p11, p12, p22] = [m11 * f11 + m12 * f12, m11 * f21 + m12 * f22, m21 * f21 + m22 * f22 + shaken];
            }
            seen(read, first.unwrap_or(0.0));
        }
        if deviance.is_finite() { deviance } else { f64::INFINITY }
    }
}
