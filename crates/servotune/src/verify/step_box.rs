//! A step or a move over a whole box of parameters: where the position of any member may be at each sample.
//!
//! In: a path of the reference, the plant, its box, the loop's proven Ms over the box. Out: a range of positions for each controller sample, or none. A
//! member's position differs from the middle's by its command's difference over -C; the mathematics is that of the write, `specs/certificate.md`.

use super::contour::{Contour, Entering, Window};
use super::family::{Family, Ranges};
use super::moves::size;
use super::path::{Path, run};
use super::spectrum_box::{Beside, OnCircle};
use super::write_piece::{middle, widest};
use super::{Interval, Uncertainty};
use crate::controller::Controller;
use crate::lti::{Plant, Section};
use nalgebra::Complex;

/// The members whose path is asked for.
#[derive(Clone, Copy)]
pub(super) struct Members<'a> {
    pub plant: &'a Plant,
    pub sections: &'a [Section],
    pub controller: &'a Controller,
    pub uncertainty: &'a Uncertainty,
    /// |S| of no member is above this; none where the box is not proved stable.
    pub max_sensitivity: Option<f64>,
}

/// Share of the path's size that may have turned round the circle.
const TURNED: f64 = 1e-6;
/// What is not linear over a box is small enough at this share of the path's size.
const SMALL: f64 = 1e-3;
/// Boxes looked at, at most.
const BOXES: usize = 64;

/// What every box is asked.
struct Question<'a> {
    members: &'a Members<'a>,
    path: &'a Path,
    family: &'a Family,
    circle: &'a Contour,
    ms: f64,
    /// What has turned round: of the position and of the command.
    turned: [f64; 2],
}

/// One box.
struct Leaf {
    ranges: Ranges,
    tube: Vec<Interval>,
    /// Largest part of the tube that is not linear in the box.
    rest: f64,
    widest: usize,
}

/// Where the position may be at each sample of the path from time 0 on; none where a member may clip its command or nothing is proved.
pub(super) fn tube(m: &Members<'_>, path: &Path) -> Option<Vec<Interval>> {
    let ms = m.max_sensitivity?;
    let t = m.controller.sample_time_s;
    let family = Family::of(&m.plant.paired(), t);
    if !(family.decays() && family.falls() >= 2) {
        return None;
    }
    let ranges = family.ranges(m.uncertainty);
    let entering = Entering {
        sections: m.sections,
        t,
        reference: path.reference.clone(),
        encoder: vec![],
        added: path.added.clone(),
    };
    let travel = path.reference.iter().fold(0.0f64, |a, x| a.max(x.abs()));
    let limit = m.controller.output_limit.unwrap_or(f64::INFINITY);
    let turned = [TURNED * travel, TURNED * limit];
    let end = path.reference.len() as f64 * t;
    // Of two members: |S| is at most Ms, and the error of each is S (reference - P feed-forward).
    let rough = |right: f64| {
        let off = entering.moved(right) + entering.pushed() * family.roughly(right, &ranges);
        [off, entering.most(right)].map(|x| 2.0 * ms * x * (right * end).exp())
    };
    let (points, right) = Contour::wrapped(t, end, &rough, turned)?;
    let circle = Contour::of(&entering, &Window::NONE, points, right, &[]);
    let q = Question { members: m, path, family: &family, circle: &circle, ms, turned };
    let mut leaves = vec![Leaf::of(&q, ranges)?];
    let mut boxes = 1;
    while boxes + 2 <= BOXES {
        let worst = (0..leaves.len()).max_by(|a, b| leaves[*a].rest.total_cmp(&leaves[*b].rest))?;
        if leaves[worst].rest <= SMALL * travel || leaves[worst].ranges.iter().all(|r| r.width() == 0.0) {
            break;
        }
        let parent = leaves.swap_remove(worst);
        let r = parent.ranges[parent.widest];
        let cut = 0.5 * (r.low + r.high);
        let half = |r: Interval| {
            let mut ranges = parent.ranges.clone();
            ranges[parent.widest] = r;
            Leaf::of(&q, ranges)
        };
        let (low, high) = rayon::join(|| half(Interval { high: cut, ..r }), || half(Interval { low: cut, ..r }));
        leaves.extend([low?, high?]);
        boxes += 2;
    }
    let all = leaves.iter().map(|l| &l.tube);
    let hull = all.fold(None, |hull: Option<Vec<Interval>>, tube| {
        Some(hull.map_or_else(|| tube.clone(), |h| h.iter().zip(tube).map(|(a, b)| a.hull(*b)).collect()))
    })?;
    hull.iter().all(|r| r.low.is_finite() && r.high.is_finite()).then_some(hull)
}

