//! Identification from a neighbour: the joint fit alone, started from the plant of a machine of the same kind.
//!
//! In: a response, plants of machines that were identified in full. Out: [`Near`], or none where the neighbours are too far off for the fit to
//! follow; then [`identify`](super::identify) starts from nothing. The order is the neighbour's. Spec: `specs/identification.md`.

use super::growth::Joint;
use super::noise::local_noise;
use super::shape::{LogFit, Ranges, Shape};
use super::spread::{Spread, correlation_inflation};
use super::sweep::Sweep;
use super::{FitWork, IdentifyError, IdentifySettings, ZeroSide};
use crate::frf::{Frf, gathered};
use crate::lti::{Body, FrequencyResponse, Plant};
use crate::numeric::levenberg::Workspace;

/// A plant that was fitted from a neighbour's.
#[derive(Clone, Debug)]
pub struct Near {
    /// The plant.
    pub plant: Plant,
    /// Which neighbour it started from.
    pub neighbour: usize,
    /// Root mean square of |model / measured - 1|.
    pub rms_relative_error: f64,
    /// Reduced chi square under the noise found in the data; 1 where model and noise account for everything.
    pub chi_square: f64,
    spread: Spread,
}

/// Points on which neighbours are compared at most.
const COMPARED: usize = 60;
/// Steps of the fit before and after the noise is known, and the tolerance: a share of chi square far below its own scatter.
const STEPS: usize = 12;
const LAST_STEPS: usize = 8;
const TOLERANCE: f64 = 1e-4;
/// Chi square above which something stands in the response that the neighbour does not have.
const STRANGE: f64 = 1.6;

/// The plant nearest to a neighbour's, `None` where the residual has structure that no neighbour explains.
pub fn identify_near(
    frf: &Frf,
    neighbours: &[Plant],
    settings: &IdentifySettings,
) -> Result<Option<Near>, IdentifyError> {
    let long = gathered(frf);
    let sweep = Sweep::new(long.as_ref().map_or(frf, |g| &g.frf), settings)?;
    let n = sweep.len();
    let (low, high) = (sweep.w[0], sweep.w[n - 1]);
    let ranges = Ranges {
        mode: ((0.7 * low).ln(), (1.3 * high).ln()),
        body: ((1e-2 * low).ln(), (1.3 * high).ln()),
        delay: settings.delay_limit_s,
        zero_damping: if settings.zeros == ZeroSide::Left { 1e-5 } else { -2.0 },
    };
    // Far off in gain alone is near: the level is taken out before neighbours are compared.
    let distance = |p: &Plant| -> f64 {
        let some = sweep.w.iter().zip(&sweep.value).step_by(n.div_ceil(COMPARED));
        let logs: Vec<f64> = some.map(|(&w, v)| (v / p.at(w)).norm().ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        logs.iter().map(|l| (l - mean).powi(2)).sum()
    };
    let ranked = neighbours.iter().enumerate().filter(|(_, p)| !matches!(p.body, Body::Rational(_)));
    let ranked = ranked.map(|(i, p)| (distance(p), i));
    let Some((_, neighbour)) =
        ranked.filter(|(d, _)| d.is_finite()).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    else {
        return Ok(None);
    };
    let (shape, mut x) = Shape::of(&neighbours[neighbour]);
    if 2 * n <= shape.parameters() {
        return Ok(None);
    }
    let sign = (neighbours[neighbour].body.acceleration_gain() * neighbours[neighbour].resonance_gain).signum();
    let weight = sweep.relative_std.as_ref().map(|s| s.iter().map(|s| std::f64::consts::SQRT_2 / s).collect());
    let known = weight.is_some();
    let target = sweep.value.iter().map(|v| v * sign).collect();
    let mut joint = Joint {
        sweep: &sweep,
        target,
        weight: weight.unwrap_or_else(|| vec![1.0; n]),
        ranges,
        memory: Workspace::default(),
        work: FitWork::default(),
    };
    joint.refine(shape, &mut x, STEPS, TOLERANCE);
    if !known {
        joint.weight = local_noise(&joint.ratio(shape, &x)).iter().map(|s| 1.0 / s).collect();
        // Even noise is one weight for all points, which moves nothing.
        if joint.weight.iter().any(|w| *w != joint.weight[0]) {
            joint.refine(shape, &mut x, LAST_STEPS, TOLERANCE);
        }
    }
    let r = joint.linearise(shape, &x);
    let freedom = (2 * n - shape.parameters()) as f64;
    let chi_square = r.iter().map(|v| v * v).sum::<f64>() / freedom;
    if !chi_square.is_finite() || chi_square > STRANGE {
        return Ok(None);
    }
    let inflation = correlation_inflation(&r);
    let variance = inflation * if known { chi_square.max(1.0) } else { chi_square };
    let mut root = joint.memory.qr.inverse_root();
    root.iter_mut().for_each(|v| *v *= variance.sqrt());
    let (position_unit, command_unit) = (settings.position_unit.clone(), settings.command_unit.clone());
    let plant = shape.plant(&x, sign, &position_unit, &command_unit);
    plant.check().map_err(IdentifyError::NoPlant)?;
    let ratio = {
        let fit = LogFit { shape, w: &sweep.w, target: &joint.target, weight: &joint.weight, ranges };
        let mut out = Vec::new();
        fit.ratio(&x, &mut out);
        out
    };
    let square: f64 = ratio.iter().map(|q| (1.0 / q - 1.0).norm_sqr()).sum();
    let spread = Spread { shape, x, root, sign, position_unit, command_unit };
    let rms_relative_error = (square / n as f64).sqrt();
    Ok(Some(Near { plant, neighbour, rms_relative_error, chi_square, spread }))
}

impl Near {
    /// `n` plants drawn from the estimate's normal distribution, as [`Identified::sample_plants`](super::Identified::sample_plants).
    pub fn sample_plants(&self, n: usize, seed: u64) -> Vec<Plant> {
        self.spread.sample(n, seed)
    }
}
