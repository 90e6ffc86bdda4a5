//! The plant stepping in time: exact at every controller sample and between them.

use super::{DiscretePlant, Intersample};
use crate::numeric::wide::wide;

/// State of one simulated plant, from rest at position 0.
///
/// Order of calls for sample k: [`PlantState::position`] (and [`PlantState::between`] for instants before k+1 need the
/// command of sample k, so call [`PlantState::command`] first), then [`PlantState::advance`].
#[derive(Debug, PartialEq)]
pub struct PlantState {
    re: Vec<f64>,
    im: Vec<f64>,
    /// Double integrator: velocity part and position.
    velocity: f64,
    rigid: f64,
    /// Ring of the commands u[k] back to u[k-D-1].
    commands: Vec<f64>,
    head: usize,
}

impl Clone for PlantState {
    fn clone(&self) -> PlantState {
        PlantState { re: self.re.clone(), im: self.im.clone(), commands: self.commands.clone(), ..*self }
    }

    /// Without a new allocation, as a copy at every sample needs.
    fn clone_from(&mut self, from: &PlantState) {
        self.re.clone_from(&from.re);
        self.im.clone_from(&from.im);
        self.commands.clone_from(&from.commands);
        (self.velocity, self.rigid, self.head) = (from.velocity, from.rigid, from.head);
    }
}

impl PlantState {
    /// The plant at rest.
    pub fn at_rest(plant: &DiscretePlant) -> PlantState {
        let n = plant.pole.len();
        PlantState {
            re: vec![0.0; n],
            im: vec![0.0; n],
            velocity: 0.0,
            rigid: 0.0,
            commands: vec![0.0; plant.whole + 2],
            head: 0,
        }
    }

    /// Back to rest, without a new allocation.
    pub fn reset(&mut self) {
        self.re.fill(0.0);
        self.im.fill(0.0);
        self.velocity = 0.0;
        self.rigid = 0.0;
        self.commands.fill(0.0);
        self.head = 0;
    }

    /// Position at the sample (position_unit).
    #[inline]
    pub fn position(&self) -> f64 {
        self.re.iter().sum::<f64>() + self.rigid
    }

    /// Takes the command of this sample, held until the next one.
    #[inline]
    pub fn command(&mut self, u: f64) {
        self.head = if self.head == 0 { self.commands.len() - 1 } else { self.head - 1 };
        self.commands[self.head] = u;
    }

    /// The commands u[k-D] and u[k-D-1] that act now.
    #[inline]
    fn acting(&self) -> (f64, f64) {
        let n = self.commands.len();
        let wrap = |i: usize| if i >= n { i - n } else { i };
        (self.commands[wrap(self.head + n - 2)], self.commands[wrap(self.head + n - 1)])
    }

    /// Position at an instant between this sample and the next, after [`PlantState::command`].
    #[inline]
    pub fn between(&self, at: &Intersample) -> f64 {
        let (now, before) = self.acting();
        let mut sum = 0.0;
        for i in 0..self.re.len() {
            sum += at.re[i] * self.re[i] + at.im[i] * self.im[i];
        }
        sum + at.now * now + at.before * before + self.rigid + self.velocity * at.offset_s
    }

    /// Position at the next sample, should `u` be the command of this one.
    #[inline]
    pub fn after(&self, plant: &DiscretePlant, u: f64) -> f64 {
        let n = self.commands.len();
        let wrap = |i: usize| if i >= n { i - n } else { i };
        let back = |i: usize| self.commands[wrap(self.head + i)];
        // The ring holds the commands before this one; `u` would stand in front of them.
        let (now, before) = (if n == 2 { u } else { back(n - 3) }, back(n - 2));
        let mut sum = 0.0;
        for i in 0..self.re.len() {
            sum += (plant.lambda_re[i] * self.re[i] - plant.lambda_im[i] * self.im[i])
                + (plant.now_re[i] * now + plant.before_re[i] * before);
        }
        if plant.rigid2 != 0.0 {
            let (d, h) = (plant.rest_s, plant.sample_time_s - plant.rest_s);
            sum += self.velocity * plant.sample_time_s
                + before * (plant.rigid2 * d * (h + 0.5 * d) + plant.rigid1 * d)
                + now * (0.5 * plant.rigid2 * h * h + plant.rigid1 * h);
        }
        sum + self.rigid
    }

    /// To the next sample.
    #[inline]
    pub fn advance(&mut self, plant: &DiscretePlant) {
        let (now, before) = self.acting();
        let n = self.re.len();
        let (re, im) = (&mut self.re[..n], &mut self.im[..n]);
        let (lr, li) = (&plant.lambda_re[..n], &plant.lambda_im[..n]);
        let (nr, ni) = (&plant.now_re[..n], &plant.now_im[..n]);
        let (br, bi) = (&plant.before_re[..n], &plant.before_im[..n]);
        for i in 0..n {
            let (a, b) = (re[i], im[i]);
            re[i] = lr[i] * a - li[i] * b + nr[i] * now + br[i] * before;
            im[i] = li[i] * a + lr[i] * b + ni[i] * now + bi[i] * before;
        }
        if plant.rigid2 != 0.0 {
            let (d, h) = (plant.rest_s, plant.sample_time_s - plant.rest_s);
            self.rigid += self.velocity * plant.sample_time_s
                + before * (plant.rigid2 * d * (h + 0.5 * d) + plant.rigid1 * d)
                + now * (0.5 * plant.rigid2 * h * h + plant.rigid1 * h);
            self.velocity += plant.rigid2 * (before * d + now * h);
        }
    }
}

