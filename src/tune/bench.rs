//! The work bench of a search: machines, requirements and parameters, and what one candidate scores on them.
//!
//! In: a decision vector. Out: the objective and the largest violation. One [`Desk`] a thread holds every buffer, so that a
//! candidate allocates nothing.

use super::machine::{Buffers, PesScore, PesSlopes, Prepared};
use super::parameters::chain_of;
use super::requirements::{Found, Requirement};
use super::spec::Limits;
use super::{Machine, Parameters, PolishMethod, Spec, TuneError, What};
use crate::controller::Controller;
use crate::feedback::{Event, GRAZE, Graze, Pulls, QuickMargins};
use crate::lti::Section;
use std::f64::consts::TAU;

/// Everything that a search shares between threads.
#[derive(Clone, Debug)]
pub struct Bench {
    pub(super) machines: Vec<Prepared>,
    pub(super) parameters: Parameters,
    /// The requirements as the spec has them.
    pub(super) wanted: Vec<Requirement>,
    /// The limits as the search aims at them, machine by machine: the spec's, and a little inside after a back-off.
    pub(super) aimed: Vec<Vec<Requirement>>,
    pub(super) harmonics: Vec<usize>,
    pub(super) weight_low: f64,
    pub(super) weight_high: f64,
    pub(super) method: PolishMethod,
}

/// The buffers of one thread.
#[derive(Clone, Debug)]
pub struct Desk {
    pub(super) controller: Controller,
    pub(super) chain: Vec<Section>,
    pub(super) buffers: Vec<Buffers>,
    pub(super) scores: Vec<MachineScore>,
    pub(super) pulls: Pulls,
    pub(super) slopes: PesSlopes,
    /// Candidates scored so far.
    pub evaluations: usize,
}

impl Desk {
    /// The figures of the last candidate on machine `i`, as the search sees them: noise by its expected power.
    pub fn found(&self, i: usize) -> &Found {
        &self.scores[i].found
    }
}

/// One candidate on one machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MachineScore {
    /// ln of the weighted sum of both DFT norms.
    pub objective: f64,
    pub found: Found,
    pub pes: PesScore,
}

/// One candidate: worst machine first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// ln of the weighted sum of both DFT norms, of the worst machine.
    pub objective: f64,
    /// Largest violation over all limits and machines; at most 0 where all are met.
    pub violation: f64,
}

/// Violation of an unstable loop, so far above any limit's that stability always comes first.
pub(super) const UNSTABLE: f64 = 100.0;

/// How far inside its limit the search aims: rounding between two ways to one figure is far below it.
const INSIDE: f64 = 1e-7;

impl Score {
    /// Exact penalty: the objective, and `price` for the largest violation.
    pub fn merit(&self, price: f64) -> f64 {
        if self.violation >= UNSTABLE {
            // The PES of an unstable loop says nothing; only the way back to stability counts.
            return price * self.violation + UNSTABLE;
        }
        self.objective + price * self.violation.max(0.0)
    }
}

