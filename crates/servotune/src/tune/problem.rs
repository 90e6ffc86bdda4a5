//! The problem of a search: machines, requirements and parameters, and what one candidate scores on them.
//!
//! In: a decision vector. Out: the objective and the largest violation. One [`TuningWork`] a thread holds every buffer, so that a
//! candidate allocates nothing once they have grown.

use super::loop_rows::{FAR_CROSSING, LoopLimits, Place, loop_rows, places};
use super::machine::{Buffers, Prepared};
use super::objective::Minimise;
use super::parameters::chain_of;
use super::record_figures::{Asked, RecordFigure};
use super::requirements::{CurveFound, FoundFigures, Requirement, Side, What};
use super::row::{Moves, Row};
use super::score::{INSIDE, Score, UNSTABLE};
use super::{Machine, Parameters, Ranges, Spec, TuneError};
use crate::controller::Controller;
use crate::feedback::CurveLimit;
use crate::lti::Section;
use std::f64::consts::{LOG10_E, TAU};

/// Everything that a search shares between threads.
#[derive(Clone, Debug)]
pub struct TuningProblem {
    pub(super) machines: Vec<Prepared>,
    pub(super) parameters: Parameters,
    pub(super) minimise: Minimise,
    /// The requirements as the spec has them.
    pub(super) wanted: Vec<Requirement>,
    /// The limits as the search aims at them, machine by machine: the spec's with its guard, and further inside after a back-off.
    pub(super) aimed: Vec<Aimed>,
    curves: Vec<CurveLimit>,
    stabilised: Vec<[f64; 2]>,
    pub(super) asked: Asked,
    /// Share of each limit that is kept as room while the guard is held.
    rooms: Vec<f64>,
    guard: f64,
    /// Whether the objective is the first machine's alone; else the worst one's counts.
    pub(super) nominal_first: bool,
    /// Weight of a crossing of 1 away from the crossover range.
    pub(super) far_crossing: f64,
}

/// The limits of one machine as the search aims at them.
#[derive(Clone, Debug)]
pub(super) struct Aimed {
    pub wanted: Vec<Requirement>,
    places: Vec<Place>,
    levels: Vec<Vec<f64>>,
}

/// The buffers of one thread.
#[derive(Clone, Debug)]
pub struct TuningWork {
    pub(super) controller: Controller,
    pub(super) chain: Vec<Section>,
    pub(super) buffers: Vec<Buffers>,
    /// Limits at the candidate scored last, each where it may decide.
    pub(super) rows: Vec<Row>,
    /// ln of each machine's objective at the candidate scored last; `room` has its value.
    pub(super) objectives: Vec<f64>,
    /// Candidates scored so far.
    pub evaluations: usize,
}

