//! The whole way from response to result.

use super::body_start::{self, Start};
use super::growth::{self, Joint, Stage, structured};
use super::held_out;
use super::ladder;
use super::noise::local_noise;
use super::result::{BodyEvidence, FitWork, Identified, OrderScore};
use super::shape::{BodyForm, Ranges, Shape};
use super::spread::{Spread, correlation_inflation};
use super::sweep::Sweep;
use super::trust;
use super::{BodyChoice, IdentifyError, IdentifySettings, ZeroSide};
use crate::frf::{Frf, gathered};
use crate::lti::FrequencyResponse;
use crate::numeric::golden::IntervalEnd;
use crate::numeric::levenberg::Workspace;
use crate::numeric::statistics::{median, nearest_rank, rms};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Steps of the last joint fit and its tolerance: the sum of squares moves by less than its own scatter by far.
const LAST_STEPS: usize = 60;
const LAST_TOLERANCE: f64 = 1e-8;
/// Most bodies from which growth begins.
const STARTS: usize = 3;
/// A deviation of ln ω0 above this (factor 1.6 either way at 95 %) leaves the natural frequency undetermined.
const UNDETERMINED: f64 = 0.25;

/// A plant model from a measured response.
///
/// The joint fit minimises ln(measured / model), log magnitude and phase alike, over the noise deviation of each point;
/// poles are stable by construction. A sweep of more than [`GATHERED_ABOVE`](crate::frf::GATHERED_ABOVE) points is gathered first. A hard fit is no error: it shows in the residual, the intervals and the trusted band.
pub fn identify(frf: &Frf, settings: &IdentifySettings) -> Result<Identified, IdentifyError> {
    let long = gathered(frf);
    let sweep = Sweep::new(long.as_ref().map_or(frf, |g| &g.frf), settings)?;
    let n = sweep.len();
    let ranges = ranges(&sweep, settings);
    let steps = ladder::build(&sweep, settings);
    let mut memory = Workspace::default();
    let starts = body_start::find(&sweep, settings, steps.as_ref(), ranges, &mut memory);
    let work = FitWork { linear_fits: steps.as_ref().map_or(0, |l| l.fits), ..FitWork::default() };
    let mut joint = Joint { sweep: &sweep, target: vec![], weight: levelled(&sweep), ranges, memory, work };
    let Climb { start, stages, last, .. } = Climb::best(&mut joint, starts, settings);
    joint.target = sweep.value.iter().map(|v| v * start.sign).collect();
    let (chosen, held_out) = choose(&stages, last, joint.weight[0]);
    let Stage { mut shape, mut x, .. } = stages[chosen].clone();
    joint.weight = match &sweep.relative_std {
        // The file's deviation is that of the complex value: each part has 1/√2 of it.
        Some(s) => s.iter().map(|s| std::f64::consts::SQRT_2 / s).collect(),
        None => local_noise(&joint.ratio(shape, &x)).iter().map(|s| 1.0 / s).collect(),
    };
    let mut out = joint.refine(shape, &mut x, LAST_STEPS, LAST_TOLERANCE);
    let body = settle_body(&mut joint, settings, &mut shape, &mut x, &mut out);
    sort_modes(shape, &mut x);

    let r = joint.linearise(shape, &x);
    let freedom = (2 * n).saturating_sub(shape.parameters()).max(1) as f64;
    let chi_square = r.iter().map(|v| v * v).sum::<f64>() / freedom;
    let inflation = correlation_inflation(&r);
    // Noise that the file states is not made smaller by a lucky fit; noise taken from the data is scaled to the fit.
    let variance = inflation * if sweep.relative_std.is_some() { chi_square.max(1.0) } else { chi_square };
    let mut root = joint.memory.qr.inverse_root();
    root.iter_mut().for_each(|v| *v *= variance.sqrt());
    let (position_unit, command_unit) = (settings.position_unit.clone(), settings.command_unit.clone());
    let spread = Spread { shape, x: x.clone(), root, sign: start.sign, position_unit, command_unit };
    let plant = shape.plant(&x, start.sign, &settings.position_unit, &settings.command_unit);
    plant.check().map_err(IdentifyError::NoPlant)?;

    let residual: Vec<Complex<f64>> = sweep.w.iter().zip(&sweep.value).map(|(&w, v)| plant.at(w) / v - 1.0).collect();
    let size: Vec<f64> = residual.iter().map(|r| r.norm()).collect();
    let mut rungs = steps.as_ref().map_or(vec![], |l| l.rungs.clone());
    rungs.push(ladder::rung("joint refinement", &sweep, &plant));
    let delay = x[shape.delay_at()];
    Ok(Identified {
        intervals: spread.intervals(),
        stepwise_bounds: steps.as_ref().map(|l| (l.delay_bound, l.gain_bound)),
        stepwise: steps.map(|l| l.plant),
        ladder: rungs,
        body,
        delay_bound: if delay <= 0.0 {
            IntervalEnd::Low
        } else if delay >= ranges.delay {
            IntervalEnd::High
        } else {
            IntervalEnd::Inside
        },
        at_bound: at_bound(&joint, shape, &x),
        rms_relative_error: rms(&size),
        p95_relative_error: nearest_rank(&size, 0.95),
        noise_relative_std: joint.weight.iter().map(|w| std::f64::consts::SQRT_2 / w).collect(),
        chi_square,
        correlation_inflation: inflation,
        held_out,
        trusted: trust::band(&sweep.w, &size, sweep.relative_std.as_deref(), settings.trust_limit),
        condition: joint.memory.qr.condition(),
        converged: out.converged,
        work: joint.work,
        gathered_from: long.map(|g| g.points),
        w_rad_s: sweep.w.clone(),
        residual,
        plant,
        spread,
    })
}

