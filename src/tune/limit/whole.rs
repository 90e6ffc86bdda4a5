//! The best that the whole structure of PID, low-passes and notches could do: a global search with a bound over all its numbers.
//!
//! In: a machine, a controller that says what stays (dampings, feed-forward, filters beyond the searched ones), a spec with its bounds. Out: a value that no numbers
//! between the bounds reach below while they meet the demands, and what was left open. Method: branch and bound ([`super::branch`]); boxes are
//! cut and narrowed by [`super::admitted`] and bounded by [`super::floor`].

use super::admitted::Admitted;
use super::branch::{Ending, search};
use super::floor::{Floor, FloorWork};
use super::gains::lasting;
use super::structure::{NumberBox, Structure};
use crate::controller::Controller;
use crate::feedback::LoopOnGrid;
use crate::tune::{Machine, Spec, TuneError};
use serde::{Deserialize, Serialize};

/// How long is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureSettings {
    /// Boxes looked at, at most.
    pub boxes: usize,
    /// Ends where the bound is this near to the controller, as a share.
    pub near: f64,
}

impl Default for StructureSettings {
    fn default() -> Self {
        StructureSettings { boxes: 60_000, near: 0.01 }
    }
}

/// What a controller could still gain by any numbers of its structure. Figures by the spectrum, with the way back later than in tuning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StructureBound {
    /// No numbers between the spec's bounds have a smaller weighted sum and meet its demands.
    pub objective: f64,
    /// The weighted sum of the controller itself.
    pub own: f64,
    /// Whether the controller itself lies between the bounds and meets the demands: otherwise the bound does not speak of it.
    pub member: bool,
    /// Boxes looked at.
    pub boxes: usize,
    /// Boxes left open at the end: 0 where the search came to its end.
    pub left: usize,
}

/// How many times later the way back comes than in tuning: slow loops forget in between.
const LASTING: f64 = 2.0;
/// Where what a number moves counts when a box is parted (Hz): the crossovers and the bands.
const COUNTS_HZ: [f64; 2] = [150.0, 3500.0];
/// Frequencies looked at there, about.
const LOOKS: usize = 40;
/// Boxes that move ln L by more, and whose bound by magnitudes is below this share of the controller's own value, are too wide for the other bounds to say more.
const WIDE: f64 = 0.8;
const SHARE: f64 = 0.5;

/// A box, and the coordinate that is parted next.
type Parted = (NumberBox, usize);

