//! A candidate with its derivatives: objective and limits as straight lines around one decision vector.
//!
//! Limits of the loop: analytic, Re(pull_by d ln C) at the row's frequency. Figures of records: one backward pass a figure, which gives slopes
//! in the coefficients of every section. Both reach the parameters through the slopes of the sections' coefficients.

use super::objective::Minimise;
use super::parameters::chain_of;
use super::requirements::What;
use super::row::{Moves, Row};
use super::score::UNSTABLE;
use super::section_slope::{SECTION_STEP, SectionSlope};
use super::{Score, TuningProblem, TuningWork};
use crate::lti::Section;
use nalgebra::Complex;

/// One limit near one candidate: value + gradient d, good where at most 0.
#[derive(Clone, Debug)]
pub(super) struct LinearRow {
    pub row: Row,
    pub gradient: Vec<f64>,
}

/// Objectives (one a machine) and limits around one candidate.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    pub score: Score,
    pub objectives: Vec<(f64, Vec<f64>)>,
    pub rows: Vec<LinearRow>,
}

/// Rows beyond this many worst ones cannot decide a step.
const ROWS: usize = 48;

/// One limit near a candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitSlope {
    /// The limit, as the search aims at it.
    pub what: What,
    /// How far it is missed, as a share of it; at most 0 where it is met.
    pub violation: f64,
    /// Change of that over each parameter.
    pub slope: Vec<f64>,
}

/// A candidate with the slopes of objective and limits in every parameter (logarithms of gains and places).
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateSlopes {
    /// The candidate's score.
    pub score: Score,
    /// Slope of ln(objective) of the first machine; 0 throughout for the objective `room`.
    pub objective: Vec<f64>,
    /// The limits that may decide, the worst first; one limit may stand at several frequencies.
    pub limits: Vec<LimitSlope>,
}

impl TuningProblem {
    /// Scores a candidate and gives the slopes there, for an optimiser of one's own; none where the loop is unstable.
    pub fn slopes(&self, x: &[f64], work: &mut TuningWork) -> Option<CandidateSlopes> {
        let Linear { score, objectives, rows } = linearise(self, x, work)?;
        let objective = objectives.into_iter().next().map(|(_, slope)| slope).unwrap_or_default();
        let limit = |r: LinearRow| {
            let what = self.aimed[r.row.machine].wanted[r.row.wanted].what;
            LimitSlope { what, violation: r.row.value, slope: r.gradient }
        };
        Some(CandidateSlopes { score, objective, limits: rows.into_iter().map(limit).collect() })
    }
}

/// Scores `x` and takes all derivatives there; none where the loop is unstable.
pub(super) fn linearise(problem: &TuningProblem, x: &[f64], work: &mut TuningWork) -> Option<Linear> {
    let score = problem.score(x, work);
    if score.violation >= UNSTABLE {
        return None;
    }
    let slopes = section_slopes(problem, x, work);
    problem.parameters.put(x, &mut work.controller);
    chain_of(&work.controller, &mut work.chain);
    let TuningWork { controller, chain, buffers, rows, objectives, .. } = work;
    rows.sort_by(|a, b| b.value.total_cmp(&a.value).then(a.w_rad_s.total_cmp(&b.w_rad_s)));
    rows.truncate(ROWS);
    let n = x.len();
    // Which figures of which machine need a backward pass: the objective's, and those near their limits.
    let mut linear_rows: Vec<LinearRow> = rows.iter().map(|r| LinearRow { row: *r, gradient: Vec::new() }).collect();
    let mut lines: Vec<(f64, Vec<f64>)> = Vec::with_capacity(objectives.len());
    for (number, (m, b)) in problem.machines.iter().zip(buffers).enumerate() {
        let counts = number == 0 || !problem.nominal_first;
        let wanted: Vec<bool> = (0..b.figures.len())
            .map(|figure| {
                let objective = figure == 0 && counts && problem.asked.objective_is_figure();
                objective
                    || rows.iter().any(|r| {
                        r.machine == number && matches!(r.moves, Moves::Record { figure: f, .. } if f == figure)
                    })
            })
            .collect();
        m.record_slopes(controller, chain, &slopes, &problem.asked, &problem.aimed[number].wanted, &wanted, b);
        let pulled = |by: Complex<f64>, w_rad_s: f64| -> Vec<f64> {
            let back = Complex::from_polar(1.0, -w_rad_s * m.sampled.sample_time_s());
            slopes.iter().map(|s| (by * s.pull(&chain[s.section], back)).re).collect()
        };
        for r in linear_rows.iter_mut().filter(|r| r.row.machine == number) {
            r.gradient = match r.row.moves {
                Moves::Record { figure, share } => b.slopes[figure].iter().map(|d| share * d).collect(),
                Moves::Loop(by) => pulled(by, r.row.w_rad_s),
                Moves::Pair { own, other_rad_s, other } => {
                    let pairs = pulled(own, r.row.w_rad_s).into_iter().zip(pulled(other, other_rad_s));
                    pairs.map(|(a, b)| a + b).collect()
                }
            };
        }
        if !counts {
            continue;
        }
        let gradient = match problem.minimise {
            Minimise::PesRms | Minimise::Dft | Minimise::Disturbance => {
                let value = b.figures[0].max(f64::MIN_POSITIVE);
                b.slopes[0].iter().map(|d| d / value).collect()
            }
            Minimise::Bandwidth => match b.on.quick.lowest_gain_crossing() {
                Some(e) if e.slope.re.abs() > 1e-6 => {
                    let back = Complex::from_polar(1.0, -e.w_rad_s * m.sampled.sample_time_s());
                    slopes.iter().map(|s| s.pull(&chain[s.section], back).re / e.slope.re).collect()
                }
                _ => vec![0.0; n],
            },
            Minimise::Integral => {
                let slope = problem.parameters.ln_integral(controller).map(|(_, s)| s);
                slope.map_or_else(|| vec![0.0; n], |s| s.iter().map(|d| -d).collect())
            }
            Minimise::Room => vec![0.0; n],
        };
        lines.push((objectives[number], gradient));
    }
    Some(Linear { score, objectives: lines, rows: linear_rows })
}