/// Terms that are simulated side by side: their states stay in registers over the whole record.
const LANES: usize = 4;

impl DiscretePlant {
    /// Adds the plant's answer, from rest, to an input held over each sample; `input` and `out` have one length.
    pub fn add_response(&self, input: &[f64], out: &mut [f64]) {
        wide(|| self.add_terms(input, out));
        self.add_rigid(input, 1.0, out);
    }

    #[inline(always)]
    fn add_terms(&self, input: &[f64], out: &mut [f64]) {
        let delayed = |k: usize, back: usize| if k >= back { input[k - back] } else { 0.0 };
        let whole = self.whole;
        for from in (0..self.lambda_re.len()).step_by(LANES) {
            let pick =
                |all: &[f64]| -> [f64; LANES] { std::array::from_fn(|j| all.get(from + j).copied().unwrap_or(0.0)) };
            let (lr, li) = (pick(&self.lambda_re), pick(&self.lambda_im));
            let (nr, ni) = (pick(&self.now_re), pick(&self.now_im));
            let (br, bi) = (pick(&self.before_re), pick(&self.before_im));
            let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
            for (k, y) in out.iter_mut().enumerate().take(input.len()) {
                *y += (re[0] + re[1]) + (re[2] + re[3]);
                let (now, before) = (delayed(k, whole), delayed(k, whole + 1));
                for j in 0..LANES {
                    let (a, b) = (re[j], im[j]);
                    re[j] = lr[j] * a - li[j] * b + (nr[j] * now + br[j] * before);
                    im[j] = li[j] * a + lr[j] * b + (ni[j] * now + bi[j] * before);
                }
            }
        }
    }

    /// Adds `share` times the answer of the double integrator alone, from rest.
    pub(super) fn add_rigid(&self, input: &[f64], share: f64, out: &mut [f64]) {
        let delayed = |k: usize, back: usize| if k >= back { input[k - back] } else { 0.0 };
        if self.rigid2 != 0.0 {
            let (d, h) = (self.rest_s, self.sample_time_s - self.rest_s);
            let (mut position, mut velocity) = (0.0, 0.0);
            for (k, y) in out.iter_mut().enumerate().take(input.len()) {
                *y += share * position;
                let (now, before) = (delayed(k, self.whole), delayed(k, self.whole + 1));
                position += velocity * self.sample_time_s
                    + before * (self.rigid2 * d * (h + 0.5 * d) + self.rigid1 * d)
                    + now * (0.5 * self.rigid2 * h * h + self.rigid1 * h);
                velocity += self.rigid2 * (before * d + now * h);
            }
        }
    }
}

/// The numbers of a sampled plant and of one reading, for kernels that lay them out in their own way.
#[derive(Clone, Copy, Debug)]
pub struct PlantNumbers<'a> {
    /// Transition of every term: real and imaginary part.
    pub lambda: [&'a [f64]; 2],
    /// Input gain of u[k-D]: real and imaginary part.
    pub now: [&'a [f64]; 2],
    /// Input gain of u[k-D-1].
    pub before: [&'a [f64]; 2],
    /// Whole samples of delay, D.
    pub whole: usize,
    /// Whether a double integrator stands beside the terms.
    pub rigid: bool,
}

impl DiscretePlant {
    /// The plant's numbers.
    pub fn numbers(&self) -> PlantNumbers<'_> {
        PlantNumbers {
            lambda: [&self.lambda_re, &self.lambda_im],
            now: [&self.now_re, &self.now_im],
            before: [&self.before_re, &self.before_im],
            whole: self.whole,
            rigid: self.rigid2 != 0.0,
        }
    }
}

impl Intersample {
    /// Propagation of the real and the imaginary state parts.
    pub fn states(&self) -> [&[f64]; 2] {
        [&self.re, &self.im]
    }

    /// Gains of u[k-D] and u[k-D-1].
    pub fn inputs(&self) -> [f64; 2] {
        [self.now, self.before]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, Mode, Plant};
    use crate::numeric::random::Random;

    #[test]
    fn the_position_after_a_command_is_that_of_the_plant_moved_on() {
        let bodies = [
            Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
            Body::FreeInertia { acceleration_gain: 1e5, viscous_rate_per_s: 0.0 },
        ];
        for (body, delay_s) in bodies.into_iter().flat_map(|b| [0.0, 1e-5, 4e-5, 1.3e-4].map(|d| (b.clone(), d))) {
            let mode = Mode { pole_rad_s: 5e3, pole_damping_ratio: 0.02, zero_rad_s: 4.5e3, zero_damping_ratio: 0.03 };
            let (position_unit, command_unit) = ("track".into(), "V".into());
            let modes = vec![mode];
            let plant =
                Plant { position_unit, command_unit, body, delay_s, resonance_gain: 1.0, modes, physics: Vec::new() };
            let sampled = DiscretePlant::of(&plant, 4e-5).unwrap();
            let (mut state, mut random) = (PlantState::at_rest(&sampled), Random::new(2));
            for _ in 0..50 {
                let u = random.normal();
                let ahead = state.after(&sampled, u);
                state.command(u);
                state.advance(&sampled);
                assert!((ahead - state.position()).abs() <= 1e-12 * state.position().abs().max(1e-6));
            }
        }
    }
}
