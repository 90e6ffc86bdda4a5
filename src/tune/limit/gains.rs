//! The best PID gains that given filters could have: a global search with a bound.
//!
//! In: a machine, a controller whose filters stay, a spec with its bounds of the gains. Out: a value that no gains of the box reach below, the best
//! seen, and what is left open. Method: branch and bound ([`super::branch`]) over [`super::enclosure`].

use super::branch::{Ending, search};
use super::enclosure::{Cut, Filtered, GainBox};
use crate::controller::Controller;
use crate::feedback::{LoopOnGrid, ResponseCurve};
use crate::frf::Frf;
use crate::lti::{DiscretePlant, FrequencyResponse};
use crate::pes::SpectralPes;
use crate::tune::machine::{bins, curve};
use crate::tune::{Hold, Machine, Spec, TuneError};
use serde::{Deserialize, Serialize};

/// How long is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainsSettings {
    /// Gains are searched from this many times below to this many times above the controller's, within the spec's bounds.
    pub reach: f64,
    /// Boxes looked at, at most.
    pub boxes: usize,
    /// Ends where the bound is this near to the best seen, as a share.
    pub near: f64,
}

impl Default for GainsSettings {
    fn default() -> Self {
        GainsSettings { reach: 1.5, boxes: 20_000, near: 0.01 }
    }
}

/// What a controller could still gain by its three gains alone. All figures by the spectrum, with the way back later than in tuning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GainsBound {
    /// Gains are searched from this many times below to this many times above the controller's.
    pub reach: f64,
    /// No such gains inside the spec's bounds, with these filters, have a smaller weighted sum and meet its demands.
    pub objective: f64,
    /// The weighted sum of the controller itself.
    pub own: f64,
    /// Whether the controller itself meets the demands: otherwise the bound does not speak of it.
    pub member: bool,
    /// The smallest weighted sum of a set of gains that met them, the controller's own included; none where none did.
    pub best: Option<f64>,
    /// Boxes looked at.
    pub boxes: usize,
    /// Boxes left open at the end: 0 where the search came to its end.
    pub left: usize,
}

/// How many times later the way back comes than in tuning: slow loops forget in between.
const LASTING: f64 = 4.0;

/// A machine's response and its write read off it, the model taken as a sweep that resolves it, so that one formula serves both; the way back comes
/// `times` later than in tuning.
pub(super) fn lasting(
    machine: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
    times: f64,
) -> Result<(ResponseCurve, SpectralPes), TuneError> {
    let t = controller.sample_time_s;
    let frf;
    let curve = match machine {
        Machine::Response { frf, hold, continuation } => curve(frf, *hold, *continuation, t)?,
        Machine::Model(plant) => {
            let sampled = DiscretePlant::of(plant, t)?;
            let grid = crate::feedback::SampledPlant::of_model(&sampled);
            let w = grid.w_rad_s().to_vec();
            frf = Frf::new(w.clone(), w.iter().map(|w| sampled.at(*w)).collect(), None)?
                .with_unstable_poles(sampled.unstable_poles());
            curve(&frf, Hold::Included, Some(plant), t)?
        }
    };
    let harmonics: Vec<usize> = spec.limits.harmonics.iter().map(|h| h.k).collect();
    let bins = bins(&spec.profile, &harmonics);
    let write = SpectralPes::lasting(&spec.profile, &curve, controller, bins, false, times)?;
    Ok((curve, write))
}

/// Bounds what the gains of a controller could still do on a machine.
pub fn gains_bound(
    machine: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
    settings: &GainsSettings,
) -> Result<GainsBound, TuneError> {
    let (curve, write) = lasting(machine, controller, spec, LASTING)?;
    let filtered = Filtered::new(spec, controller, curve.sampled(), &write);
    let b = &spec.search.bounds;
    let pid = &controller.pid;
    // The controller's own gains always belong to the box, also where the spec's bounds leave them out.
    let around = |[from, to]: [f64; 2], k: f64| {
        let (low, high) = (k / settings.reach, k * settings.reach);
        [low.max(from).min(k), high.min(to).max(k)]
    };
    let whole: GainBox = [around(b.kp, pid.kp), around(b.ki_per_s, pid.ki_per_s), around(b.kd_s, pid.kd_s)];
    let point = |k: [f64; 3]| k.map(|k| [k, k]);
    let given = point([pid.kp, pid.ki_per_s, pid.kd_s]);
    let met = filtered.cut(&given, &mut LoopOnGrid::default()) == Cut::Open;
    let member = met && filtered.lower(&given, true).is_finite();
    let own = filtered.lower(&given, false);
    let best = member.then_some(own);
    let ending = Ending { boxes: settings.boxes, near: settings.near };
    let judge = |parent: f64, half: GainBox| {
        let mut on = LoopOnGrid::default();
        if filtered.cut(&half, &mut on) == Cut::Out {
            return None;
        }
        let bound = filtered.lower(&half, true).max(parent);
        let middle = point(half.map(|[a, b]| 0.5 * (a + b)));
        let met = bound.is_finite() && filtered.cut(&middle, &mut on) == Cut::Open;
        let value = if met { filtered.lower(&middle, true) } else { f64::INFINITY };
        bound.is_finite().then_some((bound, half, value))
    };
    let found = search(whole, best, &ending, |b| filtered.halved(b), judge);
    let reach = settings.reach;
    Ok(GainsBound {
        reach,
        objective: found.bound,
        own,
        member,
        best: found.best,
        boxes: found.boxes,
        left: found.left,
    })
}
