//! A shape fitted by simulation and how it foretells what it was not fitted to: of several fits only those go on to the end that begin well.

use super::left_out::LeftOut;
use super::trial::Trial;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Starts that are fitted to the end: of a curve, and of a shape of few numbers, which has more places where no small move betters it.
const FINISHED: [usize; 2] = [1, 4];
/// Over the mean square of the best so far, what one may leave that is fitted to the end.
const NEAR: f64 = 2.0;

/// A shape that was fitted, and how it foretells what it was not fitted to.
#[derive(Clone)]
pub(in crate::diagnose) struct Foretelling<'a> {
    pub trial: Trial<'a>,
    /// Mean square of the parts left out.
    pub left_out: f64,
    pub covariance: DMatrix<f64>,
}

impl<'a> Foretelling<'a> {
    /// Standard error of one number.
    pub fn spread(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// The same fitted further from where it stands.
    pub fn further(self) -> Option<Foretelling<'a>> {
        Judged::of(self.trial)?.finished()?.foretelling()
    }
}

/// A trial with its slopes, and how it foretells at every smoothness.
pub(super) struct Judged<'a> {
    trial: Trial<'a>,
    left_out: LeftOut,
    r: Vec<f64>,
    j: DMatrix<f64>,
}

impl<'a> Judged<'a> {
    /// As it stands.
    fn of(mut trial: Trial<'a>) -> Option<Judged<'a>> {
        let (r, j) = trial.slopes();
        let sound = r.iter().chain(j.iter()).all(|v| v.is_finite());
        let rough = trial.shape.roughness();
        let left_out = sound.then(|| LeftOut::new(&trial.stretches.blocks, &r, &j, &trial.numbers(), &rough))?;
        if trial.curved() {
            trial.smoothness = left_out.best_smoothness();
        }
        Some(Judged { trial, left_out, r, j })
    }

    /// Fitted some steps, a curve at the smoothness that foretells best.
    fn begun(mut trial: Trial<'a>) -> Option<Judged<'a>> {
        if trial.curved() {
            trial = Judged::of(trial)?.trial;
        }
        trial.begin();
        Judged::of(trial)
    }

    /// Fitted to the end from where it stands.
    fn finished(mut self) -> Option<Judged<'a>> {
        self.trial.descend();
        Judged::of(self.trial)
    }

    /// Fitted to the end unless it leaves more than `most`.
    fn ended(self, most: f64) -> Option<Foretelling<'a>> {
        if self.error() <= most { self.finished()?.foretelling() } else { self.foretelling() }
    }

    /// Mean square of the parts left out.
    fn error(&self) -> f64 {
        self.left_out.error(self.trial.smoothness) / self.trial.stretches.total().max(1) as f64
    }

    fn foretelling(self) -> Option<Foretelling<'a>> {
        let left_out = self.error();
        let covariance = self.left_out.covariance(&self.r, &self.j, self.trial.smoothness);
        left_out.is_finite().then_some(Foretelling { trial: self.trial, left_out, covariance })
    }
}

/// Fits a trial, its smoothness chosen by what is left out.
pub(super) fn foretold(trial: Trial) -> Option<Foretelling> {
    let begun = Judged::begun(trial)?;
    if begun.trial.curved() { begun.finished()?.finished()?.foretelling() } else { begun.finished()?.foretelling() }
}

pub(super) fn better<'a>(a: Option<Foretelling<'a>>, b: Option<Foretelling<'a>>) -> Option<Foretelling<'a>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.left_out < a.left_out { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Fits begun, those that foretell best first; what cannot be simulated is none.
pub(super) fn begun(trials: Vec<Trial>) -> Vec<Judged> {
    let curved = trials.iter().all(Trial::curved);
    let all: Vec<Option<Judged>> = trials.into_par_iter().map(Judged::begun).collect();
    let mut begun: Vec<Judged> = all.into_iter().flatten().filter(|j| j.error().is_finite()).collect();
    begun.sort_by(|a, b| a.error().total_cmp(&b.error()));
    begun.truncate(FINISHED[usize::from(!curved)]);
    begun
}

/// Fits that were begun, to the end where they are near the best of them; the others as they stand.
pub(super) fn finished(begun: Vec<Judged>) -> Vec<Foretelling> {
    let most = NEAR * begun.iter().map(Judged::error).fold(f64::INFINITY, f64::min);
    let all: Vec<Option<Foretelling>> = begun.into_par_iter().map(|j| j.ended(most)).collect();
    all.into_iter().flatten().collect()
}

/// The best of some fits: all are begun, and those that foretell best then are fitted to the end.
pub(super) fn best_of(trials: Vec<Trial>) -> Option<Foretelling> {
    finished(begun(trials)).into_iter().map(Some).fold(None, better)
}
