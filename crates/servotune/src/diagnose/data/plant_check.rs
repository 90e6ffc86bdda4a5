//! Logs against the given plant where no controller tells what they are worth: does the position follow the plant's answer to the
//! recorded command, in its units, its sign and its time?

use super::checks::SampleFault;
use super::linear_form::{Sampled, free_motions};
use super::run::Run;
use super::slip::slips_of_answer;
use super::stacked_records::NuisanceBasis;
use super::time_shift::shifted;
use crate::diagnose::rules::{EARLY_LEFT, OTHER_UNIT_EXPLAINED, OTHER_UNIT_GAIN};
use crate::lti::{LtiError, Plant};
use crate::numeric::least_squares::dot;
use rayon::prelude::*;

/// Most samples by which a position is taken to be early.
const EARLIEST: usize = 20;

/// The given plant's answer to the command of every record.
pub(in crate::diagnose) struct Answers<'a> {
    records: Vec<Answer<'a>>,
}

struct Answer<'a> {
    run: &'a Run,
    /// The answer, what is each record's own start taken out.
    answer: Vec<f64>,
    start: NuisanceBasis,
}

/// How the positions follow the answers.
struct Follows {
    /// Times what.
    factor: f64,
    /// Energy of the positions that it leaves, and all of it.
    left: f64,
    whole: f64,
}

impl<'a> Answers<'a> {
    pub(in crate::diagnose) fn of(given: &Plant, runs: &'a [Run], sample_time_s: f64) -> Result<Answers<'a>, LtiError> {
        let sampled = Sampled::of(given, sample_time_s)?;
        let record = |run: &'a Run| {
            let mut start = NuisanceBasis::default();
            free_motions(&given.body, sample_time_s, run.len()).into_iter().for_each(|c| start.add_local(0, c));
            let input: Vec<f64> = run.input.iter().map(|u| u - run.before).collect();
            let mut answer = vec![0.0; run.len()];
            sampled.delayed.add_response(&input, &mut answer);
            start.project(&mut answer);
            Answer { run, answer, start }
        };
        Ok(Answers { records: runs.iter().map(record).collect() })
    }

    /// With every position moved back by so many samples.
    fn follow(&self, early: usize) -> Follows {
        let (mut ss, mut sy, mut yy) = (0.0, 0.0, 0.0);
        for r in &self.records {
            let mut y = shifted(&r.run.position, -(early as f64));
            r.start.project(&mut y);
            (ss, sy, yy) = (ss + dot(&r.answer, &r.answer), sy + dot(&r.answer, &y), yy + dot(&y, &y));
        }
        // An answer that comes behind the record's end explains nothing.
        let factor = if ss > 0.0 { sy / ss } else { 0.0 };
        Follows { factor, left: (yy - factor * sy).max(0.0), whole: yy }
    }

    /// The factor by which the positions follow, where they do and no machine of this model can have it.
    pub(in crate::diagnose) fn other_unit(&self) -> Option<f64> {
        let f = self.follow(0);
        let possible = f.factor > OTHER_UNIT_GAIN.recip() && f.factor < OTHER_UNIT_GAIN;
        (f.left < (1.0 - OTHER_UNIT_EXPLAINED) * f.whole && !possible).then_some(f.factor)
    }

    /// By how many samples the positions come before the commands that made them can have acted, the model's own delay being so many: no
    /// machine does that, a log that slipped does. None where moving them back does not help far.
    pub(in crate::diagnose) fn early(&self, own_delay: f64) -> Option<f64> {
        let unmoved = self.follow(0).left;
        let mut best = (unmoved, 0);
        for by in 1..=EARLIEST {
            let left = self.follow(by).left;
            if left > best.0 {
                break;
            }
            best = (left, by);
        }
        let by = best.1 as f64;
        // Up to the model's own delay it may be a machine that is faster than its model.
        (best.0 < EARLY_LEFT * unmoved && by > own_delay + 0.5).then_some(by)
    }

    /// Places where a position slipped against the answer to its command. A sound log may differ by its start, its gain, its delay and the
    /// pace of its clock.
    pub(in crate::diagnose) fn slips(&self, given: &Plant, sample_time_s: f64) -> Vec<SampleFault> {
        let of = |r: &Answer| {
            let n = r.run.len();
            let slope = |x: &[f64]| -> Vec<f64> {
                (0..n).map(|k| 0.5 * (x[(k + 1).min(n - 1)] - x[k.saturating_sub(1)])).collect()
            };
            let late = slope(&r.answer);
            let clock: Vec<f64> = late.iter().enumerate().map(|(k, v)| k as f64 * v).collect();
            let mut nuisances = free_motions(&given.body, sample_time_s, n).to_vec();
            nuisances.extend([r.answer.clone(), slope(&late), late]);
            slips_of_answer(r.run, &nuisances, &clock, sample_time_s)
        };
        self.records.par_iter().flat_map_iter(of).collect()
    }
}
