//! A torque at a fixed frequency that is there whatever the arm does: mains, a fan, a switching supply.
//!
//! tau = a cos(2 pi f t) + b sin(2 pi f t); the mean over an interval is the value at its middle times sin(y)/y, y = pi f T.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;
use std::f64::consts::{PI, TAU};

/// The hum. Its strengths are cosine and sine, per record.
#[derive(Clone, Debug, PartialEq)]
pub struct LineDisturbance {
    /// Frequency (Hz), above 0.
    pub frequency_hz: f64,
}

const FREQUENCY_HZ: Key = Key::new(
    "frequency_hz",
    Unit::Hertz,
    "f; multiples of 50 and 60 Hz first, then steps of 0.8 / record, 3000 points",
)
.positive()
.scan(
    ScanEnd::Least(&[(50.0, Measure::One), (3.0, Measure::Line)]),
    ScanEnd::Least(&[(1000.0, Measure::One), (0.45, Measure::SampleRate)]),
);
const AMPLITUDE_COMMAND: Key = Key::new("amplitude_command", Unit::Command, "a");
const PHASE_DEG: Key = Key::new("phase_deg", Unit::Degree, "phase").or(0.0);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "line_disturbance",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 2,
    fixed: false,
    per_record: true,
    equation: "tau = a cos(2 pi f t + phi), phi new in every record",
    keys: &[FREQUENCY_HZ, AMPLITUDE_COMMAND, PHASE_DEG],
    source: "H. W. Ott, Electromagnetic Compatibility Engineering, 2009",
    says: "something outside hums on the arm at a fixed frequency, such as mains or a fan",
    confused_with: &["repeatable_runout", "unmodelled_resonance", "broadband_disturbance"],
    experiment: "ten seconds of rest with the loop closed, once with the spindle at another speed",
    band_hz: [10.0, 1000.0],
};

/// Relative spread of a hum's strength from record to record that is nothing unusual.
const UNEVEN: f64 = 0.15;
/// Most points of the scan; a record longer than some 1.5 s is scanned up to a lower frequency.
const POINTS: usize = 3000;

struct Line {
    w: f64,
    /// sin(y)/y of half the interval's angle.
    mean: f64,
    /// Sample time (s), and sine and cosine of the angle over it.
    step: [f64; 3],
    /// Middle of the interval before, its sine and cosine, and intervals since they were worked out: from one to the next they turn.
    before: ([f64; 3], usize),
}

/// Samples over which the wave is turned on, its rounding errors with it; and share of a sample by which clocks may differ.
const TURNED: usize = 32;
const CLOCK: f64 = 1e-9;

impl Line {
    /// Middle of the interval, sine and cosine there, and intervals since they were worked out.
    fn wave(&self, from: &Sample, to: &Sample) -> ([f64; 3], usize) {
        let t = 0.5 * (from.t + to.t);
        let ([before, s, c], count) = self.before;
        let [step, turn_s, turn_c] = self.step;
        if count < TURNED && (t - before - step).abs() < CLOCK * step {
            return ([t, s * turn_c + c * turn_s, c * turn_c - s * turn_s], count + 1);
        }
        let (sin, cos) = (self.w * t).sin_cos();
        ([t, sin, cos], 0)
    }
}

impl Law for Line {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let ([_, sin, cos], _) = self.wave(from, to);
        (out[0], out[1]) = (self.mean * cos, self.mean * sin);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.before = self.wave(from, to);
    }
}

impl Parametric for LineDisturbance {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn grid(scene: &MotionScene) -> Vec<LineDisturbance> {
        let high = 1000f64.min(0.45 / scene.sample_time_s);
        // Mains of 50 and 60 Hz with harmonics, and rectified, first; then everything that the longest record resolves.
        let mut all: Vec<f64> = Vec::new();
        for base in [50.0, 60.0] {
            all.extend((1..=6).map(|h| base * f64::from(h)).filter(|&f| f < high));
        }
        if scene.duration_s > 0.0 {
            let step = 0.8 / scene.duration_s;
            // A line shows at least three times in a record; what is slower is a drift.
            let first = 3.0 / scene.duration_s;
            all.extend((0..POINTS).map(|i| first + step * i as f64).take_while(|&f| f < high));
        }
        all.into_iter().map(|frequency_hz| LineDisturbance { frequency_hz }).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.frequency_hz)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let y = PI * self.frequency_hz * scene.sample_time_s;
        let (sin, cos) = (2.0 * y).sin_cos();
        Box::new(Line {
            w: TAU * self.frequency_hz,
            mean: if y == 0.0 { 1.0 } else { y.sin() / y },
            step: [scene.sample_time_s, sin, cos],
            before: ([f64::NAN; 3], 0),
        })
    }

    fn may_occur_several_times() -> bool {
        true
    }

    fn is_tone() -> bool {
        true
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let [a, b] = [strengths[0], strengths[1]];
        vec![
            FREQUENCY_HZ.at(self.frequency_hz),
            AMPLITUDE_COMMAND.at(a.hypot(b)),
            PHASE_DEG.at((-b).atan2(a).to_degrees()),
        ]
    }

    /// A hum does not heed what the machine does: it is as strong in every record. What excites itself from record to record is
    /// another thing.
    fn is_possible(&self, strengths: &[f64], errors: &[f64]) -> bool {
        let amplitudes: Vec<f64> = strengths.chunks_exact(2).map(|s| s[0].hypot(s[1])).collect();
        if amplitudes.len() < 2 || errors.len() != strengths.len() {
            return true;
        }
        let mean = amplitudes.iter().sum::<f64>() / amplitudes.len() as f64;
        let excess =
            |(a, e): (&f64, &[f64])| (a - mean).powi(2) / (0.5 * (e[0] * e[0] + e[1] * e[1]) + (UNEVEN * mean).powi(2));
        let chi: f64 = amplitudes.iter().zip(errors.chunks_exact(2)).map(excess).sum();
        // Three standard deviations of chi-square.
        let free = amplitudes.len() as f64 - 1.0;
        chi < free + 3.0 * (2.0 * free).sqrt()
    }

    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        Share::Outside
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(LineDisturbance, Vec<f64>), PhysicsError> {
        let (amplitude, phase) = (given.need(&AMPLITUDE_COMMAND)?, given.or(&PHASE_DEG)?.to_radians());
        let strengths = vec![amplitude * phase.cos(), -amplitude * phase.sin()];
        Ok((LineDisturbance { frequency_hz: given.need(&FREQUENCY_HZ)? }, strengths))
    }
}