/// Where the numbers of a fit may lie.
fn ranges(sweep: &Sweep, settings: &IdentifySettings) -> Ranges {
    let (low, high) = (sweep.w[0], sweep.w[sweep.len() - 1]);
    Ranges {
        // A pair just outside the sweep still bends the response inside it.
        mode: ((0.7 * low).ln(), (1.3 * high).ln()),
        body: ((1e-2 * low).ln(), (1.3 * high).ln()),
        delay: settings.delay_limit_s,
        zero_damping: match settings.zeros {
            ZeroSide::Either => -2.0,
            ZeroSide::Left => 1e-5,
        },
    }
}

/// Weight of each point while modes are missing.
fn levelled(sweep: &Sweep) -> Vec<f64> {
    match &sweep.relative_std {
        // While modes are missing, their absence is the larger error: the deviations are levelled by their median.
        Some(s) => {
            let middle = median(s).unwrap_or(0.0);
            s.iter().map(|s| std::f64::consts::SQRT_2 / s.hypot(middle)).collect()
        }
        None => vec![1.0; sweep.len()],
    }
}

/// One start with all that grew from it.
struct Climb {
    start: Start,
    stages: Vec<Stage>,
    /// The last stage whose pairs stand out from noise.
    last: usize,
    /// Whether more than noise is left there.
    left: bool,
}

impl Climb {
    /// The start from which the fit leaves least.
    fn best(joint: &mut Joint, starts: Vec<Start>, settings: &IdentifySettings) -> Climb {
        let mut starts = starts.into_iter();
        let first = starts.next().unwrap_or_else(|| flat(joint.sweep));
        let mut best = Climb::from(joint, first, settings);
        for start in starts.take(STARTS - 1) {
            // A later start is tried only where the best one has left more than noise.
            if !best.left {
                break;
            }
            let other = Climb::from(joint, start, settings);
            if other.cost() < best.cost() {
                best = other;
            }
        }
        best
    }

    fn from(joint: &mut Joint, mut start: Start, settings: &IdentifySettings) -> Climb {
        body_start::polish(joint.sweep, &mut start, joint.ranges, &mut joint.memory);
        joint.target = joint.sweep.value.iter().map(|v| v * start.sign).collect();
        let (stages, last) = growth::grow(joint, &start, settings);
        let left = structured(&joint.ratio(stages[last].shape, &stages[last].x), &joint.weight);
        Climb { start, stages, last, left }
    }

    fn cost(&self) -> f64 {
        self.stages[self.last].cost
    }
}

/// The last resort: a body at the sweep's middle with its level.
fn flat(sweep: &Sweep) -> Start {
    let w0 = (sweep.w[0] * sweep.w[sweep.len() - 1]).sqrt();
    let level = median(&sweep.value.iter().map(|v| v.norm()).collect::<Vec<_>>()).unwrap_or(0.0);
    let shape = Shape { body: BodyForm::SecondOrder, delay: true, modes: 0 };
    Start { shape, x: vec![level.ln() + 2.0 * w0.ln(), w0.ln(), 0.0, 0.0], sign: sweep.value[0].re.signum() }
}