/// Bounds what all numbers of a controller's structure together could do on a machine.
pub fn structure_bound(
    machine: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
    settings: &StructureSettings,
) -> Result<StructureBound, TuneError> {
    let (curve, write) = lasting(machine, controller, spec, LASTING)?;
    let structure = Structure::of(spec, controller);
    let n = structure.numbers();
    let admitted = Admitted::new(&structure, &spec.margins, curve.sampled());
    let looks = admitted.looks(COUNTS_HZ, LOOKS);
    let crossing = structure.whole().last().map_or(&[][..], |range| admitted.crossings(*range)).to_vec();
    let floor = Floor::new(&structure, spec, &write, crossing, admitted.reach());
    let mut work = FloorWork::default();
    let own = floor.own(controller, &mut work);
    let member = structure.point(controller).is_some_and(|mut x| {
        admitted.narrowed(&mut x, &mut LoopOnGrid::default())
            && floor.look(&x, &mut work)
            && floor.by_straight(n, true, &mut work).is_finite()
    });
    // The coordinate that moves the loop most, and how far all together move it.
    let spread = |b: &NumberBox| {
        let moved = structure.moved(&looks, b);
        let widest = (0..b.len()).max_by(|i, j| moved[*i].total_cmp(&moved[*j])).unwrap_or(0);
        (widest, moved.iter().sum::<f64>() / looks.len().max(1) as f64)
    };
    let halved = |(b, widest): &Parted| {
        let middle = 0.5 * (b[*widest][0] + b[*widest][1]);
        let (mut low, mut high) = (b.clone(), b.clone());
        (low[*widest][1], high[*widest][0]) = (middle, middle);
        [(low, 0), (high, 0)]
    };
    let enough = if member { own * (1.0 - settings.near) } else { f64::INFINITY };
    let judge = |parent: f64, (mut b, _): Parted| {
        let mut work = FloorWork::default();
        if !admitted.narrowed(&mut b, &mut LoopOnGrid::default()) || !floor.look(&b, &mut work) {
            return None;
        }
        let mut bound = parent.max(floor.by_magnitude(true, &work));
        let (widest, moved) = spread(&b);
        if bound < enough && (bound > SHARE * own || moved < WIDE) {
            bound = bound.max(floor.by_logarithm(n, &work));
            bound = if bound < enough { bound.max(floor.by_straight(n, true, &mut work)) } else { bound };
        }
        bound.is_finite().then_some((bound, (b, widest), f64::INFINITY))
    };
    let whole = structure.whole().clone();
    let (first, _) = spread(&whole);
    let ending = Ending { boxes: settings.boxes, near: settings.near };
    let found = search((whole, first), member.then_some(own), &ending, halved, judge);
    Ok(StructureBound { objective: found.bound, own, member, boxes: found.boxes, left: found.left })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::feedback::{ModelLoop, margins};
    use crate::lti::{DiscretePlant, Plant, PlantFile};
    use crate::numeric::random::Random;
    use crate::pes::{Noise, PesClock, Profile, Spiral};
    use crate::tune::{Limits, MarginLimits, Search};
    use std::f64::consts::TAU;

    const PLANT: &str = include_str!("../../../specs/machines/healthy.toml");

    fn spec() -> Spec {
        let noise = Noise { encoder_rms: 0.003, windage_rms: 2e-4, windage_corner_hz: 60.0, ..Noise::default() };
        let spiral =
            Spiral { velocity: 350.0, distance: 15.0, acceleration_time_s: 2e-3, start_s: 8e-3, duration_s: 0.06 };
        Spec {
            profile: Profile { spiral, pes: PesClock { sample_rate_hz: 27_480.0, window: [200, 300] }, noise },
            margins: MarginLimits {
                phase_margin_deg: Some(30.0),
                gain_margin_db: Some(5.0),
                max_sensitivity: Some(2.8),
                gain_crossover_hz: Some([350.0, 1000.0]),
            },
            limits: Limits::default(),
            search: Search { seed: 1, notches: 1, lowpasses: 1, ..Search::default() },
        }
    }

    #[test]
    fn no_point_of_a_box_that_meets_the_demands_is_cut_or_lies_below_its_floor() {
        let text = include_str!("../../../specs/controllers/nominal.toml");
        let c: Controller = crate::document::parse_toml(std::path::Path::new("controller"), text).unwrap();
        let spec = spec();
        let file: PlantFile = crate::document::parse_toml(std::path::Path::new("plant"), PLANT).unwrap();
        let plant = Plant::try_from(file).unwrap();
        let (curve, write) = lasting(&Machine::Model(&plant), &c, &spec, 1.0).unwrap();
        let sampled = DiscretePlant::of(&plant, c.sample_time_s).unwrap();
        let structure = Structure::of(&spec, &c);
        let (n, whole) = (structure.numbers(), structure.whole().clone());
        let admitted = Admitted::new(&structure, &spec.margins, curve.sampled());
        let floor = Floor::new(&structure, &spec, &write, admitted.crossings(whole[n]).to_vec(), admitted.reach());
        let (mut work, mut on, mut r) = (FloorWork::default(), LoopOnGrid::default(), Random::new(11));
        let (mut met, mut told) = (0, [0; 3]);
        let start = structure.anywhere(&c);
        for i in 0..4000 {
            // A point near a loop that works, and a box from small to wide around it with the point anywhere inside.
            let width = [0.02, 0.1, 0.4, 1.5][i % 4];
            let point: NumberBox =
                (0..n).map(|j| [(start[j][0] + 0.15 * r.normal()).clamp(whole[j][0], whole[j][1]); 2]).collect();
            let mut b: NumberBox = (0..n)
                .map(|j| {
                    let (x, wide) = (point[j][0], width * r.uniform());
                    let from = x - wide * r.uniform();
                    [from.max(whole[j][0]), (from + wide).clamp(x, whole[j][1].max(x))]
                })
                .collect();
            let candidate = structure.controller(&point);
            let sections = candidate.sections().unwrap();
            let m = margins(&ModelLoop::new(&sampled, &sections).unwrap());
            let Some(hz) = m.gain_crossover_hz.filter(|hz| (350.0..=1000.0).contains(hz)) else { continue };
            let good = m.stable
                && m.max_sensitivity <= 2.8
                && m.phase_margin_deg.is_some_and(|x| x >= 30.0)
                && m.gain_margin_db.is_none_or(|x| x >= 5.0);
            let inside = structure.point(&candidate).is_some();
            if !good || !inside {
                continue;
            }
            met += 1;
            let at = (hz * TAU).ln();
            b.push([at - 0.2 * r.uniform(), at + 0.2 * r.uniform()]);
            let own = floor.own(&candidate, &mut work);
            assert!(admitted.narrowed(&mut b, &mut on), "{b:?} is cut with {candidate:?}");
            let slack = 1e-6;
            assert!(b.iter().zip(&point).all(|(b, p)| p[0] > b[0] - slack && p[0] < b[1] + slack), "{b:?} {point:?}");
            assert!(floor.look(&b, &mut work), "{b:?} holds {candidate:?}");
            let found =
                [floor.by_magnitude(true, &work), floor.by_logarithm(n, &work), floor.by_straight(n, true, &mut work)];
            for (found, told) in found.iter().zip(&mut told) {
                assert!(*found <= own * (1.0 + 1e-9), "{found} above {own}: {b:?} {candidate:?}");
                *told += usize::from(*found > 0.5 * own);
            }
        }
        // Each way says something of some boxes; this write is mostly the move, of which the two ways by noise know nothing.
        assert!(met > 500 && told.iter().all(|t| *t > 20), "{met} {told:?}");
    }
}