/// Slopes of every parameter's section, by central differences of the coefficients.
fn section_slopes(problem: &TuningProblem, x: &[f64], work: &mut TuningWork) -> Vec<SectionSlope> {
    let p = &problem.parameters;
    let mut moved = x.to_vec();
    (0..x.len())
        .map(|j| {
            let section = p.section_of(j);
            let mut side = |h: f64| {
                moved[j] = x[j] + h;
                p.put(&moved, &mut work.controller);
                let made = chain_of(&work.controller, &mut work.chain);
                moved[j] = x[j];
                made.then(|| work.chain.get(section).copied()).flatten()
            };
            let still = Section { b0: 1.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0 };
            // Outside the range of a filter nothing moves.
            let (minus, plus) = side(-SECTION_STEP).zip(side(SECTION_STEP)).unwrap_or((still, still));
            let rate = 0.5 / SECTION_STEP;
            let of =
                [plus.b0 - minus.b0, plus.b1 - minus.b1, plus.b2 - minus.b2, plus.a1 - minus.a1, plus.a2 - minus.a2];
            SectionSlope { section, of: of.map(|d| d * rate), around: [minus, plus] }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::controller::Controller;
    use crate::frf::Frf;
    use crate::lti::{FrequencyResponse, Plant, PlantFile};
    use crate::tune::{Machine, Spec};
    use std::f64::consts::TAU;
    use std::path::Path;

    fn file(name: &str) -> String {
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../specs").join(name)).unwrap()
    }

    fn plant() -> Plant {
        toml::from_str::<PlantFile>(&file("machines/healthy.toml")).unwrap().try_into().unwrap()
    }

    /// A spec with every kind of limit, so wide that all of them are near at the nominal controller.
    fn spec(objective: &str, write: bool) -> Spec {
        let text = format!(
            "{}\nguard = 0.0\n[objective]\nminimise = \"{objective}\"\n[disturbance]\nrms = 1e-3\ncorner_hz = 50.0\n[margins]\nphase_margin_deg = 34.0\n\
             gain_margin_db = 6.0\nmax_sensitivity = 2.3\ngain_crossover_hz = [560.0, 720.0]\nbandwidth_hz = 900.0\n[limits]\n{}\
             overshoot_percent = 40.0\nsettling_s = 4e-3\n{}[[limits.curve]]\nof = \"L\"\nside = \"at_most\"\nhz = [3000.0, 10000.0]\ndb = [-10.0, -20.0]\n\
             [[limits.curve]]\nof = \"S\"\nside = \"at_most\"\nhz = [50.0, 200.0]\ndb = [-26.0, -8.0]\n[[limits.curve]]\nof = \"PS\"\nside = \"at_most\"\n\
             hz = [20.0, 3000.0]\ndb = [20.0, 20.0]\n[search]\nnotches = 1\nlowpasses = 1\nbounds = {{ kp = [1e-2, 3.0], ki_per_s = [1.0, 1e3], kd_s = [1e-5, 1e-2], \
             lowpass_hz = [2000.0, 12000.0], notch_hz = [500.0, 6000.0] }}\n",
            if write { "profile = \"p\"" } else { "" },
            if write {
                "dft_low = 0.0015\ndft_high = 0.001\nharmonics = [{ k = 1, amplitude = 0.003 }]\ncommand_peak = 0.3\ncommand_rms = 0.05\n"
            } else {
                ""
            },
            if write { "[limits.move]\novershoot = 0.01\nsettling_s = 1e-3\nband = 0.004\n" } else { "" },
        );
        Spec::parse(&text, write.then(|| file("profiles/spiral.toml")).as_deref()).unwrap()
    }

    /// Objective and every row against central differences of the score's own values.
    fn agree(problem: &TuningProblem, start: &Controller, records: usize) {
        let mut work = problem.work();
        let mut x = problem.parameters().vector(start);
        for (x, [from, to]) in x.iter_mut().zip(problem.parameters().bounds()) {
            // Off the ranges' ends, so that every parameter moves the loop.
            *x = x.clamp(from + 0.05 * (to - from), to - 0.05 * (to - from));
        }
        let here = linearise(problem, &x, &mut work).unwrap();
        let found = here.rows.iter().filter(|r| matches!(r.row.moves, Moves::Record { .. })).count();
        assert!(found >= records, "{found} rows of records");
        // Third derivatives of a few hundred in ln of a parameter over the step squared.
        let h = 1e-4;
        for j in 0..x.len() {
            let mut side = |h: f64| {
                let mut moved = x.clone();
                moved[j] += h;
                let score = problem.score(&moved, &mut work);
                (score, work.rows.clone())
            };
            let ((up, rows_up), (down, rows_down)) = (side(h), side(-h));
            let slope = (up.objective - down.objective) / (2.0 * h);
            let gradient = here.objectives[0].1[j];
            assert!((slope - gradient).abs() < 2e-3 * (0.05 + slope.abs()), "objective, {j}: {slope} {gradient}");
            for r in &here.rows {
                let near = |rows: &[Row]| {
                    rows.iter()
                        .filter(|o| r.row.same(o))
                        .map(|o| o.value)
                        .min_by(|a, b| (a - r.row.value).abs().total_cmp(&(b - r.row.value).abs()))
                };
                let (Some(a), Some(b)) = (near(&rows_up), near(&rows_down)) else { continue };
                let slope = (a - b) / (2.0 * h);
                // A peak between grid points is read off a parabola, whose slope is the middle point's to some per cent.
                let loose = matches!(
                    problem.wanted[r.row.wanted].what,
                    crate::tune::What::Curve { .. } | crate::tune::What::GainCrossover
                );
                let share = if loose { 0.15 } else { 0.02 };
                assert!(
                    (slope - r.gradient[j]).abs() < share * (0.1 + slope.abs()),
                    "{} at {} Hz, {:?}: {slope} {}",
                    problem.wanted[r.row.wanted].what,
                    r.row.w_rad_s / TAU,
                    problem.parameters().free()[j],
                    r.gradient[j]
                );
            }
        }
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let (plant, start) = (plant(), toml::from_str::<Controller>(&file("controllers/nominal.toml")).unwrap());
        for objective in ["pes_rms", "dft", "disturbance", "bandwidth", "integral"] {
            for write in [true, false] {
                if !write && ["pes_rms", "dft"].contains(&objective) {
                    continue;
                }
                let spec = spec(objective, write);
                let problem = TuningProblem::around(&[Machine::Model(&plant)], &spec, &start).unwrap();
                agree(&problem, &start, if write { 9 } else { 2 });
            }
        }
    }

    #[test]
    fn slopes_on_a_response_are_those_of_differences() {
        let (plant, start) = (plant(), toml::from_str::<Controller>(&file("controllers/nominal.toml")).unwrap());
        let w: Vec<f64> = (0..400).map(|i| TAU * 20.0 * 1.0155f64.powi(i)).collect();
        let frf = Frf::new(w.clone(), w.iter().map(|w| plant.at(*w)).collect(), None).unwrap();
        let machine = Machine::Response { frf: &frf, continuation: Some(&plant) };
        for objective in ["pes_rms", "dft", "disturbance"] {
            let mut spec = spec(objective, objective != "disturbance");
            spec.limits.command_rms = None;
            spec.limits.command_peak = None;
            let problem = TuningProblem::around(&[machine], &spec, &start).unwrap();
            agree(&problem, &start, 2);
        }
    }
}