/// The stage to keep: by held-out errors among those up to `last`, or the last one of a fixed order.
fn choose(stages: &[Stage], last: usize, weight: f64) -> (usize, Vec<OrderScore>) {
    if stages.iter().any(|s| s.held_out.is_empty()) {
        return (last, vec![]);
    }
    let errors: Vec<(usize, Vec<f64>)> = stages.iter().map(|s| (s.shape.modes, s.held_out.clone())).collect();
    // The noise of one part from the stage that follows the data best: median of |e|² = 2 ln 2 σ².
    let deviation = errors
        .iter()
        .map(|(_, e)| (median(e).unwrap_or(0.0) / (2.0 * std::f64::consts::LN_2)).sqrt())
        .fold(f64::INFINITY, f64::min);
    held_out::choose(&errors, last, deviation, 1.0 / weight)
}

/// Decides between a body and a free inertia where the natural frequency lies at or below the sweep.
fn settle_body(
    joint: &mut Joint,
    settings: &IdentifySettings,
    shape: &mut Shape,
    x: &mut Vec<f64>,
    out: &mut crate::numeric::levenberg::LevenbergOutcome,
) -> BodyEvidence {
    let low = joint.sweep.w[0];
    let below = BodyEvidence::BelowSweep { lowest_hz: low / TAU };
    if shape.body == BodyForm::FreeInertia {
        return if settings.body == BodyChoice::Auto { below } else { BodyEvidence::Supported };
    }
    let r = joint.linearise(*shape, x);
    let freedom = r.len().saturating_sub(shape.parameters()).max(1) as f64;
    let chi_square = r.iter().map(|v| v * v).sum::<f64>() / freedom;
    let root = joint.memory.qr.inverse_root();
    let n = shape.parameters();
    let deviation = ((1..n).map(|j| root[j * n + 1].powi(2)).sum::<f64>() * chi_square).sqrt();
    if x[1].exp() >= low {
        return BodyEvidence::Supported;
    }
    // The same pairs on a free inertia: s² + 2 ζ0 ω0 s above ω0.
    let mut free = *shape;
    free.body = BodyForm::FreeInertia;
    let mut y = vec![x[0], 2.0 * x[2].exp() * x[1].exp()];
    y.extend_from_slice(&x[3..]);
    let other = joint.refine(free, &mut y, LAST_STEPS, LAST_TOLERANCE);
    let rows = r.len() as f64;
    // One parameter more must lower the information criterion; if it does, the natural frequency shows although it lies below.
    let needed = rows * (other.cost / out.cost).ln() > rows.ln();
    if needed && deviation <= UNDETERMINED {
        return BodyEvidence::Supported;
    }
    if !needed && settings.body == BodyChoice::Auto {
        (*shape, *x, *out) = (free, y, other);
    }
    below
}

/// Pairs in order of their pole.
fn sort_modes(shape: Shape, x: &mut [f64]) {
    let from = shape.mode_at(0);
    let mut modes: Vec<[f64; 4]> = x[from..].chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
    modes.sort_by(|a, b| a[2].total_cmp(&b[2]));
    for (to, m) in x[from..].chunks_exact_mut(4).zip(&modes) {
        to.copy_from_slice(m);
    }
}

/// Names of the parameters on an end of their range.
fn at_bound(joint: &Joint, shape: Shape, x: &[f64]) -> Vec<String> {
    use super::shape::{LogFit, LogProblem};
    use crate::numeric::levenberg::Residuals;
    let (w, target, weight) = (&joint.sweep.w[..], &joint.target[..], &joint.weight[..]);
    let problem = LogProblem::new(LogFit { shape, w, target, weight, ranges: joint.ranges });
    (1..x.len())
        .filter(|&i| {
            let l = problem.limit(i);
            x[i] <= l.low || x[i] >= l.high
        })
        .map(|i| match i {
            _ if i == shape.delay_at() => "plant.delay_s".to_string(),
            1 if shape.body == BodyForm::SecondOrder => "plant.natural_frequency_rad_s".to_string(),
            1 => "plant.viscous_rate_per_s".to_string(),
            2 => "plant.damping_ratio".to_string(),
            _ => {
                let (m, k) = ((i - shape.mode_at(0)) / 4, (i - shape.mode_at(0)) % 4);
                let key = ["zero_rad_s", "zero_damping_ratio", "pole_rad_s", "pole_damping_ratio"][k];
                format!("plant.modes[{m}].{key}")
            }
        })
        .collect()
}
