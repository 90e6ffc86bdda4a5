//! The discrete law at work on recorded signals: what it adds ahead, and the state it was in when a record begins.
//!
//! In: recorded reference, position and command. Out: the command that the documented law gives. A record may begin in the
//! middle of operation, with an integrator that holds a spring or a cable: its memory then follows from the first samples,
//! because the law is exact and its inputs are recorded.

use super::{Controller, ControllerError};
use crate::lti::{Section, step_chain};
use crate::numeric::dense::least_squares;
use nalgebra::{DMatrix, DVector};

/// Samples from which the memory is found.
const HEAD: usize = 400;
/// Singular values below this share are directions that the command does not show.
const SEEN: f64 = 1e-9;

/// A controller made ready for recorded signals.
#[derive(Clone, Debug)]
pub struct ControlLaw<'a> {
    controller: &'a Controller,
    /// Its sections.
    pub chain: Vec<Section>,
    /// Largest command (command_unit), infinite where there is none.
    pub limit: f64,
}

impl<'a> ControlLaw<'a> {
    /// Checks the controller and makes its sections.
    pub fn new(controller: &'a Controller) -> Result<ControlLaw<'a>, ControllerError> {
        let chain = controller.sections()?.chain;
        Ok(ControlLaw { controller, chain, limit: controller.output_limit.unwrap_or(f64::INFINITY) })
    }

    /// Memory at rest.
    pub fn rest(&self) -> Vec<[f64; 2]> {
        vec![[0.0; 2]; self.chain.len()]
    }

    /// What the feed-forward adds at sample `k` of a reference that stands still beyond its ends (command_unit).
    pub fn ahead(&self, reference: &[f64], k: usize) -> f64 {
        let Some(f) = &self.controller.feedforward else { return 0.0 };
        let t = self.controller.sample_time_s;
        let (last, k) = (reference.len() - 1, k + f.ahead_samples as usize);
        let [back, now, next] = [k.saturating_sub(1), k, k + 1].map(|k| reference[k.min(last)]);
        f.factor * (f.velocity_s * (next - back) / (2.0 * t) + f.acceleration_s2 * (next - 2.0 * now + back) / (t * t))
    }

    /// The memory at the first sample under which the law gives `command` from `error`, by least squares over the first
    /// samples that are off the limit; rest where there are none.
    pub fn memory(&self, reference: &[f64], error: &[f64], command: &[f64]) -> Vec<[f64; 2]> {
        let n = error.len().min(HEAD);
        let mut memory = self.rest();
        let free: Vec<usize> = (0..n).filter(|&k| command[k].abs() < 0.999 * self.limit).collect();
        if free.len() < 4 * self.chain.len() {
            return memory;
        }
        let mut trial = self.rest();
        let given: Vec<f64> = error[..n].iter().map(|e| step_chain(&self.chain, &mut trial, *e)).collect();
        let right =
            DVector::from_iterator(free.len(), free.iter().map(|&k| command[k] - self.ahead(reference, k) - given[k]));
        let mut columns = DMatrix::zeros(free.len(), 2 * self.chain.len());
        for i in 0..2 * self.chain.len() {
            let mut trial = self.rest();
            trial[i / 2][i % 2] = 1.0;
            let answer: Vec<f64> = (0..n).map(|_| step_chain(&self.chain, &mut trial, 0.0)).collect();
            free.iter().enumerate().for_each(|(row, &k)| columns[(row, i)] = answer[k]);
        }
        // A chain that runs away within the first samples tells nothing of where it began.
        if !columns.iter().chain(right.iter()).all(|x| x.is_finite()) {
            return memory;
        }
        if let Some(found) = least_squares(&columns, &right, SEEN) {
            memory.iter_mut().flatten().zip(found.iter()).for_each(|(m, v)| *m = *v);
        }
        memory
    }

    /// The command that the law gives, limit included, from a recorded error (reference less position); its memory as the first
    /// recorded commands ask for.
    pub fn replay(&self, reference: &[f64], error: &[f64], command: &[f64]) -> Vec<f64> {
        self.replay_from(self.memory(reference, error, command), reference, error)
    }

    /// The same from a given memory.
    pub fn replay_from(&self, mut memory: Vec<[f64; 2]>, reference: &[f64], error: &[f64]) -> Vec<f64> {
        (0..error.len())
            .map(|k| {
                let u = step_chain(&self.chain, &mut memory, error[k]) + self.ahead(reference, k);
                u.clamp(-self.limit, self.limit)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::controller::{Lowpass, Notch, Pid};

    #[test]
    fn a_record_that_begins_in_operation_is_replayed_from_its_own_start() {
        let controller = Controller {
            sample_time_s: 4e-5,
            output_limit: Some(0.9),
            pid: Pid { kp: 0.3, ki_per_s: 60.0, kd_s: 3e-4, derivative_filter_s: 2e-5 },
            lowpass: vec![Lowpass { frequency_hz: 7000.0, damping_ratio: 0.7 }],
            notch: vec![Notch { frequency_hz: 1222.0, zero_damping_ratio: 0.05, pole_damping_ratio: 0.25 }],
            biquad: vec![],
            feedforward: None,
        };
        let law = ControlLaw::new(&controller).unwrap();
        let error: Vec<f64> =
            (0..3000).map(|k| 0.4 * (k as f64 * 0.01).sin() + 0.2 * (k as f64 * 0.37).cos()).collect();
        let reference = vec![0.0; 3000];
        let mut memory = law.rest();
        let whole: Vec<f64> =
            error.iter().map(|e| step_chain(&law.chain, &mut memory, *e).clamp(-law.limit, law.limit)).collect();
        let late = 1000;
        let replayed = law.replay(&reference[late..], &error[late..], &whole[late..]);
        let worst = replayed.iter().zip(&whole[late..]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Rounding, amplified by the condition of ten unknowns over 400 samples.
        assert!(worst < 1e-8, "{worst}");
    }
}
