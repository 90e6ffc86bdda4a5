//! `limit`: the programme of a machine, solved in rounds of cuts; and the figures of given gains beside it.

use super::cone::{Answer, Programme};
use super::cuts::{Cut, cuts, sensitivity};
use super::energy::{Energy, correlated};
use super::horizon::{Bin, Horizon};
use super::taps::{energies, taps};
use super::{LimitError, LimitPlant};
use crate::controller::{Controller, Feedforward};
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ};
use crate::tune::{Spec, bench};
use serde::{Deserialize, Serialize};

/// How hard the bound is driven up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitSettings {
    /// Rounds of cuts at most; the bound of every round is one.
    pub rounds: usize,
    /// Cuts added in a round at most.
    pub cuts: usize,
    /// Ends where the Toeplitz norm is within this share of Ms.
    pub tolerance: f64,
}

impl Default for LimitSettings {
    fn default() -> Self {
        LimitSettings { rounds: 12, cuts: 60, tolerance: 2e-3 }
    }
}

/// Expected DFT norms of the window, noise by its expected power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Norm over 600 to 1500 Hz (position_unit).
    pub dft_low: f64,
    /// Norm over 1500 to 3000 Hz (position_unit).
    pub dft_high: f64,
    /// Weighted sum of both, as tuning minimises it.
    pub objective: f64,
}

/// Whether any linear controller can meet the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing speaks against it.
    Open,
    /// Proven: no linear controller meets Ms, effort and DFT limits together.
    Impossible,
}

/// The limit of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// No linear controller that keeps Ms and effort has a smaller weighted sum; 0 where even the relaxation is infeasible.
    pub objective: f64,
    /// Where the programme's own optimum lies: the bound is at most this.
    pub at: Figures,
    /// No linear controller that keeps Ms and effort has a smaller `dft_low`, whatever its `dft_high`.
    pub dft_low: f64,
    /// No linear controller that keeps Ms and effort has a smaller `dft_high`, whatever its `dft_low`.
    pub dft_high: f64,
    /// Can the limits of the spec be met at all?
    pub verdict: Verdict,
    /// Ms that was demanded; none where the spec has none.
    pub max_sensitivity: Option<f64>,
    /// Toeplitz norm at the last point: how nearly the cuts stand for |S| <= Ms.
    pub norm_reached: f64,
    /// Taps, cuts and rounds of the programme for the sum.
    pub work: LimitWork,
}

/// Size of the programme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitWork {
    /// Taps of the Youla parameter that the write can see.
    pub taps: usize,
    /// Cuts that stand for |S| <= Ms.
    pub cuts: usize,
    /// Rounds solved, all programmes together.
    pub rounds: usize,
}

/// The expected figures of a controller on the same write; [`Limit::objective`] is below its objective if it keeps the margins.
pub fn figures_of(plant: &LimitPlant, controller: &Controller, spec: &Spec) -> Result<Figures, LimitError> {
    let t = controller.sample_time_s;
    let h = Horizon::of(plant, t, controller.feedforward.as_ref(), &spec.profile, &[])?;
    let chain = controller.sections().map_err(crate::pes::PesError::from)?.chain;
    let energy = energies(&h, &taps(&h.plant, &chain, h.ahead + h.taps));
    let norm = |band: [f64; 2]| {
        let inside = h.bins.iter().zip(&energy).filter(|(b, _)| in_band(b, band));
        inside.map(|(_, e)| e).sum::<f64>().sqrt()
    };
    Ok(weighted(norm(LOW_BAND_HZ), norm(HIGH_BAND_HZ), spec))
}

fn weighted(dft_low: f64, dft_high: f64, spec: &Spec) -> Figures {
    let [low, high] = bench::weights(&spec.limits);
    Figures { dft_low, dft_high, objective: low * dft_low + high * dft_high }
}

fn in_band(b: &Bin, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&b.hz)
}

