//! A sampled plant as rows of two real states each, four to a chunk: the form that a kernel steps in vector registers.
//!
//! In: a [`DiscretePlant`]. Out: the same plant with one input only. With x[k+1] = M x[k] + N u[k-D] + B u[k-D-1] the state
//! z[k] = x[k] - N u[k-D-1] follows z[k+1] = M z[k] + (M N + B) u[k-D-1], and y[k] = Σ z + (Σ N) u[k-D-1]: half the products, and
//! nothing divided. A complex pole, a real pole and the double integrator differ only in the numbers of M.

use super::{DiscretePlant, Intersample};

/// Rows to a chunk.
pub const CHUNK: usize = 4;

/// Four rows. Row j has the states (re, im) and steps re' = a re + b im + g_re u, im' = c re + d im + g_im u. Rows of zeros fill up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LaneChunk {
    /// a, b, c, d of the transition.
    pub transition: [[f64; CHUNK]; 4],
    /// g_re and g_im, gains of u[k-D-1].
    pub input: [[f64; CHUNK]; 2],
}

/// A plant from rest: `y[k] = Σ re over all rows + direct u[k-D-1]`.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantLanes {
    /// The rows.
    pub chunks: Vec<LaneChunk>,
    /// Gain of u[k-D-1] in the position at sample k (position_unit per command_unit).
    pub direct: f64,
    /// D, whole samples of delay.
    pub whole: usize,
    /// N of every row, which a reading between samples takes into account.
    now: Vec<[[f64; CHUNK]; 2]>,
}

impl PlantLanes {
    /// Lays out a plant.
    pub fn of(plant: &DiscretePlant) -> PlantLanes {
        let mut rows: Vec<[[f64; 2]; 4]> = Vec::with_capacity(plant.pole.len() + 1);
        for i in 0..plant.pole.len() {
            let (re, im) = (plant.lambda_re[i], plant.lambda_im[i]);
            let now = [plant.now_re[i], plant.now_im[i]];
            rows.push([[re, -im], [im, re], now, [plant.before_re[i], plant.before_im[i]]]);
        }
        if plant.rigid2 != 0.0 {
            // Position and velocity.
            let (t, d) = (plant.sample_time_s, plant.rest_s);
            let h = t - d;
            let now = [0.5 * plant.rigid2 * h * h + plant.rigid1 * h, plant.rigid2 * h];
            let before = [plant.rigid2 * d * (h + 0.5 * d) + plant.rigid1 * d, plant.rigid2 * d];
            rows.push([[1.0, t], [0.0, 1.0], now, before]);
        }
        let chunks = rows.len().div_ceil(CHUNK).max(1);
        let (mut lanes, mut now) = (vec![LaneChunk::default(); chunks], vec![[[0.0; CHUNK]; 2]; chunks]);
        let mut direct = 0.0;
        for (i, [[a, b], [c, d], n, before]) in rows.into_iter().enumerate() {
            let (chunk, j) = (i / CHUNK, i % CHUNK);
            for (into, value) in lanes[chunk].transition.iter_mut().zip([a, b, c, d]) {
                into[j] = value;
            }
            lanes[chunk].input[0][j] = a * n[0] + b * n[1] + before[0];
            lanes[chunk].input[1][j] = c * n[0] + d * n[1] + before[1];
            (now[chunk][0][j], now[chunk][1][j]) = (n[0], n[1]);
            direct += n[0];
        }
        PlantLanes { chunks: lanes, direct, whole: plant.whole, now }
    }