impl Bench {
    /// Prepares machines and requirements; `base` carries the fixed numbers.
    pub fn new(machines: &[Machine<'_>], spec: &Spec, parameters: Parameters) -> Result<Bench, TuneError> {
        let wanted = Requirement::list(&spec.margins, &spec.limits);
        let harmonics: Vec<usize> = spec.limits.harmonics.iter().map(|h| h.k).collect();
        let peak = spec.limits.command_peak.is_some();
        let prepare = |m| Prepared::of(m, &spec.profile, &harmonics, peak, parameters.base());
        let machines = machines.iter().map(prepare).collect::<Result<Vec<_>, _>>()?;
        let [weight_low, weight_high] = weights(&spec.limits);
        let mut bench = Bench {
            aimed: Vec::new(),
            machines,
            parameters,
            wanted,
            harmonics,
            weight_low,
            weight_high,
            method: PolishMethod::default(),
        };
        bench.aim(&vec![vec![0.0; bench.wanted.len()]; bench.machines.len()]);
        Ok(bench)
    }

    /// Moves the limits that the search aims at inside by these shares of them, machine by machine.
    pub(super) fn aim(&mut self, inside: &[Vec<f64>]) {
        let moved = |(w, share): (&Requirement, &f64)| {
            let share = share + INSIDE;
            let factor = if w.side == super::Side::AtLeast { 1.0 + share } else { 1.0 - share };
            Requirement { limit: w.limit * factor, ..*w }
        };
        self.aimed = inside.iter().map(|s| self.wanted.iter().zip(s).map(moved).collect()).collect();
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Buffers for one thread.
    pub fn desk(&self) -> Desk {
        let controller = self.parameters.base().clone();
        let sections = 1 + controller.lowpass.len() + controller.notch.len();
        Desk {
            chain: Vec::with_capacity(sections),
            buffers: self.machines.iter().map(Prepared::buffers).collect(),
            scores: vec![MachineScore::default(); self.machines.len()],
            pulls: Pulls::default(),
            slopes: PesSlopes::default(),
            controller,
            evaluations: 0,
        }
    }

    /// Scores a candidate: margins of every machine, then the write of every machine unless one is unstable.
    pub fn score(&self, x: &[f64], desk: &mut Desk) -> Score {
        self.score_within(x, f64::INFINITY, desk)
    }

    /// The same; where margins alone miss a limit by more than `hopeless` (share of the limit) the write is not looked at: the violation is that of
    /// the margins, at most the whole one, and the objective is 0.
    pub fn score_within(&self, x: &[f64], hopeless: f64, desk: &mut Desk) -> Score {
        desk.evaluations += 1;
        self.parameters.put(x, &mut desk.controller);
        if !chain_of(&desk.controller, &mut desk.chain) {
            return Score { objective: 0.0, violation: f64::INFINITY };
        }
        if let Some(violation) = self.judge_margins(desk) {
            return Score { objective: 0.0, violation };
        }
        if hopeless < f64::INFINITY {
            let missed = self.margins_missed(desk);
            if missed > hopeless {
                return Score { objective: 0.0, violation: missed };
            }
        }
        self.judge_writes(desk);
        let mut score = Score { objective: f64::NEG_INFINITY, violation: f64::NEG_INFINITY };
        for ((s, aimed), b) in desk.scores.iter().zip(&self.aimed).zip(&desk.buffers) {
            let mut harmonic = 0;
            for w in aimed {
                score.violation = score.violation.max(w.violation_of(&s.found, &mut harmonic));
                for g in harmful_grazes(&b.on.quick, w) {
                    score.violation = score.violation.max(graze_violation(g));
                }
                if w.what == What::GainCrossover {
                    let tied = named_crossings(&b.on.quick).map(|e| w.violation(e.w_rad_s / TAU));
                    score.violation = tied.fold(score.violation, f64::max);
                }
            }
            score.objective = score.objective.max(s.objective);
        }
        score
    }

    /// The largest violation of a limit of a margin, from the figures in the desk.
    fn margins_missed(&self, desk: &Desk) -> f64 {
        let margin = |w: &&Requirement| {
            matches!(w.what, What::PhaseMargin | What::GainMargin | What::MaxSensitivity | What::GainCrossover)
        };
        let of = |(s, aimed): (&MachineScore, &Vec<Requirement>)| {
            aimed.iter().filter(margin).map(|w| w.violation_of(&s.found, &mut 0)).fold(f64::NEG_INFINITY, f64::max)
        };
        desk.scores.iter().zip(&self.aimed).map(of).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Margins of every machine into the desk; the violation where one is unstable.
    fn judge_margins(&self, desk: &mut Desk) -> Option<f64> {
        let mut unstable: Option<f64> = None;
        for ((m, b), s) in self.machines.iter().zip(&mut desk.buffers).zip(&mut desk.scores) {
            m.sampled.judge(&desk.chain, &mut b.on);
            let q = &b.on.quick;
            s.found.unstable_poles = q.unstable_poles;
            if q.unstable_poles != 0 {
                // How much gain would have to go, in nepers, points the way back.
                let excess = q.phase_crossings.iter().map(|e| -e.value).fold(0.0, f64::max);
                let violation = UNSTABLE * (1.0 + q.unstable_poles.unsigned_abs() as f64) + excess;
                unstable = Some(unstable.map_or(violation, |v| v.max(violation)));
                continue;
            }
            let (gain, phase) = (q.worst_gain_crossing(), q.worst_phase_crossing());
            s.found.phase_margin_deg = gain.map(|e| e.value);
            s.found.gain_crossover_hz = gain.map(|e| e.w_rad_s / TAU);
            s.found.gain_margin_db = phase.map(|e| e.value);
            s.found.max_sensitivity = q.max_sensitivity();
        }
        unstable
    }

    /// The write of every machine into the desk.
    pub(super) fn judge_writes(&self, desk: &mut Desk) {
        let Desk { controller, chain, buffers, scores, .. } = desk;
        for ((m, b), s) in self.machines.iter().zip(buffers).zip(scores) {
            m.write(controller, chain, b, &self.harmonics, &mut s.pes);
            let p = &s.pes;
            s.objective = (self.weight_low * p.dft_low + self.weight_high * p.dft_high).max(f64::MIN_POSITIVE).ln();
            (s.found.dft_low, s.found.dft_high, s.found.command_peak) = (p.dft_low, p.dft_high, p.command_peak);
            s.found.harmonics.clone_from(&p.harmonics);
        }
    }
}

/// Phase margins this close (deg) may change places between the grid and the exact judgement.
const TIE_DEG: f64 = 0.5;

/// The gain crossings that may be the one named, the one with the smallest phase margin.
pub(super) fn named_crossings(q: &QuickMargins) -> impl Iterator<Item = &Event> {
    let least = q.gain_crossings.iter().map(|e| e.value.abs()).fold(f64::INFINITY, f64::min);
    q.gain_crossings.iter().filter(move |e| e.value.abs() <= least + TIE_DEG)
}

/// Grazes that would be named, and would miss this limit, if they were crossings.
pub(super) fn harmful_grazes<'a>(q: &'a QuickMargins, w: &'a Requirement) -> impl Iterator<Item = &'a Graze> {
    let least = q.gain_crossings.iter().map(|e| e.value.abs()).fold(f64::INFINITY, f64::min);
    q.grazes.iter().filter(move |g| {
        let e = &g.event;
        let miss = match w.what {
            What::PhaseMargin => w.violation(e.value),
            What::GainCrossover => w.violation(e.w_rad_s / TAU),
            _ => 0.0,
        };
        miss > 0.0 && e.value.abs() <= least + TIE_DEG
    })
}

/// How far |L| has come into the forbidden zone around 1 (ln).
pub(super) fn graze_violation(g: &Graze) -> f64 {
    let away = g.event.l.norm().ln();
    GRAZE - if g.minimum { away } else { -away }
}

/// Each norm is weighed by its own limit; where only one has a limit both are weighed by it; where none has, they are summed.
pub(super) fn weights(l: &Limits) -> [f64; 2] {
    match (l.dft_low, l.dft_high) {
        (Some(low), Some(high)) => [1.0 / low, 1.0 / high],
        (Some(one), None) | (None, Some(one)) => [1.0 / one, 1.0 / one],
        (None, None) => [1.0, 1.0],
    }
}

/// The figure of the write that a requirement limits; none for margins.
pub(super) fn figure_of_write(what: What, p: &PesScore, harmonic: &mut usize) -> Option<f64> {
    match what {
        What::DftLow => Some(p.dft_low),
        What::DftHigh => Some(p.dft_high),
        What::Harmonic { .. } => {
            *harmonic += 1;
            p.harmonics.get(*harmonic - 1).copied()
        }
        What::CommandPeak => Some(p.command_peak),
        _ => None,
    }
}
