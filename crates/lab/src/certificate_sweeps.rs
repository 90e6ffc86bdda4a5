//! Certificates of sweeps: the nine cases of the HDD benchmark, and random loops known at sweep points only.

use super::StudyError;
use super::certificate_loops::{T, draw};
use super::hdd::{RATE_HZ, cases, joint};
use rayon::prelude::*;
use servotune::feedback::{ModelLoop, closed_loop_poles, margins};
use servotune::frf::{Frf, Hold};
use servotune::lti::{DiscretePlant, FrequencyResponse};
use servotune::tune::Spec;
use servotune::twin::plants::log_grid;
use servotune::verify::{BoundedFigure, Stability, Uncertainty, VerifySettings, prove_sweep};
use std::path::Path;

/// Least damping taken of the benchmark: its modes have 0.016 and more; the one above half the rate shows up four times wider.
const BENCHMARK_DAMPING: f64 = 0.01;
/// Points of the sweeps, and how many loops are swept so.
const SWEEPS: [(usize, u64); 3] = [(300, 4000), (2000, 600), (12_000, 60)];

/// One controller, nine certificates.
pub(super) fn benchmark(data: &Path) -> Result<String, StudyError> {
    let cases = cases(data)?;
    let outcome = joint(&cases)?;
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_profile.toml"))?;
    let c = outcome.controller();
    let t = 1.0 / RATE_HZ;
    let sections = c.sections()?.chain;
    let least_damping = BENCHMARK_DAMPING;
    let m = &spec.margins;
    let mut text = format!(
        "One table tuned jointly on all nine ({}); limits: phase margin {} deg, gain margin {} dB, Ms {}. Each case is certified from its response alone, \
         no mode being less damped than {BENCHMARK_DAMPING}.\n\n\
         | case | points | stability | phase margin at least (deg) | gain margin at least (dB) | Ms at most | disk margin at least | limits |\n|---|---|---|---|---|---|---|---|\n",
        if outcome.tuned().is_some() { "every limit met" } else { "infeasible, best compromise" },
        m.phase_margin_deg.unwrap_or_default(),
        m.gain_margin_db.unwrap_or_default(),
        m.max_sensitivity.unwrap_or_default(),
    );
    let away = 1.0 / m.max_sensitivity.unwrap_or(2.2);
    for case in &cases {
        let (b, again) = prove_sweep(
            &case.frf,
            &sections,
            t,
            least_damping,
            &Uncertainty::default(),
            away,
            &VerifySettings::default(),
        )?;
        let at_least = |b: BoundedFigure, limit: Option<f64>| limit.is_none_or(|l| b.low.is_none_or(|x| x >= l));
        let good = b.stability == Stability::Stable
            && at_least(b.phase_margin_deg, m.phase_margin_deg)
            && at_least(b.gain_margin_db, m.gain_margin_db)
            && m.max_sensitivity.is_none_or(|l| b.max_sensitivity.high.is_some_and(|x| x <= l))
            && m.gain_crossover_hz.is_none_or(|[from, to]| {
                b.gain_crossover_hz.low.is_some_and(|x| x >= from) && b.gain_crossover_hz.high.is_some_and(|x| x <= to)
            });
        let number = |x: Option<f64>| x.map_or("none".to_owned(), |x| format!("{x:.3}"));
        let verdict = match (good, again.len()) {
            (true, _) => "proved".to_owned(),
            (false, 0) => "not proved".to_owned(),
            (false, n) => format!("not proved; {n} bands to sweep again"),
        };
        text += &format!(
            "| {} | {} | {:?} | {} | {} | {} | {} | {verdict} |\n",
            case.name,
            case.frf.len(),
            b.stability,
            number(b.phase_margin_deg.low),
            number(b.gain_margin_db.low),
            number(b.max_sensitivity.high),
            number(b.disk_margin.low),
        );
    }
    Ok(text)
}

/// What one sweep came to.
#[derive(Clone, Copy, Default)]
struct Case {
    judged: bool,
    good: bool,
    fine: bool,
    passed: bool,
    named: bool,
    broken: bool,
}

/// Random loops of which only the points of a sweep are known; the least damping said is the true one.
pub(super) fn sweeps() -> Result<String, StudyError> {
    let mut text = "Random loops as above, known at points from 20 Hz to 12 kHz only, even in their logarithm; the least damping told is the plant's own. Limit: Ms 5 % above the \
         truth or 5 % below it, in turn. Fine enough: two points within the half width of every mode.\n\n\
         | points | judged | Ms met in truth | **missed and called proved** | met and proved | met, fine enough and not proved | met, too coarse and not proved | of those not proved with a band named | truth outside the bounds |\n|---|---|---|---|---|---|---|---|---|\n".to_owned();
    for (points, count) in SWEEPS {
        let all =
            (0..count).into_par_iter().map(|seed| one(seed, points)).collect::<Result<Vec<Case>, StudyError>>()?;
        let those = |f: &dyn Fn(&Case) -> bool| all.iter().filter(|c| c.judged && f(c)).count();
        text += &format!(
            "| {points} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            those(&|_| true),
            those(&|c| c.good),
            those(&|c| !c.good && c.passed),
            those(&|c| c.good && c.passed),
            those(&|c| c.good && c.fine && !c.passed),
            those(&|c| c.good && !c.fine && !c.passed),
            those(&|c| c.good && !c.passed && c.named),
            those(&|c| c.broken),
        );
    }
    Ok(text)
}

fn one(seed: u64, points: usize) -> Result<Case, StudyError> {
    let (plant, c, _) = draw(seed)?;
    let sections = c.sections()?;
    let sampled = DiscretePlant::of(&plant, T)?;
    let l = ModelLoop::new(&sampled, &sections)?;
    let m = margins(&l);
    let stable = closed_loop_poles(&l)?.iter().all(|z| z.norm() < 1.0);
    let least_damping = plant.modes.iter().map(|m| m.pole_damping_ratio.min(m.zero_damping_ratio)).fold(1.0, f64::min);
    let w = log_grid(20.0, 12_000.0, points);
    // The sampled plant's own response, hold and aliases included, as a sweep through the controller reads it.
    let value = w.iter().map(|w| sampled.at(*w)).collect();
    let frf = Frf::new(w, value, None)?.with_hold(Hold::Included { sample_time_s: T });
    let limit = m.max_sensitivity * if seed.is_multiple_of(2) { 1.05 } else { 0.95 };
    let proof = prove_sweep(
        &frf,
        &sections.chain,
        T,
        least_damping,
        &Uncertainty::default(),
        1.0 / limit,
        &VerifySettings::default(),
    );
    // A sweep that ends where crossings may lie is refused outright.
    let Ok((b, again)) = proof else { return Ok(Case::default()) };
    let proved_stable = b.stability == Stability::Stable;
    let passed = proved_stable && b.max_sensitivity.high.is_some_and(|x| x <= limit);
    let low = b.max_sensitivity.low.unwrap_or(0.0);
    let above = b.max_sensitivity.high.is_some_and(|x| m.max_sensitivity > x * 1.000_001);
    let ratio = (12_000f64 / 20.0).powf(1.0 / (points as f64 - 1.0)) - 1.0;
    Ok(Case {
        judged: true,
        good: stable && m.max_sensitivity <= limit,
        fine: ratio <= 0.5 * least_damping,
        passed,
        named: !again.is_empty(),
        broken: (proved_stable && (!stable || above)) || (stable && m.max_sensitivity < low * 0.999_999),
    })
}
