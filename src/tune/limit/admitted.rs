//! Which boxes of numbers hold no loop that meets the demands on margins, and which part of the others can.
//!
//! On the grid of the search: between two neighbouring points magnitude and phase are taken to stay between those at them.

use super::span::Span;
use super::structure::{NumberBox, Numbers, Place, Structure};
use crate::feedback::{LoopOnGrid, SampledPlant};
use crate::tune::parameters::chain_of;
use crate::tune::spec::MarginLimits;
use std::f64::consts::{LN_10, PI, TAU};

/// The demands on one machine.
#[derive(Clone, Debug)]
pub(super) struct Admitted<'a> {
    structure: &'a Structure,
    margins: &'a MarginLimits,
    grid: SampledPlant,
    places: Vec<Place>,
    /// Phase that a crossing keeps at least from the negative real axis (rad): phase margin, or what Ms asks of one.
    reach: f64,
    /// Whether a crossing is demanded.
    crossing: bool,
}

/// Rounding that a demand may be missed by, as a share.
const ROUNDING: f64 = 1e-6;

impl<'a> Admitted<'a> {
    pub fn new(structure: &'a Structure, margins: &'a MarginLimits, grid: SampledPlant) -> Admitted<'a> {
        let by_phase = margins.phase_margin_deg.map_or(0.0, f64::to_radians);
        // |1 + L| = 2 sin(margin/2) at a crossing.
        let by_peak = margins.max_sensitivity.map_or(0.0, |ms| 2.0 * (0.5 / ms).asin());
        let places = structure.places(&grid);
        Admitted {
            structure,
            margins,
            grid,
            places,
            reach: by_phase.max(by_peak) * (1.0 - ROUNDING),
            crossing: margins.gain_crossover_hz.is_some(),
        }
    }

    /// Phase that a crossing keeps at least from the negative real axis (rad).
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// About `count` places from and to these frequencies.
    pub fn looks(&self, [from_hz, to_hz]: [f64; 2], count: usize) -> Vec<Place> {
        let inside = self.places.iter().filter(|p| p.w > from_hz * TAU && p.w < to_hz * TAU);
        let step = inside.clone().count() / count;
        inside.step_by(step.max(1)).copied().collect()
    }

    /// The places where a crossing is demanded, a step beyond either end.
    pub fn crossings(&self, [from, to]: [f64; 2]) -> &[Place] {
        let first = self.places.partition_point(|p| p.w.ln() < from).saturating_sub(1);
        let last = (self.places.partition_point(|p| p.w.ln() < to) + 1).min(self.places.len());
        if self.crossing { &self.places[first..last] } else { &[] }
    }

    /// Narrows a box to the levels of the loop that put a crossing into its range; false where no loop of the box meets the demands.
    pub fn narrowed(&self, b: &mut NumberBox, on: &mut LoopOnGrid) -> bool {
        if !self.structure.inside(b) {
            return false;
        }
        let numbers = Numbers::of(b);
        let mut spans: Vec<Span> = self.places.iter().map(|p| self.structure.span(p, &numbers)).collect();
        if self.crossing {
            let range = b.last().map_or([0.0; 2], |x| x.map(f64::exp));
            let Some(level) = self.levels(&spans, range) else { return false };
            b[0] = [b[0][0].max(level[0] - ROUNDING), b[0][1].min(level[1] + ROUNDING)];
            if b[0][0] > b[0][1] || !self.structure.inside(b) {
                return false;
            }
        }
        let level = Span { ln: b[0], phase: [0.0; 2] };
        spans.iter_mut().for_each(|s| *s = s.times(level));
        let least = self.margins.max_sensitivity.map_or(0.0, |ms| (1.0 - ROUNDING) / (ms * ms));
        let mut touched = false;
        for s in &spans {
            let [near, far] = s.distance();
            if far < least {
                return false;
            }
            touched |= near <= 0.0;
        }
        if spans.windows(2).any(|p| self.margin_missed(p[0], p[1])) {
            return false;
        }
        touched || self.stable(b, on)
    }

    /// From where to where ln kp puts |L| = 1 into the range of the crossover at a phase that the demands allow.
    fn levels(&self, spans: &[Span], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
        let mut level: Option<[f64; 2]> = None;
        for (p, s) in self.places.windows(2).zip(spans.windows(2)) {
            if p[1].w < low || p[0].w > high {
                continue;
            }
            let both = s[0].hull(s[1]);
            if !both.near_negative(self.reach) {
                let [from, to] = level.unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
                level = Some([from.min(-both.ln[1]), to.max(-both.ln[0])]);
            }
        }
        level
    }

    /// Whether every loop has a crossing between two neighbouring points of the grid that misses phase or gain margin.
    fn margin_missed(&self, a: Span, b: Span) -> bool {
        let falls = a.ln[0] > 0.0 && b.ln[1] < 0.0;
        let rises = a.ln[1] < 0.0 && b.ln[0] > 0.0;
        if (falls || rises) && a.hull(b).near_negative(self.reach) {
            return true;
        }
        let Some(wanted) = self.margins.gain_margin_db else { return false };
        let room = wanted * (1.0 - ROUNDING) * LN_10 / 20.0;
        let between = |from: f64, to: f64| {
            let turn = ((0.5 * (from + to) - PI) / TAU).round() * TAU + PI;
            from < turn && turn < to
        };
        let passes = between(a.phase[1], b.phase[0]) || between(b.phase[1], a.phase[0]);
        let both = a.hull(b).ln;
        passes && both[0] > -room && both[1] < room
    }

    /// Where no loop of the box touches -1 all are as stable as the one in its middle.
    fn stable(&self, b: &NumberBox, on: &mut LoopOnGrid) -> bool {
        let mut chain = Vec::new();
        if !chain_of(&self.structure.controller(b), &mut chain) {
            return true;
        }
        self.grid.judge(&chain, on);
        on.quick.unstable_poles == 0
    }
}
