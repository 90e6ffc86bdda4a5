//! Linear coupling: what further inputs (a neighbouring axis, other actuators) move the recorded position by.
//!
//! In: all runs with their further inputs, and the given linear plant. Out: a finite impulse response for each input that moves the position, and
//! runs from whose position that motion is taken out. Convention: motion\[k\] = sum over l of response\[l\] (v\[k - l\] - v\[0\]), v having stood at
//! its first value before the record began. Spec: `specs/mismatch.md`, "Further inputs".

use super::lagged_regression::{LaggedRegression, Padded, Responses};
use super::simulated_model::SimulatedModel;
use super::simulation::errors;
use crate::diagnose::data::linear_form::free_motions;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::scene;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{COUPLING_CHANCE, COUPLING_LEFT_OUT, COUPLING_SHORTER};
use crate::lti::Plant;
use crate::numeric::digits::said;
use crate::numeric::least_squares::dot;
use crate::numeric::statistics::mean;
use crate::recording::Role;

/// Shortest response that is tried (samples); longer ones are twice as long each.
const SHORTEST: usize = 16;
/// Most columns of the regression.
const WIDEST: usize = 2048;
/// Samples of the longest record, and of all fit records a column, that a response needs.
const SAMPLES_A_TAP: usize = 8;
/// Stretches that a record is cut into; every second one is left out in turn.
const STRETCHES: usize = 4;
/// Order of the autoregression that whitens what the regression leaves.
const COLOUR: usize = 12;

/// A further input that moves the position.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Coupling {
    /// Its column.
    pub input: String,
    /// What it moves the position by on the fit records: rms about the mean of each record (position_unit).
    pub rms: f64,
    /// Length of its impulse response (samples).
    pub taps: usize,
    /// The impulse response from lag 0 on (position_unit per unit of the column).
    #[serde(skip)]
    pub response: Vec<f64>,
}

/// Runs of a case without what further inputs move.
#[derive(Clone)]
pub(in crate::diagnose) struct Decoupled {
    /// The runs, what couples taken out of their position.
    pub runs: Vec<Run>,
    /// The runs as recorded; empty where nothing was taken out.
    pub recorded: Vec<Run>,
    /// What was taken out, in the order of the case.
    pub couplings: Vec<Coupling>,
    /// What is to be said.
    pub remarks: Vec<String>,
}

impl Decoupled {
    /// Nothing asked, nothing taken out.
    pub fn untouched(runs: Vec<Run>, remarks: Vec<String>) -> Decoupled {
        Decoupled { runs, recorded: Vec::new(), couplings: Vec::new(), remarks }
    }

    /// Estimates what the further inputs `names` move, and takes it out of every run where it clearly explains something.
    pub fn of(runs: Vec<Run>, given: &Plant, names: &[String], sample_time_s: f64) -> Decoupled {
        let mut remarks = Vec::new();
        let fit: Vec<&Run> = runs.iter().filter(|r| r.role == Role::Fit).collect();
        let moves = |j: &usize| fit.iter().any(|r| r.further[*j].iter().any(|v| *v != r.further[*j][0]));
        let (moving, still): (Vec<usize>, Vec<usize>) = (0..names.len()).partition(moves);
        let all = |which: &[usize]| listed(&which.iter().map(|&j| names[j].as_str()).collect::<Vec<_>>());
        if !still.is_empty() {
            let verb = if still.len() > 1 { "never change" } else { "never changes" };
            remarks.push(format!("{} {verb} in the fit records: nothing can be said of it", all(&still)));
        }
        if moving.is_empty() {
            return Decoupled::untouched(runs, remarks);
        }
        let Some(regression) = Regression::of(&fit, &moving, given, sample_time_s) else {
            remarks.push(format!(
                "the records are too short, or the given plant too far off, to tell what {} moves",
                all(&moving)
            ));
            return Decoupled::untouched(runs, remarks);
        };
        let (taps, kept) = regression.chosen();
        let (taken, idle): (Vec<usize>, Vec<usize>) =
            (0..moving.len()).partition(|i| kept.as_ref().is_some_and(|k| k.series.contains(i)));
        if !idle.is_empty() {
            let verb = if idle.len() > 1 { "do not move" } else { "does not move" };
            let idle: Vec<usize> = idle.iter().map(|&i| moving[i]).collect();
            remarks.push(format!("{} {verb} the position beyond the noise", all(&idle)));
        }
        let Some(kept) = kept.filter(|_| !taken.is_empty()) else { return Decoupled::untouched(runs, remarks) };
        let mut couplings: Vec<Coupling> = Vec::with_capacity(taken.len());
        for (place, &i) in taken.iter().enumerate() {
            let response = kept.responses.values.as_slice()[place * taps..(place + 1) * taps].to_vec();
            let motions = fit.iter().map(|r| answer(&response, &r.further[moving[i]]));
            couplings.push(Coupling { input: names[moving[i]].clone(), rms: spread(motions), taps, response });
        }
        remarks.push(says(&couplings, &given.position_unit));
        if kept.responses.dependent {
            remarks.push("the lagged inputs depend on each other, and a light ridge holds their responses: single taps say little where nothing excites them".into());
        }
        let which: Vec<usize> = taken.iter().map(|&i| moving[i]).collect();
        let clean = runs.iter().map(|r| cleared(r, &which, &couplings)).collect();
        Decoupled { runs: clean, recorded: runs, couplings, remarks }
    }