/// The limit of a machine under a spec, with the feed-forward as it stands. Margins other than Ms are left out, which only lowers it.
pub fn limit(
    plant: &LimitPlant,
    sample_time_s: f64,
    feedforward: Option<&Feedforward>,
    spec: &Spec,
    settings: &LimitSettings,
) -> Result<Limit, LimitError> {
    let harmonics: Vec<usize> = spec.limits.harmonics.iter().map(|x| x.k).collect();
    let h = Horizon::of(plant, sample_time_s, feedforward, &spec.profile, &harmonics)?;
    if !h.bins.iter().any(|b| in_band(b, LOW_BAND_HZ) || in_band(b, HIGH_BAND_HZ)) {
        return Err(LimitError::NoBins);
    }
    let mut model = Model::new(&h, spec);
    let weights = bench::weights(&spec.limits);
    let sum = model.lower(weights, false, settings, settings.rounds)?.ok_or(LimitError::NotSolved { taps: h.taps })?;
    let norm_reached = model.norm;
    let (cut_count, at) = (model.cuts.len(), sum.figures);
    // The cuts of the sum serve the single bands as well; a few more rounds sharpen them.
    let few = settings.rounds.min(FEW_ROUNDS);
    let low = model.lower([weights[0], 0.0], false, settings, few)?.map_or(0.0, |l| l.bound / weights[0]);
    let high = model.lower([0.0, weights[1]], false, settings, few)?.map_or(0.0, |l| l.bound / weights[1]);
    let limited = spec.limits.dft_low.is_some() || spec.limits.dft_high.is_some();
    let verdict = if limited && model.impossible() { Verdict::Impossible } else { Verdict::Open };
    Ok(Limit {
        objective: sum.bound.max(0.0),
        at,
        dft_low: low.max(0.0),
        dft_high: high.max(0.0),
        verdict,
        max_sensitivity: spec.margins.max_sensitivity,
        norm_reached,
        work: LimitWork { taps: h.taps, cuts: cut_count, rounds: model.rounds },
    })
}

/// Rounds spent on each band alone.
const FEW_ROUNDS: usize = 4;

/// Samples of the plant's pulse response that set the unit of the taps: a quarter of a period at 400 Hz and 25 kHz.
const UNIT_SAMPLES: usize = 16;
/// Taps are looked for in a ball of this radius, in their unit; those of a real controller lie near 1 to 10.
const BALL: f64 = 1e3;

/// A programme that keeps its cuts between objectives.
struct Model<'a> {
    h: &'a Horizon,
    spec: &'a Spec,
    bands: [Energy; 2],
    rows: [Vec<Vec<f64>>; 2],
    /// Taps are counted in this unit.
    unit: f64,
    cuts: Vec<Cut>,
    norm: f64,
    rounds: usize,
}

struct Lowest {
    bound: f64,
    figures: Figures,
}

