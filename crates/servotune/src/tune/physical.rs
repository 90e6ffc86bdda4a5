//! A plant with physics as something to tune: one equivalent response for each amplitude, and a judgement with nothing left out.
//!
//! In: a plant's physics made ready, amplitudes. Out: responses for [`super::tune_jointly`], which meets the limits on the
//! worst of them; and the judgement of a controller: margins over the amplitude, the write simulated with every effect.

use super::{
    FoundFigures, Judged, Judgement, Machine, Outcome, Requirement, Side, Spec, TuneError, TuneSettings, What,
    tune_jointly,
};
use crate::controller::Controller;
use crate::feedback::{
    Amplitudes, DescribedMargins, DescribedPlant, Margins, ModelLoop, described_margins, linear_crossover_hz, margins,
};
use crate::frf::{Frf, Hold};
use crate::lti::{DiscretePlant, FrequencyResponse, Sections};
use crate::pes::{figures, simulate_physical};
use crate::physics::Restored;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// Amplitudes that a search carries along: each costs a search of its own.
pub const TUNED_AMPLITUDES: usize = 4;

/// Where crossovers and notches lie (Hz), and the largest ratio between neighbours there.
const FINE_HZ: [f64; 2] = [150.0, 4000.0];
const STEP: f64 = 1.03;
/// Share of half the sample rate at which a response ends.
const END: f64 = 0.999;

/// The plant's equivalent responses, hold included, one an amplitude.
///
/// Effects of the amplifier are described at the command that goes with the amplitude at `crossover_hz`.
pub fn equivalent_responses(
    physics: &Restored,
    amplitudes: &Amplitudes,
    crossover_hz: f64,
) -> Result<Vec<Frf>, TuneError> {
    let plant = DescribedPlant::new(physics, crossover_hz)?;
    let sample_time_s = plant.sample_time_s();
    let end = END * PI / sample_time_s;
    let mut grid: Vec<f64> = Vec::new();
    for w in plant.grid(&Sections { chain: vec![], sample_time_s }).into_iter().filter(|w| *w < end).chain([end]) {
        if let Some(&last) = grid.last()
            && (FINE_HZ[0] * TAU..FINE_HZ[1] * TAU).contains(&w)
            && w > STEP * last
        {
            grid.push((last * w).sqrt());
        }
        grid.push(w);
    }
    let list = if plant.bends() { amplitudes.list() } else { vec![amplitudes.high] };
    let response = |a: f64| {
        let at = plant.at_amplitude(a);
        let frf = Frf::new(grid.clone(), grid.iter().map(|&w| at.at(w)).collect(), None)?;
        Ok(frf.with_hold(Hold::Included { sample_time_s }))
    };
    list.into_iter().map(response).collect()
}

/// One controller on a plant with physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalJudgement {
    /// Margins over the amplitude.
    pub margins: DescribedMargins,
    /// Margins of the linear plant alone.
    pub linear: Margins,
    /// Requirements: the worst margins, and the figures of the write with every effect.
    pub judged: Judged,
}

/// Judges a controller: describing-function margins, worst over the amplitudes, and the write simulated with the physics.
pub fn judge_physical(
    physics: &Restored,
    controller: &Controller,
    spec: &Spec,
    amplitudes: &Amplitudes,
) -> Result<PhysicalJudgement, TuneError> {
    let sections = controller.sections()?;
    let sampled = DiscretePlant::of(&physics.scene.plant, controller.sample_time_s)?;
    let linear = margins(&ModelLoop::new(&sampled, &sections)?);
    let plant = DescribedPlant::new(physics, linear_crossover_hz(&linear, &sections))?;
    let described = described_margins(&plant, &sections, amplitudes)?;
    let profile = spec.write("tuning a plant with physics")?;
    if let Some(what) = beyond(spec) {
        return Err(TuneError::PhysicsLimit { what });
    }
    let write = simulate_physical(physics, controller, profile)?;
    let f = figures(&write.pes, profile);
    let of = |k: usize| f.harmonics.iter().find(|h| h.k == k).map_or(0.0, |h| h.amplitude);
    let found = FoundFigures {
        unstable_poles: described.worst.unstable_poles,
        phase_margin_deg: described.worst.phase_margin_deg,
        gain_margin_db: described.worst.gain_margin_db,
        max_sensitivity: described.worst.max_sensitivity,
        gain_crossover_hz: described.worst.gain_crossover_hz,
        gain_crossings_hz: crossings(&described),
        dft_low: f.dft_low,
        dft_high: f.dft_high,
        harmonics: spec.limits.harmonics.iter().map(|h| of(h.k)).collect(),
        command_peak: Some(write.command.iter().fold(0.0, |a, u| u.abs().max(a))),
        ..FoundFigures::default()
    };
    let judged = Judged::of(&Requirement::list(&spec.margins, &spec.limits), found);
    Ok(PhysicalJudgement { margins: described, linear, judged })
}

/// Lowest and highest of the crossovers over the amplitudes (Hz).
fn crossings(m: &DescribedMargins) -> Option<[f64; 2]> {
    let all = m.by_amplitude.iter().filter_map(|r| r.gain_crossover_hz);
    all.fold(None, |ends: Option<[f64; 2]>, hz| Some(ends.map_or([hz, hz], |[a, b]| [a.min(hz), b.max(hz)])))
}

/// The first limit of a spec that is not judged on a plant with physics.
fn beyond(spec: &Spec) -> Option<What> {
    Requirement::list(&spec.margins, &spec.limits).into_iter().map(|r| r.what).find(|what| {
        matches!(what, What::Bandwidth | What::CommandRms | What::Overshoot | What::Settling | What::Curve { .. })
    })
}