    /// The recorded runs with the input as it is held, and marked as shocked, in these.
    pub fn recorded_as(&self, whole: &[Run]) -> Decoupled {
        let as_whole = |(r, w): (&Run, &Run)| Run { input: w.input.clone(), shocked: w.shocked, ..r.clone() };
        let recorded = self.recorded.iter().zip(whole).map(as_whole).collect();
        Decoupled { recorded, ..self.clone() }
    }
}

/// A run without the motion of some of its further inputs.
fn cleared(run: &Run, which: &[usize], couplings: &[Coupling]) -> Run {
    let mut coupled = vec![0.0; run.len()];
    for (&j, c) in which.iter().zip(couplings) {
        coupled.iter_mut().zip(answer(&c.response, &run.further[j])).for_each(|(m, v)| *m += v);
    }
    run.without(&coupled)
}

/// The motion by an impulse response, the input having stood at its first value.
fn answer(response: &[f64], input: &[f64]) -> Vec<f64> {
    let stood = input.first().copied().unwrap_or(0.0);
    let taps = response.len();
    let backwards: Vec<f64> = response.iter().rev().copied().collect();
    let departure: Vec<f64> = std::iter::repeat_n(0.0, taps - 1).chain(input.iter().map(|v| v - stood)).collect();
    departure.windows(taps).map(|w| dot(w, &backwards)).collect()
}