impl<'a> Model<'a> {
    fn new(h: &'a Horizon, spec: &'a Spec) -> Model<'a> {
        let bands = [LOW_BAND_HZ, HIGH_BAND_HZ].map(|band| Energy::of(h, |b| in_band(b, band)));
        let rows = [bands[0].rows(), bands[1].rows()];
        let size = h.shaped_plant[..h.taps.min(UNIT_SAMPLES)].iter().map(|x| x * x).sum::<f64>().sqrt();
        if std::env::var("LIMIT_TRACE").is_ok() { eprintln!("rows {} {} unit {} first {:?}", rows[0].len(), rows[1].len(), 1.0/size, &rows[0][0][..4]); }
        Model { h, spec, bands, rows, unit: 1.0 / size, cuts: vec![], norm: f64::NAN, rounds: 0 }
    }

    /// The programme: taps in units, then the two norms over their weights.
    fn programme(&self, weights: [f64; 2], limited: bool) -> Programme {
        let n = self.h.taps;
        let scale = bench::weights(&self.spec.limits);
        let mut p = Programme { cost: vec![0.0; n + 2], ..Programme::default() };
        for b in 0..2 {
            p.cost[n + b] = weights[b] / scale[b];
            let mut cone = vec![vec![0.0; n + 3]];
            cone[0][n + b] = 1.0;
            cone.extend(self.rows[b].iter().map(|r| self.padded(r, scale[b])));
            p.cones.push(cone);
        }
        // The ball bounds what is left of the multipliers' residual, and with it the proof.
        let mut ball = vec![vec![0.0; n + 3]; n + 1];
        ball[0][n + 2] = 1.0;
        for (j, row) in ball[1..].iter_mut().enumerate() {
            row[j] = 1.0 / BALL;
        }
        p.cones.push(ball);
        let of_cut = |c: &Cut| {
            let ms = self.spec.margins.max_sensitivity.unwrap_or(f64::INFINITY);
            let mut row: Vec<f64> = c.row.iter().map(|x| x * self.unit).collect();
            row.extend([0.0, 0.0, ms - c.constant]);
            row
        };
        p.half_spaces.extend(self.cuts.iter().map(of_cut));
        if let Some(peak) = self.spec.limits.command_peak {
            self.add_effort(&mut p, peak);
        }
        if limited {
            let limits = [self.spec.limits.dft_low, self.spec.limits.dft_high];
            for (b, limit) in limits.iter().enumerate() {
                let Some(limit) = limit else { continue };
                let mut row = vec![0.0; n + 3];
                (row[n + b], row[n + 2]) = (-1.0, limit * scale[b]);
                p.half_spaces.push(row);
            }
            self.add_harmonics(&mut p);
        }
        p
    }

    fn padded(&self, row: &[f64], scale: f64) -> Vec<f64> {
        let n = self.h.taps;
        let mut padded: Vec<f64> = row[..n].iter().map(|x| x * scale * self.unit).collect();
        padded.extend([0.0, 0.0, row[n] * scale]);
        padded
    }

    /// |command of the move| <= peak at every sample of the horizon; the noise would only add.
    fn add_effort(&self, p: &mut Programme, peak: f64) {
        let n = self.h.taps;
        let mut shaped = self.h.target.clone();
        self.h.shaping.apply(&mut shaped);
        for k in 0..n {
            for sign in [1.0, -1.0] {
                let mut row = vec![0.0; n + 3];
                for m in 0..=k {
                    row[m] = -sign * shaped[k - m] * self.unit / peak;
                }
                row[n + 2] = 1.0 - sign * self.h.forward[k] / peak;
                p.half_spaces.push(row);
            }
        }
    }

    /// The move's part of every limited harmonic; the noise would only add.
    fn add_harmonics(&self, p: &mut Programme) {
        let n = self.h.taps;
        for limit in &self.spec.limits.harmonics {
            let Some(bin) = self.h.bins.iter().find(|b| b.k == limit.k) else { continue };
            let moved = correlated(&bin.command[self.h.ahead..], &self.h.target);
            let row = |part: &dyn Fn(nalgebra::Complex<f64>) -> f64| {
                let mut row: Vec<f64> = moved.iter().map(|x| -part(*x)).collect();
                row.push(part(bin.still));
                self.padded(&row, 1.0 / limit.amplitude)
            };
            let mut bound = vec![0.0; n + 3];
            bound[n + 2] = 1.0;
            p.cones.push(vec![bound, row(&|x| x.re), row(&|x| x.im)]);
        }
    }

    /// Rounds of solving and cutting; the highest bound met. None where nothing was solved.
    fn lower(
        &mut self,
        weights: [f64; 2],
        limited: bool,
        settings: &LimitSettings,
        rounds: usize,
    ) -> Result<Option<Lowest>, LimitError> {
        let n = self.h.taps;
        let ms = self.spec.margins.max_sensitivity;
        let mut best: Option<Lowest> = None;
        for _ in 0..rounds.max(1) {
            self.rounds += 1;
            let Answer::Found { x, bound, .. } = self.programme(weights, limited).solve() else { break };
            let q: Vec<f64> = x[..n].iter().map(|x| x * self.unit).collect();
            let figures = weighted(self.bands[0].norm(&q), self.bands[1].norm(&q), self.spec);
            if best.as_ref().is_none_or(|b| bound > b.bound) {
                best = Some(Lowest { bound, figures });
            }
            let Some(ms) = ms else { break };
            let (norm, found) = cuts(self.h, &sensitivity(self.h, &q), ms, settings.cuts);
            self.norm = norm;
            if std::env::var("LIMIT_TRACE").is_ok() { eprintln!("bound {bound} norm {norm} cuts {}", self.cuts.len()); }
            if norm <= ms * (1.0 + settings.tolerance) {
                break;
            }
            self.cuts.extend(found);
        }
        Ok(best)
    }

    /// Whether the limits of the spec are proven to exclude each other.
    fn impossible(&mut self) -> bool {
        self.rounds += 1;
        matches!(self.programme(bench::weights(&self.spec.limits), true).solve(), Answer::Infeasible)
    }
}
