//! The ground under the sensor's own noise, its count included.

use super::bench::{ALIKE, Bench, noise_series, values};
use super::whiten::{NoiseLevels, Periodogram, Whitener};

/// Share of the noise's power from which an encoder's count is worth a word.
const GRID: f64 = 0.01;

impl Bench {
    /// Whether the encoder's count makes a part of the noise that is worth a word.
    pub fn coarse(&self) -> bool {
        // Rounding to a grid makes noise of step/√12.
        self.grid.is_some_and(|g| g.step.powi(2) / 12.0 > GRID * self.levels.sensor_rms.powi(2))
    }

    /// Whether no record was repeated: nothing but a model tells noise from motion.
    pub fn lone(&self) -> bool {
        self.stack.segments.iter().all(|s| s.runs.len() < 2)
    }

    /// The same ground under the sensor's own noise alone: white, at the level that repeats show in the upper half of the band, where no
    /// command moves the arm. What repeats differ by beyond it then counts as motion.
    pub fn quiet(mut self) -> Bench {
        let t = self.scene.sample_time_s;
        let positions: Vec<(usize, Vec<f64>)> =
            self.fit_runs.iter().map(|&r| (r, self.runs[r].position.clone())).collect();
        let p = Periodogram::of(&values(&noise_series(&positions, &self.runs)), t);
        let upper = (0..p.power.len()).filter(|&j| p.w_rad_s[j] > 0.5 * std::f64::consts::PI / t);
        let (sum, count) = upper.fold((0.0, 0.0), |(s, n), j| (s + p.count[j] * p.power[j], n + p.count[j]));
        let rounding = self.grid.map_or(0.0, |g| g.step / 12f64.sqrt());
        let sensor_rms = (sum / f64::max(count, 1.0)).sqrt().max(rounding);
        self.levels = NoiseLevels { sensor_rms, torque_rms: 0.0, ..self.levels };
        self.scene.noise = sensor_rms;
        let whitener = Whitener::new(&self.levels, &self.form.given.body, t);
        for (_, x) in &mut self.repeats {
            self.whitener.colour(x);
            whitener.apply(x);
        }
        self.whitener = whitener;
        let alike = rounding > ALIKE * sensor_rms;
        for s in &mut self.stack.segments {
            s.weight = if alike { 1.0 } else { (s.runs.len() as f64).sqrt() };
        }
        self
    }
}
