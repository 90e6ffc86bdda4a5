//! Every requirement of a spec with what is proved of it.
//!
//! In: the loop's bounds, the write's figures and their bounds over the box. Out: a verdict for each limit; a figure of which no bound is computed is not
//! proved. Spec: `specs/certificate.md`.

use super::VerifySettings;
use super::bounds::{BoundedFigure, LoopBounds, ProvenCrossing, Stability};
use super::case_proof::{LimitVerdict, ProvenLimit};
use super::curve::{bound_bandwidth, bound_curve};
use super::model::Enclosed;
use super::write::WriteFigures;
use super::write_box::{BoxFigure, WriteBox};
use crate::tune::{Requirement, Side, Spec, What};

/// Rounding of a member's write, in that of the plant as it stands.
const MEMBERS: f64 = 10.0;

/// Share of a limit by which it may be missed: a search that ends on a limit stands on it, and no bound of finite width lies on
/// the right side of a point.
const TOUCH: f64 = 1e-4;

/// Where every gain crossing outside these ranges (Hz) may lie. One that only may be counts on the side where it would miss.
fn every_crossing(b: &LoopBounds, stabilised: &[[f64; 2]]) -> BoundedFigure {
    let free = |c: &&ProvenCrossing| !stabilised.iter().any(|[from, to]| *from <= c.hz.low && c.hz.high <= *to);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for c in b.gain_crossings.iter().filter(free) {
        (low, high) = (low.min(c.hz.low), high.max(c.hz.high));
    }
    if low <= high { BoundedFigure { low: Some(low), high: Some(high), hz: None } } else { BoundedFigure::default() }
}

/// What is proved of one machine.
pub(super) struct Known<'a> {
    pub bounds: &'a LoopBounds,
    /// Ratios to the spec's curves, and the bandwidth.
    pub magnitudes: &'a Magnitudes,
    /// Whether the machine is a model: of a sweep nothing is known beyond its ends.
    pub model: bool,
    pub write: Option<&'a WriteFigures>,
    pub write_box: Option<&'a WriteBox>,
    /// Overshoot (%), settling time (s) and the command's rms under the disturbance; an end without a number where a box is asked for.
    pub step: [BoundedFigure; 2],
    /// Beyond the end of the move (position_unit), and the settling time after it (s).
    pub at_end: [BoundedFigure; 2],
    pub command_rms: BoundedFigure,
}

/// Bounds of magnitudes over frequency.
#[derive(Clone, Debug, Default)]
pub(super) struct Magnitudes {
    /// In the order of the spec's curves.
    pub curves: Vec<BoundedFigure>,
    pub bandwidth_hz: BoundedFigure,
}

impl Magnitudes {
    /// Those that the spec asks for.
    pub fn of(l: &impl Enclosed, spec: &Spec, settings: &VerifySettings) -> Magnitudes {
        let curves = spec.limits.curve.iter().map(|c| bound_curve(l, c, settings)).collect();
        let asked = spec.margins.bandwidth_hz.is_some();
        let bandwidth_hz = if asked { bound_bandwidth(l, settings) } else { BoundedFigure::default() };
        Magnitudes { curves, bandwidth_hz }
    }
}

pub(super) fn proven_limits(spec: &Spec, wanted: &[Requirement], known: &Known<'_>) -> Vec<ProvenLimit> {
    let (b, w, over) = (known.bounds, known.write, known.write_box);
    let around = |x: f64, e: f64| BoundedFigure { low: Some(x - e), high: Some(x + e), hz: None };
    // Over a box the lower end stays a member's own, as with the margins: what that member misses is missed. Members round much as the plant does.
    let boxed = |own: BoundedFigure, e: f64, figure: &dyn Fn(&WriteBox) -> Option<BoxFigure>| match over {
        None => own,
        Some(o) => figure(o).map_or(BoundedFigure { high: None, ..own }, |f| BoundedFigure {
            low: own.low.map(|l| l.max(f.seen - MEMBERS * e)),
            high: Some(f.most + MEMBERS * e),
            hz: None,
        }),
    };
    wanted
        .iter()
        .map(|r| {
            let proven = match r.what {
                What::PhaseMargin => b.phase_margin_deg,
                What::GainMargin => b.gain_margin_db,
                What::MaxSensitivity => b.max_sensitivity,
                What::GainCrossover => every_crossing(b, &spec.margins.phase_stabilised_hz),
                What::Bandwidth => known.magnitudes.bandwidth_hz,
                What::Curve { index } => known.magnitudes.curves.get(index).copied().unwrap_or_default(),
                What::Overshoot => known.step[0],
                What::Settling => known.step[1],
                What::MoveOvershoot => known.at_end[0],
                What::MoveSettling => known.at_end[1],
                What::CommandRms if w.is_none() => known.command_rms,
                what => w.map_or(BoundedFigure::default(), |w| match what {
                    What::DftLow => boxed(around(w.dft_low, w.error), w.error, &|o| o.dft_low),
                    What::DftHigh => boxed(around(w.dft_high, w.error), w.error, &|o| o.dft_high),
                    What::Harmonic { k } => w
                        .harmonics
                        .get(k - 1)
                        .map_or(BoundedFigure::default(), |a| boxed(around(*a, w.error), w.error, &|o| o.harmonic(k))),
                    // Over a box no bound of it is computed.
                    What::CommandRms => w.command_rms.map_or(BoundedFigure::default(), |x| {
                        let own = around(x, w.command_error());
                        if over.is_some() { BoundedFigure { high: None, ..own } } else { own }
                    }),
                    _ => boxed(around(w.command_peak, w.command_error()), w.command_error(), &|o| o.command_peak),
                }),
            };
            // Of a sweep nothing is known beyond its ends: a margin without a crossing between them is not proved.
            let margin = matches!(r.what, What::PhaseMargin | What::GainMargin);
            let unlimited = known.model && margin && proven.low.is_none();
            let (good, bad) = match r.side {
                Side::AtLeast => {
                    let least = r.limit - TOUCH * r.limit.abs();
                    (unlimited || proven.low.is_some_and(|x| x >= least), proven.high.is_some_and(|x| x < least))
                }
                Side::AtMost => {
                    let most = r.limit + TOUCH * r.limit.abs();
                    (proven.high.is_some_and(|x| x <= most), proven.low.is_some_and(|x| x > most))
                }
            };
            // A margin of an unstable loop is a number without a meaning.
            let stable = b.stability == Stability::Stable;
            let verdict = match (good && stable, bad || b.stability == Stability::Unstable) {
                (true, _) => LimitVerdict::Proved,
                (_, true) => LimitVerdict::Violated,
                _ => LimitVerdict::NotProved,
            };
            let side = if r.side == Side::AtLeast { "at_least" } else { "at_most" };
            ProvenLimit {
                name: r.what.to_string(),
                side: side.into(),
                required: r.limit,
                unit: r.what.unit().into(),
                proven,
                verdict,
            }
        })
        .collect()
}