impl PhysicalJudgement {
    /// The worst of it as the judgement of one machine, for tables and pages.
    pub fn worst(&self) -> Judgement {
        Judgement { margins: self.margins.worst.clone(), judged: self.judged.clone() }
    }
}

/// A tuning of a plant with physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalTuning {
    /// The outcome on the equivalent responses.
    pub outcome: Outcome,
    /// Amplitudes that the search carried (position_unit).
    pub amplitudes: Vec<f64>,
    /// The start controller, judged with the physics; none without one.
    pub before: Option<PhysicalJudgement>,
    /// The tuned controller, judged with the physics.
    pub after: PhysicalJudgement,
    /// Searches, the first one included.
    pub rounds: usize,
}

/// Searches at most: each later one aims inside by what the judgement with physics missed.
const ROUNDS: usize = 4;
/// How far beyond a miss the next search aims.
const BEYOND: f64 = 1.2;

impl PhysicalTuning {
    /// Every limit is met, physics and all amplitudes included.
    pub fn passes(&self) -> bool {
        self.outcome.tuned().is_some() && self.after.judged.passes()
    }
}

/// Where a loop under this spec is to cross over (Hz): the middle of the wanted band, else the start's, else 500 Hz.
fn wanted_crossover_hz(physics: &Restored, spec: &Spec, start: Option<&Controller>) -> Result<f64, TuneError> {
    if let Some([from, to]) = spec.margins.gain_crossover_hz {
        return Ok((from * to).sqrt());
    }
    let Some(c) = start else { return Ok(500.0) };
    let sections = c.sections()?;
    let sampled = DiscretePlant::of(&physics.scene.plant, c.sample_time_s)?;
    Ok(linear_crossover_hz(&margins(&ModelLoop::new(&sampled, &sections)?), &sections))
}

/// Tunes a plant with physics: on the worst of its equivalent responses, judged with every effect and at every amplitude.
pub fn tune_physical(
    physics: &Restored,
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
    amplitudes: &Amplitudes,
) -> Result<PhysicalTuning, TuneError> {
    let carried = Amplitudes { count: TUNED_AMPLITUDES, ..*amplitudes };
    let responses = equivalent_responses(physics, &carried, wanted_crossover_hz(physics, spec, start)?)?;
    let machine = |frf| Machine::Response { frf, continuation: None };
    let machines: Vec<Machine<'_>> = responses.iter().map(machine).collect();
    let outcome = tune_jointly(&machines, spec, start, settings)?;
    let before = start.map(|c| judge_physical(physics, c, spec, amplitudes)).transpose()?;
    let after = judge_physical(physics, outcome.controller(), spec, amplitudes)?;
    let amplitudes_carried = carried.list().into_iter().take(responses.len()).collect();
    let mut best = PhysicalTuning { outcome, amplitudes: amplitudes_carried, before, after, rounds: 1 };
    let mut aimed = spec.clone();
    while best.rounds < ROUNDS && best.outcome.tuned().is_some() && !best.after.judged.passes() {
        best.rounds += 1;
        aim_inside(&mut aimed, &best.after.judged);
        if aimed.check().is_err() {
            break;
        }
        // The last controller is a good start, and the limits have hardly moved.
        let near = TuneSettings { starts: settings.starts.div_ceil(4), ..*settings };
        let outcome = tune_jointly(&machines, &aimed, Some(best.outcome.controller()), &near)?;
        let after = judge_physical(physics, outcome.controller(), spec, amplitudes)?;
        if after.judged.worst() >= best.after.judged.worst() {
            break;
        }
        if matches!(outcome, Outcome::Infeasible(_)) && !after.judged.passes() {
            break;
        }
        // Judged by the limits as they were asked for, not as they were aimed at.
        best.outcome = match outcome {
            Outcome::Infeasible(i) => Outcome::TunedWithoutGuard(super::Tuned {
                controller: i.controller,
                before: None,
                after: i.after,
                objective: i.objective,
                at_bounds: i.at_bounds,
                ranges: i.ranges,
                work: i.work,
            }),
            tuned => tuned,
        };
        best.after = after;
    }
    Ok(best)
}

/// Moves each limit that was missed by the miss and a little more.
fn aim_inside(spec: &mut Spec, judged: &Judged) {
    for l in judged.limits.iter().filter(|l| !l.met()) {
        let Some(found) = l.found else { continue };
        let moved = |now: f64| now + BEYOND * (l.wanted.limit - found);
        let (m, limits) = (&mut spec.margins, &mut spec.limits);
        match (l.wanted.what, l.wanted.side) {
            (What::PhaseMargin, _) => m.phase_margin_deg = m.phase_margin_deg.map(moved),
            (What::GainMargin, _) => m.gain_margin_db = m.gain_margin_db.map(moved),
            (What::MaxSensitivity, _) => m.max_sensitivity = m.max_sensitivity.map(moved),
            (What::GainCrossover, side) => {
                if let Some(band) = &mut m.gain_crossover_hz {
                    let end = &mut band[usize::from(side == Side::AtMost)];
                    *end = moved(*end);
                }
            }
            (What::DftLow, _) => limits.dft_low = limits.dft_low.map(moved),
            (What::DftHigh, _) => limits.dft_high = limits.dft_high.map(moved),
            (What::CommandPeak, _) => limits.command_peak = limits.command_peak.map(moved),
            (What::Harmonic { k }, _) => {
                for h in limits.harmonics.iter_mut().filter(|h| h.k == k) {
                    h.amplitude = moved(h.amplitude);
                }
            }
            // Refused before the search.
            (
                What::Bandwidth
                | What::CommandRms
                | What::Overshoot
                | What::Settling
                | What::MoveOvershoot
                | What::MoveSettling
                | What::Curve { .. },
                _,
            ) => {}
        }
    }
}
