//! How often the search finds something where nothing is: the whole first search on records made from the linear refit and its noise.
//!
//! In: the diagnosis data as it stood before the search, and the linear refit. Each draw simulates every mean record by the refitted plant, adds
//! coloured noise of the measured levels, refits the linear parameters, smooths the motion anew and scans the whole library. The
//! statistic is the smallest chance of any candidate, as the search weighs it (parametric bootstrap of a maximum; Davison &
//! Hinkley 1997, ch. 4). Spec: `specs/mismatch.md`.

use super::bootstrap_chance::Bootstrap;
use super::shortlist::strongest;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit_from;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::error;
use crate::numeric::random::Random;
use crate::physics::Effect;
use rayon::prelude::*;

/// Seed of the draws; draw `i` is stream `i`.
const SEED: u64 = 0x5ca1_ab1e;

/// Runs the search on `draws` records without physics; `limit` is the chance below which a candidate counts as seen.
pub(in crate::diagnose) fn bootstrap(
    data: &DiagnosisData,
    library: &[&'static dyn Effect],
    baseline: &Model,
    iterations: usize,
    limit: f64,
    draws: usize,
) -> Bootstrap {
    let observed_log_p = strongest(data, library, baseline);
    // Simulated by the refitted plant itself: what it answers along the recorded motion holds what is wrong with that motion.
    let refitted = &baseline.refitted.plant;
    let model = SimulatedModel::of(refitted, &[], &data.scene);
    let along = data.fit(vec![]).errors(&baseline.refitted.p);
    // A draw begins with a motion of the body alone: fitted to what a law left, modes and commands on their way would begin it anyhow.
    let simulated =
        |(run, along): (&Run, Vec<f64>)| error(&model, &Run { rested: true, ..run.clone() }, None).unwrap_or(along);
    let errors: Vec<Vec<f64>> = data.means.iter().zip(along).map(simulated).collect();
    let one = |draw: usize| {
        let mut random = Random::stream(SEED, draw as u64);
        let mut null = data.clone();
        for ((mean, error), segment) in null.means.iter_mut().zip(&errors).zip(&data.stack.segments) {
            let mut noise: Vec<f64> = (0..error.len()).map(|_| random.normal() / segment.weight).collect();
            data.whitener.colour(&mut noise);
            mean.position.iter_mut().zip(error).zip(&noise).for_each(|((y, e), n)| *y += n - e);
        }
        // From the machine that the draw is made of: the way to it from a given plant far off is no question of chance.
        let null = null.corrected(&baseline.refitted.p, &[]);
        let (null, model) = refit_from(null, &baseline.refitted.p, iterations);
        strongest(&null, library, &model)
    };
    let mut null_log_p: Vec<f64> = (0..draws).into_par_iter().map(one).collect();
    null_log_p.sort_by(f64::total_cmp);
    let count = |below: f64| null_log_p.iter().filter(|p| **p <= below).count();
    Bootstrap {
        draws,
        observed_log_p,
        p_value: (1 + count(observed_log_p)) as f64 / (1 + draws) as f64,
        alarms: count(limit.ln()),
        null_log_p,
    }
}
