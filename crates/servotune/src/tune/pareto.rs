//! The front of margin against objective: the same machines tuned again and again while one margin is tightened.
//!
//! In: machines, a spec, the range of Ms. Out: one point for each Ms, its objective the worst machine's. Every point is tuned as
//! `tune` does it and judged exactly; a point that another beats in both is left out. Spec: `specs/performance.md`.

use super::{Machine, Outcome, Spec, TuneError, TuneSettings, tune_from};
use crate::controller::Controller;
use serde::Serialize;

/// Which margins are tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParetoSettings {
    /// Ms from, to (ratio, above 1).
    pub max_sensitivity: [f64; 2],
    /// Points, spread by ratio; at least 2.
    pub points: usize,
}

impl Default for ParetoSettings {
    fn default() -> Self {
        ParetoSettings { max_sensitivity: [1.3, 3.0], points: 12 }
    }
}

/// One point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParetoPoint {
    /// Ms that was allowed (ratio).
    pub allowed: f64,
    /// Whether every limit is met with it.
    pub feasible: bool,
    /// On the front: no other feasible point has both a smaller Ms and a smaller objective.
    pub on_front: bool,
    /// Ms found, worst machine (ratio).
    pub max_sensitivity: f64,
    /// Smallest phase margin found (deg).
    pub phase_margin_deg: Option<f64>,
    /// Largest norm over 600 to 1500 Hz (position_unit).
    pub dft_low: Option<f64>,
    /// Largest norm over 1500 to 3000 Hz (position_unit).
    pub dft_high: Option<f64>,
    /// The objective, as tuning minimises it.
    pub objective: f64,
    /// The gains.
    pub controller: Controller,
}

/// Tunes at every point, telling `watch` how many of how many are done; each starts from the one before as well as afresh, so that the front has no gaps of the search's making.
pub fn pareto(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
    front: &ParetoSettings,
    watch: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<ParetoPoint>, TuneError> {
    let [from, to] = front.max_sensitivity;
    for (key, found) in [("max_sensitivity from", from), ("max_sensitivity to", to)] {
        if !(found > 1.0 && found.is_finite()) {
            return Err(TuneError::Setting { key, found, expected: "a finite ratio above 1" });
        }
    }
    if from >= to {
        let expected = "less than max_sensitivity to: the front goes from the small Ms to the large one";
        return Err(TuneError::Setting { key: "max_sensitivity from", found: from, expected });
    }
    let count = front.points.max(2);
    let asked = |i: usize| {
        let allowed = from * (to / from).powf(i as f64 / (count - 1) as f64);
        let mut asked = spec.clone();
        asked.margins.max_sensitivity = Some(allowed);
        (allowed, asked)
    };
    let mut all: Vec<ParetoPoint> = Vec::with_capacity(count);
    let mut near: Vec<Controller> = Vec::new();
    for i in (0..count).rev() {
        let (allowed, asked) = asked(i);
        let outcome = tune_from(machines, &asked, start, &near, settings)?;
        let p = point(allowed, &outcome);
        // The next point, with less room, starts from this one's table as well as afresh.
        near = if p.feasible { vec![p.controller.clone()] } else { Vec::new() };
        all.push(p);
        watch(all.len(), count);
    }
    all.reverse();
    // A table that meets a smaller Ms meets a larger one: no point may be worse than the one before it.
    for i in 1..count {
        if all[i - 1].feasible && !(all[i].feasible && all[i].objective <= all[i - 1].objective) {
            let (allowed, asked) = asked(i);
            let before = all[i - 1].clone();
            let again = tune_from(machines, &asked, start, std::slice::from_ref(&before.controller), settings)?;
            let again = point(allowed, &again);
            let better = again.feasible && again.objective <= before.objective;
            all[i] = if better { again } else { ParetoPoint { allowed, ..before } };
        }
    }
    for i in 0..all.len() {
        let (ms, objective) = (all[i].max_sensitivity, all[i].objective);
        let beaten = all.iter().enumerate().any(|(j, o)| {
            let no_worse = o.max_sensitivity <= ms * (1.0 + SAME) && o.objective <= objective * (1.0 + SAME);
            let better = o.max_sensitivity < ms * (1.0 - SAME) || o.objective < objective * (1.0 - SAME);
            // Of points that are one and the same, where Ms no longer binds, the first stands.
            o.feasible && no_worse && (better || j < i)
        });
        all[i].on_front = all[i].feasible && !beaten;
    }
    Ok(all)
}

/// Two figures this near (as a share) are the same.
const SAME: f64 = 1e-4;

fn point(allowed: f64, outcome: &Outcome) -> ParetoPoint {
    let found: Vec<_> = outcome.after().iter().map(|p| &p.judged.found).collect();
    let largest = |of: &dyn Fn(&super::FoundFigures) -> f64| found.iter().map(|f| of(f)).fold(0.0, f64::max);
    let norm = |of: &dyn Fn(&super::FoundFigures) -> Option<f64>| found.iter().filter_map(|f| of(f)).reduce(f64::max);
    ParetoPoint {
        allowed,
        feasible: outcome.tuned().is_some(),
        on_front: false,
        max_sensitivity: largest(&|f| f.max_sensitivity),
        phase_margin_deg: found.iter().filter_map(|f| f.phase_margin_deg).reduce(f64::min),
        dft_low: norm(&|f| f.dft_low),
        dft_high: norm(&|f| f.dft_high),
        objective: outcome.objective().value,
        controller: outcome.controller().clone(),
    }
}
