//! Two hundred random plants of order 22 with 1 % noise: how well identification recovers them, and what that does to the margin.

use super::{Study, StudyError};
use crate::study_identify::{StudyCase, judge};
use rayon::prelude::*;
use servotune::controller::Controller;
use servotune::feedback::{Crossing, ModelLoop, margins};
use servotune::frf::Frf;
use servotune::identify::{IdentifySettings, identify};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant};
use servotune::numeric::random::Random;
use servotune::numeric::statistics::nearest_rank;
use servotune::twin::nominal_controller;
use servotune::twin::plants::{log_grid, measure, random_plant};
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};
use std::f64::consts::TAU;

/// Conditions of the study.
const PLANTS: u64 = 200;
const MODES: usize = 10;
const POINTS: usize = 400;
const NOISE: f64 = 0.01;
/// Crossover to which the nominal controller is scaled on each true plant (Hz).
const CROSSOVER_HZ: f64 = 600.0;

/// One plant.
struct Case {
    figures: StudyCase,
    /// Error of the phase margin at the crossover, 600 Hz on the true plant (deg).
    at_crossover_deg: Option<f64>,
    /// Error of the smallest phase margin over all crossings, wherever it lies (deg).
    smallest_deg: Option<f64>,
}

/// Makes the study; everything it needs is built in. Plants are shared out over threads, results keep their order.
pub fn plants() -> Result<Study, StudyError> {
    let nominal = nominal_controller()?;
    let cases =
        (1..=PLANTS).into_par_iter().map(|seed| case(seed, &nominal)).collect::<Result<Vec<Case>, StudyError>>()?;
    let mut study = Study::default();
    study.page("random_plants.md", page(&cases)?);
    Ok(study)
}

fn case(seed: u64, nominal: &Controller) -> Result<Case, StudyError> {
    let mut random = Random::new(seed);
    let truth = random_plant(&mut random, MODES);
    let w = log_grid(40.0, 5000.0, POINTS);
    let frf: Frf = measure(&truth, &w, NOISE, &mut random)?;
    let id = identify(&frf, &IdentifySettings::default())?;
    let figures = judge(&truth, &id, &w, NOISE, seed);
    let [at_crossover_deg, smallest_deg] = margin_errors(&truth, &id.plant, nominal)?;
    Ok(Case { figures, at_crossover_deg, smallest_deg })
}

/// Errors of the phase margin: at the crossover, and of the smallest one; each at the estimate's nearest crossing.
fn margin_errors(truth: &Plant, found: &Plant, nominal: &Controller) -> Result<[Option<f64>; 2], StudyError> {
    let t = nominal.sample_time_s;
    let (exact, estimate) = (DiscretePlant::of(truth, t)?, DiscretePlant::of(found, t)?);
    let mut c = nominal.clone();
    let gain = (exact.at(TAU * CROSSOVER_HZ) * c.sections()?.at(TAU * CROSSOVER_HZ)).norm();
    for k in [&mut c.pid.kp, &mut c.pid.ki_per_s, &mut c.pid.kd_s] {
        *k /= gain;
    }
    let sections = c.sections()?;
    let a = margins(&ModelLoop::new(&exact, &sections)?);
    let b = margins(&ModelLoop::new(&estimate, &sections)?);
    let near = |all: &[Crossing], hz: f64| {
        let distance = |c: &Crossing| (c.hz / hz).ln().abs();
        all.iter().copied().min_by(|x, y| distance(x).total_cmp(&distance(y)))
    };
    let error = |truth: Option<Crossing>| {
        let t = truth?;
        near(&b.gain_crossings, t.hz).map(|c| (c.value - t.value).abs())
    };
    let smallest = a.gain_crossings.iter().copied().min_by(|x, y| x.value.abs().total_cmp(&y.value.abs()));
    Ok([error(near(&a.gain_crossings, CROSSOVER_HZ)), error(smallest)])
}

fn page(cases: &[Case]) -> Result<String, StudyError> {
    let digits = NumberFormat::Significant(3);
    let mut table = Table::new(
        "Random plants",
        vec![
            Column::words("figure"),
            Column::numbers("median", "", digits),
            Column::numbers("95th percentile", "", digits),
            Column::numbers("largest", "", digits),
            Column::words("unit"),
            Column::words("aim"),
        ],
    );
    let mut row = |name: &str, values: Vec<f64>, unit: &str, aim: &str| {
        let at = |q| nearest_rank(&values, q).into();
        table.push(vec![name.into(), at(0.5), at(0.95), at(1.0), unit.into(), aim.into()])
    };
    let percent = |f: &dyn Fn(&StudyCase) -> f64| cases.iter().map(|c| 100.0 * f(&c.figures)).collect::<Vec<f64>>();
    row("response error, median over the band", percent(&|c| c.median_error), "%", "")?;
    row(
        "response error, 95th percentile over the band",
        percent(&|c| c.p95_error),
        "%",
        "at most 2 at the 95th percentile",
    )?;
    let frequency: Vec<f64> = cases.iter().flat_map(|c| c.figures.frequency_errors.iter().map(|e| 100.0 * e)).collect();
    let (visible, within) = (frequency.len(), frequency.iter().filter(|e| **e <= 0.3).count());
    row("frequency error of visible modes", frequency, "%", "at most 0.3")?;
    let crossover: Vec<f64> = cases.iter().filter_map(|c| c.at_crossover_deg).collect();
    let smallest: Vec<f64> = cases.iter().filter_map(|c| c.smallest_deg).collect();
    let half = |errors: &[f64]| (errors.iter().filter(|e| **e <= 0.5).count(), errors.len());
    let (crossover_within, smallest_within) = (half(&crossover), half(&smallest));
    row("phase margin error at the crossover", crossover, "deg", "at most 0.5")?;
    row("phase margin error at the worst crossing", smallest, "deg", "")?;
    let n = cases.len();
    let stable = cases.iter().filter(|c| c.figures.stable).count();
    let two = cases.iter().filter(|c| c.figures.p95_error <= 0.02).count();
    let covered = |i: usize| cases.iter().filter(|c| c.figures.covered[i]).count();
    Ok(format!(
        "# Random plants of order 22\n\n\
         Made by `lab plants --out results`. {n} plants (body and {MODES} resonance pairs), {POINTS} points from 40 to 5000 Hz, \
         {} % relative complex noise, seeds 1 to {PLANTS}; order chosen by the program. Errors are against the noise-free response on a grid ten \
         times finer. A mode is visible when its mark on the sweep is five deviations above what noise makes; one without a counterpart within \
         3 % counts as 100 %. Margins are those of the nominal controller scaled to {CROSSOVER_HZ} Hz on the true plant; where a mode touches |L| = 1 elsewhere, the \
         worst crossing lies on its flank, where a small shift of the mode turns the phase much.\n\n\
         ```text\n{}```\n\n\
         | count | of |\n|---|---|\n\
         | stable models | {stable} of {n} |\n\
         | 95th percentile of the response error at most 2 % | {two} of {n} |\n\
         | visible modes within 0.3 % | {within} of {visible} |\n\
         | phase margins at the crossover within 0.5 deg | {} of {} |\n\
         | smallest phase margins within 0.5 deg | {} of {} |\n\
         | 95 % intervals that hold the delay | {} of {n} |\n\
         | 95 % intervals that hold the natural frequency | {} of {n} |\n\
         | 95 % intervals that hold the dc gain | {} of {n} |\n",
        100.0 * NOISE,
        table.text(),
        crossover_within.0,
        crossover_within.1,
        smallest_within.0,
        smallest_within.1,
        covered(0),
        covered(1),
        covered(2),
    ))
}
