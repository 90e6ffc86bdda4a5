//! The stretches of the records that a curve is estimated from: all mean runs where they are few, evenly spread pieces of them where
//! they are many.
//!
//! In: the diagnosis data. Out: runs, and which of them are left out together.

use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;

/// Most samples: a curve has a few dozen numbers, and every one of them costs a simulation of all samples at each step.
const MOST: usize = 40_000;
/// Shortest piece of a long record (samples), and how many pieces of it there are at most.
const SHORTEST: usize = 2000;
const PIECES: usize = 12;
/// Records from which whole records are left out; fewer are left out by stretches: one of a few may be all that went to a place.
const MANY: usize = 12;
/// Parts that are left out in turn, and stretches of a record that are: a move is over such a place in a twentieth of its record.
const FOLDS: usize = 4;
const IN_TURN: usize = 32;
/// Shortest of the short pieces (samples), and how many of them a record gives at most.
const BRIEF: usize = 100;
const BRIEF_PIECES: usize = 24;

/// What a curve is fitted to.
pub(in crate::diagnose) struct Stretches<'a> {
    /// One after the other.
    pub runs: Vec<Run>,
    /// The controller, where they are simulated in the loop that they were recorded in.
    pub closed: Option<&'a ControlLaw<'a>>,
    /// Blocks of consecutive samples of the runs in their order: samples, and the part that it is left out with.
    pub blocks: Vec<(usize, usize)>,
}

/// Samples `from` to `to` of a run, as a run that begins in full motion.
fn piece(run: &Run, from: usize, to: usize, sample_time_s: f64) -> Run {
    Run { rested: false, ..run.stretch(from, to, sample_time_s) }
}

impl<'a> Stretches<'a> {
    /// Of the mean runs of the diagnosis data.
    pub fn of(data: &DiagnosisData) -> Stretches<'a> {
        let total: usize = data.means.iter().map(Run::len).sum();
        let runs = if total <= MOST { data.means.clone() } else { spread(&data.means, total, data) };
        let whole = runs.len() >= MANY;
        let mut blocks = Vec::new();
        for (i, run) in runs.iter().enumerate() {
            let parts = if whole { 1 } else { IN_TURN.min(run.len()).max(1) };
            for k in 0..parts {
                let len = run.len() * (k + 1) / parts - run.len() * k / parts;
                blocks.push((len, if whole { i % FOLDS } else { k % FOLDS }));
            }
        }
        Stretches { runs, closed: None, blocks }
    }

    /// The same in the loop that they were recorded in, which holds motions together that a law would drive apart.
    pub fn in_loop(&self, law: &'a ControlLaw<'a>) -> Stretches<'a> {
        Stretches { runs: self.runs.clone(), closed: Some(law), blocks: self.blocks.clone() }
    }

    /// The same in short pieces, each with a start of its own: a law that drives motions apart is followed over as long as they stay
    /// together. None where records are short already.
    pub fn in_short_pieces(&self, sample_time_s: f64) -> Option<Stretches<'a>> {
        let cut = |run: &Run| -> Vec<Run> {
            let pieces = (run.len() / BRIEF).clamp(1, BRIEF_PIECES);
            let edge = |k: usize| run.len() * k / pieces;
            let each = |k: usize| match pieces {
                1 => run.clone(),
                _ => piece(run, edge(k), edge(k + 1), sample_time_s),
            };
            (0..pieces).map(each).collect()
        };
        let runs: Vec<Run> = self.runs.iter().flat_map(cut).collect();
        let blocks = runs.iter().enumerate().map(|(i, r)| (r.len(), i % FOLDS)).collect();
        (runs.len() > self.runs.len()).then_some(Stretches { runs, closed: self.closed, blocks })
    }

    /// The same for a sensor whose curve is asked for: where the arm stands is not known from what it reads, but all records share
    /// one machine, which stands at one place under one command.
    pub fn standing_alike(&self) -> Stretches<'a> {
        let samples: f64 = self.runs.iter().map(|r| r.len() as f64).sum();
        let mean = |of: &dyn Fn(&Run) -> &Vec<f64>| self.runs.iter().flat_map(of).sum::<f64>() / samples;
        let (origin, before) = (mean(&|r| &r.position), mean(&|r| &r.input));
        let runs = self.runs.iter().map(|r| Run { origin, before, ..r.clone() }).collect();
        Stretches { runs, closed: self.closed, blocks: self.blocks.clone() }
    }

    /// Samples in all.
    pub fn total(&self) -> usize {
        self.runs.iter().map(Run::len).sum()
    }
}

/// Evenly spread pieces of long records.
fn spread(means: &[Run], total: usize, data: &DiagnosisData) -> Vec<Run> {
    let share = MOST as f64 / total as f64;
    let mut all = Vec::new();
    for run in means {
        let wanted = (share * run.len() as f64) as usize;
        let pieces = (wanted / SHORTEST).clamp(1, PIECES);
        let len = (wanted / pieces).min(run.len());
        let gaps = pieces.saturating_sub(1).max(1);
        for k in 0..pieces {
            let from = (run.len() - len) * k / gaps;
            all.push(piece(run, from, from + len, data.scene.sample_time_s));
        }
    }
    all
}
