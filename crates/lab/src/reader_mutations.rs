//! Every reader of files under seeded changes: does any of them panic, hang, or accept what is wrong?
//!
//! In: how many changed files, a seed. Out: a [`Tally`] a reader. Each trial runs in a thread of its own, which is left behind where it does not end. The readers and
//! what they are asked stand in `readers.rs`, the changes in `mutation.rs`.

use super::StudyError;
use super::mutation::mutate;
use super::reached::Reached;
use super::readers::{Files, Reader, readers};
use servotune::numeric::random::Random;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Counts of one reader.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// The reader.
    pub reader: &'static str,
    /// Changed files.
    pub runs: usize,
    /// Of them accepted.
    pub accepted: usize,
    /// Of them refused.
    pub refused: usize,
    /// What panicked: trial and change.
    pub panics: Vec<String>,
    /// What did not end in time.
    pub hangs: Vec<String>,
    /// What was accepted wrongly.
    pub wrong: Vec<String>,
    /// Refusals longer than a person reads, in characters.
    pub longest_refusal: usize,
    /// The slowest trial (s).
    pub slowest_s: f64,
}

impl Tally {
    /// Whether nothing was wrong.
    pub fn sound(&self) -> bool {
        self.panics.is_empty() && self.hangs.is_empty() && self.wrong.is_empty()
    }
}

/// Runs `runs` changed files through the readers, shared out by their weights; `scratch` is a folder for those that read from disk, `limit` what a trial may take.
pub fn reader_mutations(
    runs: usize,
    seed: u64,
    scratch: &Path,
    limit: Duration,
    say: &mut dyn FnMut(&str),
) -> Result<Vec<Tally>, StudyError> {
    let all = readers()?;
    let weights: f64 = all.iter().map(|r| r.weight).sum();
    let mut tallies = Vec::with_capacity(all.len());
    for (number, reader) in all.into_iter().enumerate() {
        let share = ((runs as f64 * reader.weight / weights).ceil() as usize).max(1);
        let folder = scratch.join(reader.name.replace([' ', ',', '.'], "_"));
        let t = one(&reader, share, seed ^ (number as u64 + 1) << 32, &folder, limit)?;
        say(&format!(
            "{}: {} runs, {} accepted, {} panics, {} hangs, {} wrong, slowest {:.2} s",
            t.reader,
            t.runs,
            t.accepted,
            t.panics.len(),
            t.hangs.len(),
            t.wrong.len(),
            t.slowest_s
        ));
        tallies.push(t);
    }
    Ok(tallies)
}

fn one(reader: &Reader, runs: usize, seed: u64, folder: &Path, limit: Duration) -> Result<Tally, StudyError> {
    let mut t = Tally { reader: reader.name, ..Tally::default() };
    for trial in 0..runs {
        let mut random = Random::stream(seed, trial as u64);
        let sample = &reader.corpus[(random.bits() % reader.corpus.len() as u64) as usize];
        let mut files: Files = sample.clone();
        let which = (random.bits() % files.len() as u64) as usize;
        let changed = mutate(&files[which].1, reader.table, &mut random);
        let name = format!("trial {trial} of seed {seed}: {} in {}", changed.what, files[which].0);
        files[which].1 = changed.bytes;
        // A folder of its own: one that hangs still has its files.
        let place = folder.join(trial.to_string());
        let (take, there) = (reader.take, place.clone());
        let (done, ended) = channel();
        let begun = Instant::now();
        let thread = std::thread::Builder::new().stack_size(8 << 20).spawn(move || {
            // Nobody listens any more where the time is over.
            let _ = done.send(take(&files, changed.dead, &there));
        });
        thread.map_err(|source| StudyError::Thread { source })?;
        t.runs += 1;
        match ended.recv_timeout(limit) {
            Ok(Reached::Accepted) => t.accepted += 1,
            Ok(Reached::Refused(words)) => {
                t.refused += 1;
                t.longest_refusal = t.longest_refusal.max(words.chars().count());
            }
            Ok(Reached::Wrong(why)) => t.wrong.push(format!("{name}: {why}")),
            Err(RecvTimeoutError::Disconnected) => t.panics.push(name),
            Err(RecvTimeoutError::Timeout) => t.hangs.push(name),
        }
        t.slowest_s = t.slowest_s.max(begun.elapsed().as_secs_f64());
        let _ = std::fs::remove_dir_all(&place);
    }
    Ok(t)
}