    /// A reading between samples: the weight of every state appended to `weights`, a pair a chunk; returned are the gains of u[k-D]
    /// and u[k-D-1].
    pub fn reading(&self, at: &Intersample, weights: &mut Vec<[[f64; CHUNK]; 2]>) -> [f64; 2] {
        let terms = at.re.len();
        let of = |i: usize| match i.cmp(&terms) {
            std::cmp::Ordering::Less => [at.re[i], at.im[i]],
            // Only the double integrator has a row behind the terms; elsewhere its states are 0.
            std::cmp::Ordering::Equal => [1.0, at.offset_s],
            std::cmp::Ordering::Greater => [0.0; 2],
        };
        let mut before = at.before;
        for (chunk, now) in self.now.iter().enumerate() {
            let row: [[f64; CHUNK]; 2] = [0, 1].map(|part| std::array::from_fn(|j| of(chunk * CHUNK + j)[part]));
            before += (0..CHUNK).map(|j| row[0][j] * now[0][j] + row[1][j] * now[1][j]).sum::<f64>();
            weights.push(row);
        }
        [at.now, before]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, Mode, Plant, PlantState};
    use crate::numeric::random::Random;

    #[test]
    fn the_rows_move_as_the_plant_does() {
        let bodies = [
            Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
            // Two real poles, one of them far above the sample rate.
            Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 1e5, damping_ratio: 8.0 },
            Body::FreeInertia { acceleration_gain: 1e5, viscous_rate_per_s: 3.0 },
            Body::FreeInertia { acceleration_gain: 1e5, viscous_rate_per_s: 0.0 },
        ];
        for (body, delay_s) in bodies.into_iter().flat_map(|b| [0.0, 1e-5, 4e-5, 1.3e-4].map(|d| (b.clone(), d))) {
            let mode = |w: f64| Mode {
                pole_rad_s: w,
                pole_damping_ratio: 0.02,
                zero_rad_s: 0.9 * w,
                zero_damping_ratio: 0.03,
            };
            let (position_unit, command_unit) = ("track".into(), "V".into());
            let modes = vec![mode(5e3), mode(9e3), mode(2e4)];
            let plant =
                Plant { position_unit, command_unit, body, delay_s, resonance_gain: 1.0, modes, physics: Vec::new() };
            let sampled = DiscretePlant::of(&plant, 4e-5).unwrap();
            let lanes = PlantLanes::of(&sampled);
            let (mut state, mut random) = (PlantState::at_rest(&sampled), Random::new(2));
            let mut z = vec![[[0.0; CHUNK]; 2]; lanes.chunks.len()];
            let mut line = vec![0.0; lanes.whole + 1];
            let at = sampled.intersample(1.7e-5);
            let mut weights = Vec::new();
            let gains = lanes.reading(&at, &mut weights);
            // The terms of a step's answer are of this size before they cancel.
            let mut size = 1e-3f64;
            for _ in 0..80 {
                let before = line[lanes.whole];
                let y = z.iter().flat_map(|z| z[0]).sum::<f64>() + lanes.direct * before;
                size = z
                    .iter()
                    .flat_map(|z| z[0])
                    .fold(size.max(before.abs() * lanes.direct.abs()), |m, z| m.max(z.abs()));
                // Rounding of a sum of eight states.
                assert!((y - state.position()).abs() <= 1e-12 * size, "{y} {}", state.position());
                let u = random.normal();
                state.command(u);
                line.insert(0, u);
                let now = line[lanes.whole];
                let read: f64 = z
                    .iter()
                    .zip(&weights)
                    .map(|(z, w)| (0..CHUNK).map(|j| z[0][j] * w[0][j] + z[1][j] * w[1][j]).sum::<f64>())
                    .sum();
                let read = read + gains[0] * now + gains[1] * before;
                assert!((read - state.between(&at)).abs() <= 1e-12 * size, "{read} {}", state.between(&at));
                for (z, chunk) in z.iter_mut().zip(&lanes.chunks) {
                    let [a, b, c, d] = chunk.transition;
                    for j in 0..CHUNK {
                        let (re, im) = (z[0][j], z[1][j]);
                        z[0][j] = a[j] * re + b[j] * im + chunk.input[0][j] * before;
                        z[1][j] = c[j] * re + d[j] * im + chunk.input[1][j] * before;
                    }
                }
                line.pop();
                state.advance(&sampled);
            }
        }
    }
}
