//! A controller on its way out, with the test vector that the code must give.
//!
//! In: a controller. Out: errors, references and commands, as text too. Spec: `specs/files.md`.

use servotune::controller::{ControlLaw, Controller};
use servotune::numeric::random::Random;

/// What is written out.
pub(super) struct Exported<'a> {
    pub name: &'a str,
    pub controller: &'a Controller,
    /// Where it came from, a line.
    pub source: String,
    pub test: TestVector,
}

/// Errors and references at each sample, and the command that the law gives.
pub(super) struct TestVector {
    pub reference: Vec<f64>,
    pub error: Vec<f64>,
    pub command: Vec<f64>,
}

/// Samples of a test vector, and the seed of its draws.
pub(super) const SAMPLES: usize = 64;

pub(super) const SEED: u64 = 7;

impl TestVector {
    /// A jump, then noise: every coefficient takes part. Where the command is limited the size is one that reaches the limit.
    pub fn of(law: &ControlLaw<'_>) -> TestVector {
        let mut random = Random::new(SEED);
        let mut error: Vec<f64> = (0..SAMPLES).map(|k| if k < 8 { 1.0 } else { random.between(-1.0, 1.0) }).collect();
        let mut free = law.clone();
        free.limit = f64::INFINITY;
        let still = vec![0.0; SAMPLES];
        let peak = free.replay_from(law.rest(), &still, &error).iter().fold(0.0f64, |m, u| m.max(u.abs()));
        if law.limit.is_finite() && peak > 0.0 {
            let size = 1.5 * law.limit / peak;
            error.iter_mut().for_each(|e| *e *= size);
        }
        // The feed-forward sees a reference that bends.
        let reference: Vec<f64> = (0..SAMPLES).map(|k| 1e-3 * (0.2 * k as f64).sin()).collect();
        let command = law.replay_from(law.rest(), &reference, &error);
        TestVector { reference, error, command }
    }
}

/// A list of numbers, six in a line, each with the digits that give it back to the last bit.
pub(super) fn numbers(values: impl IntoIterator<Item = String>, indent: &str) -> String {
    let all: Vec<String> = values.into_iter().collect();
    all.chunks(6).map(|row| format!("{indent}{}", row.join(", "))).collect::<Vec<_>>().join(",\n")
}