/// The ranges that a search on these machines has at this sample time (s).
pub fn ranges(machines: &[Machine<'_>], spec: &Spec, sample_time_s: f64) -> Ranges {
    let gains: Vec<Box<dyn Fn(f64) -> f64 + '_>> =
        machines.iter().map(|m| Box::new(|w: f64| m.gain(w)) as Box<dyn Fn(f64) -> f64 + '_>).collect();
    let gains: Vec<&dyn Fn(f64) -> f64> = gains.iter().map(|g| g.as_ref()).collect();
    spec.search.bounds.ranges(&gains, spec.crossover_hz(sample_time_s), sample_time_s)
}

impl TuningProblem {
    /// The problem of tables of the shape of `base`, in the ranges that these machines ask for.
    pub fn around(machines: &[Machine<'_>], spec: &Spec, base: &Controller) -> Result<TuningProblem, TuneError> {
        let t = base.sample_time_s;
        let parameters = Parameters::of(spec, Some(base), t, &ranges(machines, spec, t));
        TuningProblem::new(machines, spec, parameters)
    }

    /// Prepares machines and requirements; `parameters` carry the fixed numbers. The limits are aimed at with the spec's guard.
    pub fn new(machines: &[Machine<'_>], spec: &Spec, parameters: Parameters) -> Result<TuningProblem, TuneError> {
        let wanted = Requirement::list(&spec.margins, &spec.limits);
        let asked = Asked::of(spec, &wanted, parameters.base().sample_time_s);
        let prepare = |m| Prepared::of(m, spec, &asked, parameters.base());
        let machines = machines.iter().map(prepare).collect::<Result<Vec<_>, _>>()?;
        let mut problem = TuningProblem {
            aimed: Vec::new(),
            minimise: spec.objective.minimise,
            curves: spec.limits.curve.clone(),
            stabilised: spec.margins.phase_stabilised_hz.iter().map(|r| r.map(|hz| TAU * hz)).collect(),
            machines,
            parameters,
            wanted,
            asked,
            rooms: Vec::new(),
            guard: spec.guard,
            nominal_first: false,
            far_crossing: FAR_CROSSING,
        };
        problem.rooms = (0..problem.wanted.len())
            .map(|i| spec.further_room.get(i).map_or(spec.guard, |r| r.max(spec.guard)))
            .collect();
        problem.aim_guarded(true);
        Ok(problem)
    }

    /// Room of each limit: as the spec has it, or none.
    pub(super) fn rooms(&self, guarded: bool) -> Vec<f64> {
        if guarded { self.rooms.clone() } else { vec![0.0; self.wanted.len()] }
    }

    /// Whether any limit keeps room.
    pub(super) fn keeps_room(&self) -> bool {
        self.rooms.iter().any(|r| *r > 0.0)
    }

    /// Aims at every limit with its room, or without.
    pub(super) fn aim_guarded(&mut self, guarded: bool) {
        self.aim(&vec![self.rooms(guarded); self.machines.len()]);
    }

    /// Moves the limits that the search aims at inside by these shares of them, machine by machine.
    pub(super) fn aim(&mut self, inside: &[Vec<f64>]) {
        let aimed = self.machines.iter().zip(inside).map(|(m, inside)| {
            let wanted: Vec<Requirement> =
                self.wanted.iter().zip(inside).map(|(w, share)| w.inside(share + INSIDE)).collect();
            let grid = m.sampled.w_rad_s();
            let level = |c: &CurveLimit| -> Vec<f64> {
                grid.iter().map(|w| c.at(w / TAU).map_or(f64::NAN, |db| db / (20.0 * LOG10_E))).collect()
            };
            Aimed {
                places: places(&wanted, &self.curves, &self.stabilised, m.end_rad_s(), &|w| m.at(w)),
                levels: self.curves.iter().map(level).collect(),
                wanted,
            }
        });
        self.aimed = aimed.collect();
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Buffers for one thread.
    pub fn work(&self) -> TuningWork {
        TuningWork {
            controller: self.parameters.base().clone(),
            chain: Vec::new(),
            buffers: self.machines.iter().map(Prepared::buffers).collect(),
            rows: Vec::new(),
            objectives: vec![0.0; self.machines.len()],
            evaluations: 0,
        }
    }

    /// Scores a candidate: margins of every machine, then the records of every machine unless one is unstable.
    pub fn score(&self, x: &[f64], work: &mut TuningWork) -> Score {
        self.score_within(x, f64::INFINITY, work)
    }

    /// The same; where limits of the loop alone are missed by more than `hopeless` (share of the limit) no record is looked at: the violation is
    /// theirs, at most the whole one, and the objective is 0.
    pub fn score_within(&self, x: &[f64], hopeless: f64, work: &mut TuningWork) -> Score {
        work.evaluations += 1;
        self.parameters.put(x, &mut work.controller);
        if !chain_of(&work.controller, &mut work.chain) {
            return Score { objective: 0.0, violation: f64::INFINITY };
        }
        let TuningWork { chain, buffers, rows, objectives, controller, .. } = work;
        rows.clear();
        let mut unstable: Option<f64> = None;
        for (number, ((m, b), aimed)) in self.machines.iter().zip(&mut *buffers).zip(&self.aimed).enumerate() {
            m.sampled.judge(chain, &mut b.on);
            let q = &b.on.quick;
            if q.unstable_poles != 0 {
                // How much gain would have to go, in nepers, points the way back.
                let excess = q.phase_crossings.iter().map(|e| -e.value).fold(0.0, f64::max);
                let violation = UNSTABLE * (1.0 + q.unstable_poles.unsigned_abs() as f64) + excess;
                unstable = Some(unstable.map_or(violation, |v| v.max(violation)));
                continue;
            }
            if unstable.is_none() {
                loop_rows(&self.limits(number, aimed), &m.sampled, chain, &b.on, rows);
            }
        }
        if let Some(violation) = unstable {
            rows.clear();
            return Score { objective: 0.0, violation };
        }
        let worst = |rows: &[Row]| rows.iter().map(|r| r.value).fold(f64::NEG_INFINITY, f64::max);
        let missed = worst(rows);
        if missed > hopeless {
            return Score { objective: 0.0, violation: missed };
        }
        for (number, ((m, b), aimed)) in self.machines.iter().zip(buffers).zip(&self.aimed).enumerate() {
            m.records(controller, chain, &self.asked, &aimed.wanted, b);
            record_rows(number, &aimed.wanted, &self.asked, b, rows);
            objectives[number] = self.objective(m, controller, b);
        }
        let violation = worst(rows);
        let counted = if self.nominal_first { &objectives[..1] } else { &objectives[..] };
        let objective = match self.minimise {
            Minimise::Room => violation,
            _ => counted.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        };
        Score { objective, violation: if violation.is_nan() { f64::INFINITY } else { violation } }
    }

    fn limits<'a>(&'a self, machine: usize, aimed: &'a Aimed) -> LoopLimits<'a> {
        LoopLimits {
            machine,
            aimed: &aimed.wanted,
            wanted: &self.wanted,
            guard: self.guard,
            curves: &self.curves,
            stabilised: &self.stabilised,
            far_crossing: self.far_crossing,
            places: &aimed.places,
            levels: &aimed.levels,
        }
    }

    /// ln of one machine's objective, from what its buffers hold.
    fn objective(&self, m: &Prepared, c: &Controller, b: &Buffers) -> f64 {
        match self.minimise {
            Minimise::PesRms | Minimise::Dft | Minimise::Disturbance => {
                b.figures.first().copied().unwrap_or(f64::NAN).max(f64::MIN_POSITIVE).ln()
            }
            Minimise::Bandwidth => {
                let first = m.sampled.w_rad_s()[0];
                -b.on.quick.lowest_gain_crossing().map_or(first, |e| e.w_rad_s).ln()
            }
            Minimise::Integral => -c.pid.ki_per_s.max(f64::MIN_POSITIVE).ln(),
            Minimise::Room => 0.0,
        }
    }

    /// The figures of the last candidate on machine `i`, as the search sees them.
    pub fn found(&self, i: usize, work: &TuningWork) -> FoundFigures {
        let b = &work.buffers[i];
        let q = &b.on.quick;
        let figure = |f: RecordFigure| self.asked.place(f).and_then(|at| b.figures.get(at).copied());
        let outside = |w: f64| !self.stabilised.iter().any(|[from, to]| (*from..=*to).contains(&w));
        let crossings = q.gain_crossings.iter().map(|e| e.w_rad_s).filter(|w| outside(*w));
        let ends = crossings
            .fold(None, |ends: Option<[f64; 2]>, w| Some(ends.map_or([w, w], |[low, high]| [low.min(w), high.max(w)])));
        let (gain, phase) = (q.worst_gain_crossing(), q.worst_phase_crossing());
        let ratio = |index: usize| {
            let rows = work
                .rows
                .iter()
                .filter(|r| r.machine == i && self.aimed[i].wanted[r.wanted].what == What::Curve { index });
            let limit = self.aimed[i].wanted.iter().find(|w| w.what == What::Curve { index }).map_or(1.0, |w| w.limit);
            let worst = rows.max_by(|a, b| a.value.total_cmp(&b.value));
            worst.map_or(CurveFound::default(), |r| CurveFound { ratio: (1.0 + r.value) * limit, hz: r.w_rad_s / TAU })
        };
        FoundFigures {
            unstable_poles: q.unstable_poles,
            phase_margin_deg: gain.map(|e| e.value),
            gain_crossover_hz: gain.map(|e| e.w_rad_s / TAU),
            gain_margin_db: phase.map(|e| e.value),
            max_sensitivity: q.max_sensitivity(),
            gain_crossings_hz: ends.map(|e| e.map(|w| w / TAU)),
            bandwidth_hz: None,
            within_sweep: false,
            dft_low: figure(RecordFigure::Band(0)),
            dft_high: figure(RecordFigure::Band(1)),
            harmonics: (0..self.asked.harmonics.len()).filter_map(|k| figure(RecordFigure::Harmonic(k))).collect(),
            command_peak: figure(RecordFigure::CommandPeak),
            command_rms: figure(RecordFigure::CommandRms),
            overshoot_percent: figure(RecordFigure::Overshoot),
            settling_s: None,
            move_overshoot: figure(RecordFigure::MoveOvershoot),
            move_settling_s: None,
            curves: (0..self.curves.len()).map(ratio).collect(),
        }
    }
}

/// The limits on records, from the figures that the buffers hold.
fn record_rows(machine: usize, aimed: &[Requirement], asked: &Asked, b: &Buffers, rows: &mut Vec<Row>) {
    let mut harmonic = 0;
    for (wanted, w) in aimed.iter().enumerate() {
        let Some(figure) = RecordFigure::of(w.what, &mut harmonic).and_then(|f| asked.place(f)) else { continue };
        let found = b.figures[figure];
        // A settling time is held as an envelope: how far the step leaves it after the limit, in shares of its width.
        let (value, share) = match (w.what, w.side) {
            (What::Settling | What::MoveSettling, _) => (found - 1.0, 1.0),
            (_, Side::AtMost) => (w.violation(found), 1.0 / w.limit),
            (_, Side::AtLeast) => (w.violation(found), -1.0 / w.limit),
        };
        let value = if value.is_nan() { f64::INFINITY } else { value };
        rows.push(Row { machine, wanted, w_rad_s: 0.0, value, moves: Moves::Record { figure, share } });
    }
}
