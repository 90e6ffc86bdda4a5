//! Which named law a torque over position and velocity is most like: one of the speed, whose strength changes along the stroke.
//!
//! In: a surface in its plain form. Out: the law, the share of the surface that it holds, where it is strongest and how the directions
//! differ. The strength is a parabola over the position in each direction, beside what a linear plant could hold.

use super::gauge::Plain;
use super::likeness::{KINKS, Likeness, fitted, weaker};
use crate::diagnose::rules::CURVE_LIKE;
use crate::numeric::digits::said;
use crate::physics::{Facts, aerodynamic_drag, coulomb_friction};

/// A law of the speed, -1 to 1 over the speeds that were seen.
struct Drag {
    facts: &'static Facts,
    words: &'static str,
    /// Share of the largest speed within which dry friction turns; none of a drag of the air.
    turn: Option<f64>,
}

impl Drag {
    fn at(&self, v: f64) -> f64 {
        self.turn.map_or(-v * v.abs(), |turn| -(v / turn).tanh())
    }
}

/// Positions at which strengths are compared, and the share of the samples that may lie beyond the first or the last of them.
const LOOKED: usize = 9;
const SELDOM: f64 = 0.03;

fn drags() -> impl Iterator<Item = Drag> {
    let dry = KINKS.map(|s| Drag { facts: &coulomb_friction::FACTS, words: "dry friction", turn: Some(s) });
    let air = Drag { facts: &aerodynamic_drag::FACTS, words: "drag of the air", turn: None };
    dry.into_iter().chain([air])
}

/// How many shares from an end on hold few samples.
fn seldom<'a>(shares: impl Iterator<Item = &'a f64>) -> usize {
    let sums = shares.scan(0.0, |sum, s| {
        *sum += s;
        Some(*sum)
    });
    sums.take_while(|sum| *sum < SELDOM).count()
}

/// Between which positions the machine was, but for few samples.
fn often(c: &Plain) -> [f64; 2] {
    let share: Vec<f64> = c.weight.chunks(c.knots.velocity.len()).map(|w| w.iter().sum()).collect();
    [c.knots.at[seldom(share.iter())], c.knots.at[share.len() - 1 - seldom(share.iter().rev())]]
}

/// The law that the surface is most like; the unit is that of positions.
pub(in crate::diagnose) fn surface_likeness(c: &Plain, unit: &str) -> Likeness {
    let [low, high] = c.knots.ends();
    let speed = c.knots.velocity.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let along = |x: f64| (2.0 * x - low - high) / (high - low);
    let column = |of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        (0..c.knots.count()).map(|i| c.knots.place(i)).map(|[x, v]| of(along(x), v / speed)).collect()
    };
    let plane = || vec![column(&|_, _| 1.0), column(&|x, _| x), column(&|_, v| v)];
    let (_, whole) = fitted(&c.value, &plane(), &c.weight);
    let mut best: Option<(f64, Drag, Vec<f64>)> = None;
    for drag in drags() {
        let mut columns = plane();
        for up in [true, false] {
            let side = |v: f64| if (v > 0.0) == up { drag.at(v) } else { 0.0 };
            columns.extend([0, 1, 2].map(|power| column(&|x, v| x.powi(power) * side(v))));
        }
        let (shares, left) = fitted(&c.value, &columns, &c.weight);
        if shares.iter().all(|s| s.is_finite()) && best.as_ref().is_none_or(|b| left < b.0) {
            best = Some((left, drag, shares));
        }
    }
    let Some((left, drag, shares)) = best else { return Likeness::none() };
    let share = if whole > 0.0 { 1.0 - left / whole } else { 0.0 };
    if share < CURVE_LIKE {
        return Likeness::far(drag.facts, drag.words, share);
    }
    let percent = 100.0 * share;
    let strength = |side: &[f64], x: f64| side[0] + along(x) * (side[1] + along(x) * side[2]);
    let [first, last] = often(c);
    let at = (0..LOOKED).map(|k| first + (last - first) * k as f64 / (LOOKED - 1) as f64);
    let mean = |x: f64| 0.5 * (strength(&shares[3..6], x) + strength(&shares[6..], x));
    let places: Vec<(f64, f64)> = at.map(|x| (x, mean(x))).collect();
    let most = places.iter().copied().fold(places[0], |m, p| if p.1 > m.1 { p } else { m });
    let least = places.iter().copied().fold(places[0], |m, p| if p.1 < m.1 { p } else { m });
    let [x, near] = [most.0, least.0].map(|x| format!("{} {unit}", said(x, 3)));
    let mut says = match most.1 / least.1 {
        ratio if ratio > 0.0 && most.1 > 0.0 => {
            format!("like {} that is {ratio:.1} times as strong at {x} as at {near}", drag.words)
        }
        _ => format!("like {} that is strongest at {x} and fades out towards {near}", drag.words),
    };
    let level = |side: &[f64]| places.iter().map(|p| strength(side, p.0)).sum::<f64>();
    if let Some(text) = weaker(level(&shares[3..6]) / level(&shares[6..]), ["going up", "going down"]) {
        says += &format!(" and {text}");
    }
    says += &format!("; that shape holds {percent:.0} % of the curve");
    Likeness { effect: drag.facts.name, share, even: false, says }
}