/// Root mean square of several series, each about its mean.
fn spread(series: impl Iterator<Item = Vec<f64>>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for x in series {
        let middle = mean(&x);
        sum += x.iter().map(|v| (v - middle).powi(2)).sum::<f64>();
        count += x.len() as f64;
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Names as a person lists them.
fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

fn says(couplings: &[Coupling], unit: &str) -> String {
    let names: Vec<&str> = couplings.iter().map(|c| c.input.as_str()).collect();
    let each: Vec<String> = couplings.iter().map(|c| format!("{} {} {unit} rms", c.input, said(c.rms, 3))).collect();
    let verb = if names.len() > 1 { "move" } else { "moves" };
    let taps = couplings.first().map_or(0, |c| c.taps);
    format!(
        "{} {verb} the position as well: {}, by impulse responses of {taps} samples; the coupling is taken out of the records before the search, and counts to the linear refit",
        listed(&names),
        each.join(", ")
    )
}

/// Responses of some of the inputs.
struct Kept {
    series: Vec<usize>,
    responses: Responses,
}

/// A fit record as the regression takes it.
struct Ready {
    /// Further inputs less their first values, and the own input one sample late less what stood before.
    series: Vec<Vec<f64>>,
    /// What the given plant leaves.
    error: Vec<f64>,
}

impl Ready {
    /// Every fit record that the given plant can simulate.
    fn all(fit: &[&Run], which: &[usize], given: &Plant, sample_time_s: f64) -> Vec<Ready> {
        let runs: Vec<Run> = fit.iter().map(|r| (*r).clone()).collect();
        let scene = scene(given, &runs, sample_time_s, None);
        let model = SimulatedModel::of(given, &[], &scene);
        let ready = |(run, error): (&&Run, Vec<f64>)| {
            let departure = |j: &usize| run.further[*j].iter().map(|v| v - run.further[*j][0]).collect();
            let mut series: Vec<Vec<f64>> = which.iter().map(departure).collect();
            // A held command moves nothing before the next sample; one that a controller made of this sample's noise would seem to.
            let own = run.input[..run.len() - 1].iter().map(|u| u - run.before);
            series.push(std::iter::once(0.0).chain(own).collect());
            error.iter().all(|v| v.is_finite()).then_some(Ready { series, error })
        };
        fit.iter().zip(errors(&model, fit, None)).filter_map(ready).collect()
    }

    /// First row that is used: what came before the record is not known.
    fn first(&self, taps: usize) -> usize {
        taps.min(self.error.len() / SAMPLES_A_TAP) + COLOUR
    }

    /// What responses leave of the error.
    fn left(&self, responses: &Responses, taps: usize) -> Vec<f64> {
        let mut left = self.error.clone();
        for (x, h) in self.series.iter().zip(responses.values.as_slice().chunks_exact(taps)) {
            left.iter_mut().zip(answer(h, x)).for_each(|(e, v)| *e -= v);
        }
        left
    }
}

/// A series less what an autoregression foretells of it.
fn whitened(x: &[f64], colour: &[f64]) -> Vec<f64> {
    let foretold = |k: usize| colour.iter().zip(x[..k].iter().rev()).map(|(a, v)| a * v).sum::<f64>();
    (0..x.len()).map(|k| x[k] - foretold(k)).collect()
}

/// The autoregression of what is left, by least squares; empty where it tells none.
fn colour(left: &[(usize, Vec<f64>)]) -> Vec<f64> {
    let mut all = LaggedRegression::new(1, COLOUR);
    for (first, x) in left {
        let late = std::iter::once(0.0).chain(x[..x.len() - 1].iter().copied()).collect();
        all.gather(&Padded::of(std::iter::once(late), COLOUR), x, *first..x.len(), &[vec![1.0; x.len() - first]]);
    }
    all.part(&[0], COLOUR).solved().map_or_else(Vec::new, |r| r.values.as_slice().to_vec())
}

/// The regression of the given plant's error on the further inputs and, behind them, the own input one sample late.
struct Regression {
    inputs: usize,
    /// Lengths that are tried, ascending.
    ladder: Vec<usize>,
    /// Every second stretch, and the others.
    halves: [LaggedRegression; 2],
    together: LaggedRegression,
}

impl Regression {
    /// Gathers it, whitened by the colour of what it leaves itself; none where no length is short enough, or no record can be simulated.
    fn of(fit: &[&Run], which: &[usize], given: &Plant, sample_time_s: f64) -> Option<Regression> {
        let ready = Ready::all(fit, which, given, sample_time_s);
        let total: usize = ready.iter().map(|r| r.error.len()).sum();
        let longest = ready.iter().map(|r| r.error.len()).max()?;
        let columns = WIDEST.min(total / SAMPLES_A_TAP);
        let most = (longest / SAMPLES_A_TAP).min(columns / (which.len() + 1));
        let ladder: Vec<usize> =
            std::iter::successors(Some(SHORTEST), |l| Some(2 * l)).take_while(|l| *l <= most).collect();
        let free = |n: usize| free_motions(&given.body, sample_time_s, n).to_vec();
        let plain = Regression::gathered(&ready, ladder.clone(), &[], &free)?;
        let every: Vec<usize> = (0..which.len()).collect();
        let taps = plain.length(&every)?;
        let responses = plain.together.part(&plain.with_own(&every), taps).solved()?;
        let last = *ladder.last()?;
        let left: Vec<(usize, Vec<f64>)> = ready.iter().map(|r| (r.first(last), r.left(&responses, taps))).collect();
        Regression::gathered(&ready, ladder, &colour(&left), &free)
    }

    fn gathered(
        ready: &[Ready],
        ladder: Vec<usize>,
        colour: &[f64],
        free: &dyn Fn(usize) -> Vec<Vec<f64>>,
    ) -> Option<Regression> {
        let taps = *ladder.last()?;
        let count = ready.first()?.series.len();
        let mut halves = [0, 1].map(|_| LaggedRegression::new(count, taps));
        for (i, r) in ready.iter().enumerate() {
            let error = whitened(&r.error, colour);
            let series = Padded::of(r.series.iter().map(|x| whitened(x, colour)), taps);
            let first = r.first(taps);
            let cut = |part: usize| first + (error.len() - first) * part / STRETCHES;
            for part in 0..STRETCHES {
                let rows = cut(part)..cut(part + 1);
                // Each stretch has an offset and free motions of its own, begun early enough for the filter.
                let mut own = free(rows.len() + COLOUR);
                own.insert(0, vec![1.0; rows.len() + COLOUR]);
                let own: Vec<Vec<f64>> = own.iter().map(|x| whitened(x, colour)[COLOUR..].to_vec()).collect();
                halves[(i + part) % 2].gather(&series, &error, rows, &own);
            }
        }
        let together = halves[0].with(&halves[1]);
        Some(Regression { inputs: count - 1, ladder, halves, together })
    }

    /// The shortest length that leaves no more than the best, nearly.
    fn length(&self, inputs: &[usize]) -> Option<usize> {
        let left = |&taps: &usize| self.left_out(inputs, taps).map(|[a, b]| (taps, a + b));
        let tried: Vec<(usize, f64)> = self.ladder.iter().filter_map(left).collect();
        let least = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        tried.iter().find(|t| t.1 * COUPLING_SHORTER <= least).map(|t| t.0)
    }

    /// These inputs with the own one behind them.
    fn with_own(&self, inputs: &[usize]) -> Vec<usize> {
        inputs.iter().copied().chain([self.inputs]).collect()
    }

    /// Squares of each half under responses from the other.
    fn left_out(&self, inputs: &[usize], taps: usize) -> Option<[f64; 2]> {
        let [a, b] = [0, 1].map(|h| self.halves[h].part(&self.with_own(inputs), taps));
        let left = [a.left(&b.solved()?), b.left(&a.solved()?)];
        left.iter().all(|v| v.is_finite()).then_some(left)
    }

    /// Length of the responses, and the inputs that move the position with theirs.
    fn chosen(&self) -> (usize, Option<Kept>) {
        let mut inputs: Vec<usize> = (0..self.inputs).collect();
        let Some(taps) = self.length(&inputs) else { return (SHORTEST, None) };
        while let Some(at) = self.needless(&inputs, taps) {
            inputs.remove(at);
        }
        let responses = self.together.part(&self.with_own(&inputs), taps).solved();
        (taps, responses.map(|responses| Kept { series: inputs, responses }))
    }

    /// Of the inputs that explain nothing beside the others the one that explains least.
    fn needless(&self, inputs: &[usize], taps: usize) -> Option<usize> {
        let with = self.left_out(inputs, taps);
        let equations = self.together.part(&self.with_own(inputs), taps);
        let all = equations.solved();
        let share = |at: usize| -> Option<f64> {
            let others: Vec<usize> = inputs.iter().copied().filter(|i| *i != inputs[at]).collect();
            let (with, without) = (with?, self.left_out(&others, taps)?);
            let rest = self.together.part(&self.with_own(&others), taps);
            let (left, more) = (equations.left(all.as_ref()?), rest.left(&rest.solved()?));
            let gain = (more - left) * equations.freedom() / left.max(f64::MIN_POSITIVE);
            let share = (with[0] + with[1]) / (without[0] + without[1]).max(f64::MIN_POSITIVE);
            let both = with.iter().zip(&without).all(|(w, o)| w < o);
            let clear = both && share < COUPLING_LEFT_OUT && log_tail(gain, taps) < COUPLING_CHANCE.ln();
            Some(if clear { 0.0 } else { share.max(f64::MIN_POSITIVE) })
        };
        // One that cannot be judged goes first.
        let shares: Vec<f64> = (0..inputs.len()).map(|at| share(at).unwrap_or(f64::INFINITY)).collect();
        (0..inputs.len()).filter(|&at| shares[at] > 0.0).max_by(|&a, &b| shares[a].total_cmp(&shares[b]))
    }
}
