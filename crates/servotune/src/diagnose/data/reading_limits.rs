//! Whether the readings end at limits: a sensor, a converter or a logger that cannot read farther.
//!
//! In: the runs as logged, no model. Out: the limits, and where the readings lie on them. A machine that stands at the end of its way slows down
//! before and sets off slowly; a reading that ends stops at full speed, stays to the last digit, and goes on at full speed.

use super::checks::quantum;
use super::run::Run;
use crate::diagnose::rules::{LIMIT_CORNERS, LIMIT_COUNTS, LIMIT_SAMPLES, LIMIT_SHARE, LIMIT_SPEED};
use crate::numeric::statistics::rms_of;

/// Readings that end at limits.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadingLimits {
    /// Lowest and highest reading (position_unit), each where it is a limit.
    pub ends: [Option<f64>; 2],
    /// Readings that lie on them.
    pub samples: usize,
    /// Readings in all.
    pub of: usize,
    /// Each stretch on a limit: place of the run, first and last sample.
    pub stretches: Vec<(usize, [usize; 2])>,
}

/// Stretches of readings that lie on one end of all readings.
struct End {
    value: f64,
    stretches: Vec<(usize, [usize; 2])>,
}

impl End {
    /// Where runs stand at a reading for some samples.
    fn of(runs: &[Run], value: f64) -> End {
        let mut stretches = Vec::new();
        for (i, run) in runs.iter().enumerate() {
            let y = &run.position;
            let mut k = 0;
            while k < y.len() {
                let still = y[k..].iter().take_while(|v| **v == value).count();
                if still >= LIMIT_SAMPLES {
                    stretches.push((i, [k, k + still - 1]));
                }
                k += still.max(1);
            }
        }
        End { value, stretches }
    }

    /// Steps by which the readings come to the end and leave it, the first whole ones before and behind.
    fn corners(&self, runs: &[Run]) -> Vec<f64> {
        let beside = |&(i, [first, last]): &(usize, [usize; 2])| {
            let y = &runs[i].position;
            let step = |a: usize, b: usize| Some((y.get(a)? - y.get(b)?).abs());
            let come = first.checked_sub(2).and_then(|k| step(k + 1, k));
            [come, step(last + 2, last + 1)]
        };
        self.stretches.iter().flat_map(beside).flatten().collect()
    }

    /// Whether it is a limit: met and left at speed, more often than not and more than once.
    fn is_limit(&self, runs: &[Run], speed: f64) -> bool {
        let corners = self.corners(runs);
        let fast = corners.iter().filter(|c| **c > speed).count();
        fast >= LIMIT_CORNERS && fast as f64 >= LIMIT_SHARE * corners.len() as f64
    }
}

/// The limits at which the readings end; none where they do not.
pub fn reading_limits(runs: &[Run]) -> Option<ReadingLimits> {
    let all = || runs.iter().flat_map(|r| &r.position).copied();
    let ends = [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
    let still = ends.map(|value| End::of(runs, value));
    // Most logs stand on neither end, and their count is not asked for.
    if still.iter().all(|e| e.stretches.is_empty()) {
        return None;
    }
    let steps = runs.iter().flat_map(|r| r.position.windows(2).map(|w| w[1] - w[0]));
    let count = quantum(&all().collect::<Vec<_>>()).map_or(0.0, |g| g.step);
    // Where it stands between two counts, noise takes it from one to the other and back.
    let speed = (LIMIT_SPEED * rms_of(steps.filter(|s| *s != 0.0))).max(LIMIT_COUNTS * count);
    let found = still.map(|e| Some(e).filter(|e| e.is_limit(runs, speed)));
    let ends = [0, 1].map(|i| found[i].as_ref().map(|e| e.value));
    let mut stretches: Vec<_> = found.into_iter().flatten().flat_map(|e| e.stretches).collect();
    stretches.sort();
    let samples = stretches.iter().map(|(_, [first, last])| last - first + 1).sum();
    (!stretches.is_empty()).then_some(ReadingLimits { ends, samples, of: all().count(), stretches })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::run::tests::run_at;
    use super::*;
    use crate::numeric::random::Random;

    fn swing(noise: f64) -> Vec<f64> {
        let mut random = Random::new(3);
        (0..3000).map(|k| 5.0 * (k as f64 * 0.02).sin() + noise * random.normal()).collect()
    }

    #[test]
    fn a_swing_that_is_cut_ends_at_its_limits() {
        for noise in [0.0, 0.01] {
            let cut = swing(noise).into_iter().map(|v: f64| v.clamp(-4.0, 4.5)).collect();
            let found = reading_limits(&[run_at(cut)]).unwrap();
            assert_eq!(found.ends, [Some(-4.0), Some(4.5)]);
            assert!(found.samples > 500 && found.of == 3000, "{found:?}");
        }
    }

    #[test]
    fn a_swing_on_counts_and_an_arm_that_rests_at_the_end_of_its_way_are_whole() {
        let counted = swing(0.01).into_iter().map(|v| (v / 0.05).round() * 0.05).collect();
        // To 4 along a half wave of the cosine, a rest there to the last digit, and back; nine printed digits.
        let leg = |k: usize| 2.0 - 2.0 * (k as f64 / 500.0 * std::f64::consts::PI).cos();
        let way = |k: usize| match k % 1500 {
            k if k < 500 => leg(k),
            k if k < 1000 => 4.0,
            k => leg(1500 - k),
        };
        let rests: Vec<f64> = (0..6000).map(|k| (way(k) * 1e9).round() / 1e9).collect();
        let rests_on_counts = rests.iter().map(|v| (v / 0.01).round() * 0.01).collect();
        let mut random = Random::new(5);
        let chatters =
            (0..6000).map(|k| ((way(k) + 0.003 * random.normal()) / 0.01).round().min(400.0) * 0.01).collect();
        for sound in [swing(0.01), counted, rests, rests_on_counts, chatters] {
            assert_eq!(reading_limits(&[run_at(sound)]), None);
        }
    }
}