fn both(x: f64) -> Interval {
    Interval { low: -x.abs(), high: x.abs() }
}

fn above(x: f64) -> Interval {
    Interval { low: x.min(0.0), high: x.max(0.0) }
}

impl Leaf {
    /// None where a member may clip its command: the loop is linear no more.
    fn of(q: &Question<'_>, ranges: Ranges) -> Option<Leaf> {
        let (m, circle) = (q.members, q.circle);
        let at = middle(&ranges);
        let family = q.family.about(&at);
        let record = run(&q.family.member(&at), m.sections, m.controller, q.path);
        let beside = Beside::of(circle, &Window::NONE, &[], &family, &ranges);
        let on = OnCircle::of(circle, &beside, &family, &ranges, q.ms);
        let n = q.path.reference.len();
        let swell = |k: usize| (circle.right * circle.t * k as f64).exp();
        let whole = !on.cuts.is_empty();
        let weights = if whole { &on.command_rest } else { &on.command_third };
        // Where it may be at each sample: linear parts, the second order where no pair is cut, and what is left.
        let around = |own: &[f64], by: &dyn Fn(usize) -> Complex<f64>, rest: f64, turned: f64| -> Vec<Interval> {
            let mut all: Vec<Interval> = (own.iter().enumerate())
                .map(|(k, x)| (x, rest * swell(k) + turned))
                .map(|(x, h)| Interval { low: x - h, high: x + h })
                .collect();
            let mut add = |series: &dyn Fn(usize) -> Complex<f64>, part: &dyn Fn(f64) -> Interval| {
                let half: Vec<_> = (0..on.command.len()).map(|i| series(i) * by(i)).collect();
                if half.iter().any(|x| x.norm_sqr() > 0.0) {
                    for (r, x) in all.iter_mut().zip(circle.samples(&half, n)) {
                        *r = r.plus(part(x));
                    }
                }
            };
            for (f, aliases) in on.linear.iter().zip(&on.command_linear) {
                add(&|i| on.command[i] * f[i] + if whole { Complex::ZERO } else { aliases[i] }, &both);
            }
            if !whole {
                // A square lies between 0 and 1, a product between -1 and 1.
                for ([i, j], f) in &on.second {
                    add(&|k| on.command[k] * f[k], if i == j { &above } else { &both });
                }
            }
            all
        };
        if let Some(limit) = m.controller.output_limit {
            let rest = 2.0 * weights.iter().sum::<f64>();
            let command = around(&record.command, &|_| Complex::new(1.0, 0.0), rest, q.turned[1]);
            if command.iter().any(|u| !(u.high < limit && u.low > -limit)) {
                return None;
            }
        }
        let weights: Vec<f64> = weights.iter().zip(&circle.law).map(|(w, c)| w / size(*c)).collect();
        let rest = 2.0 * weights.iter().sum::<f64>();
        let mut tube = around(&record.position, &|i| -circle.law[i].inv(), rest, q.turned[0]);
        let sizes: Vec<Vec<f64>> = on.linear.iter().map(|l| l.iter().map(|x| size(*x)).collect()).collect();
        Some(Leaf {
            tube: tube.split_off(q.path.before),
            rest: rest * swell(n),
            widest: widest(&sizes, &|i| weights[i]),
            ranges,
        })
    }
}
