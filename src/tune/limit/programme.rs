//! `limit`: the programme of a machine, solved in rounds of cuts; and the figures of given gains beside it.

use super::basis::Basis;
use super::cone::{Answer, Programme};
use super::cuts::{Cut, Pointwise, sensitivity};
use super::energy::{Affine, convolved, correlated, moved, noise};
use super::horizon::{Bin, Horizon};
use super::taps::{energies, taps};
use super::{LimitError, LimitPlant};
use crate::controller::{Controller, Feedforward};
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ};
use crate::tune::{Spec, bench};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// How hard the bound is driven up, and over which loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitSettings {
    /// Rounds of cuts at most; the bound of every round is one.
    pub rounds: usize,
    /// Rounds for each band alone; 0 leaves these bounds out.
    pub alone: usize,
    /// Ends where no demand on S is missed by more than this.
    pub tolerance: f64,
    /// Loops of the class forget: sum of |s_k| beyond the horizon at most, s being the impulse response of S.
    pub tail: f64,
}

impl Default for LimitSettings {
    fn default() -> Self {
        LimitSettings { rounds: 12, alone: 4, tolerance: 2e-3, tail: 0.05 }
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

/// A proven bound, and how nearly it is reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bound {
    /// No loop of the class has a smaller weighted sum.
    pub objective: f64,
    /// Where the programme's own optimum lies, whose sum is at least the bound.
    pub at: Figures,
    /// By how much its last point still missed a demand of the class: 0 where the bound is as high as the programme allows.
    pub missed: f64,
}

/// The limit of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The weighted sum: every linear controller with |S| <= Ms, all gain crossings inside the spec's range, that forgets within the write.
    pub sum: Bound,
    /// No loop of the class has a smaller norm over 600 to 1500 Hz, whatever its other one (position_unit); none where not asked for.
    pub dft_low: Option<f64>,
    /// The same over 1500 to 3000 Hz.
    pub dft_high: Option<f64>,
    /// Can the limits of the spec be met within the class at all?
    pub verdict: Verdict,
    /// The class: Ms at most, none where the spec has none.
    pub max_sensitivity: Option<f64>,
    /// The class: all gain crossings between these (Hz).
    pub gain_crossover_hz: Option<[f64; 2]>,
    /// The class: sum of |s_k| beyond the horizon at most.
    pub tail: f64,
    /// Size of the programme.
    pub work: LimitWork,
}

/// Size of the programme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitWork {
    /// Taps of the Youla parameter that the write can see.
    pub taps: usize,
    /// Cuts that stand for the margins.
    pub cuts: usize,
    /// Rounds solved, all programmes together.
    pub rounds: usize,
}

/// Given gains beside a limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Expected figures of the gains.
    pub figures: Figures,
    /// Sum of |s_k| beyond the horizon, as far as twice the record shows it.
    pub tail: f64,
}

/// The expected figures of a controller on the same write, and whether its loop forgets soon enough to belong to the class.
pub fn standing(plant: &LimitPlant, controller: &Controller, spec: &Spec) -> Result<Standing, LimitError> {
    let t = controller.sample_time_s;
    let h = Horizon::of(plant, t, controller.feedforward.as_ref(), &spec.profile, &[])?;
    let chain = controller.sections().map_err(crate::pes::PesError::from)?.chain;
    let g = taps(&h.plant, &chain, h.plant.len());
    let s = convolved(&h.plant, &g);
    let energy = energies(&h, &g[..h.ahead + h.taps]);
    let norm = |band: [f64; 2]| {
        let inside = h.bins.iter().zip(&energy).filter(|(b, _)| in_band(b, band));
        inside.map(|(_, e)| e).sum::<f64>().sqrt()
    };
    let figures = weighted(norm(LOW_BAND_HZ), norm(HIGH_BAND_HZ), spec);
    Ok(Standing { figures, tail: s[h.taps..].iter().map(|x| x.abs()).sum() })
}

fn weighted(dft_low: f64, dft_high: f64, spec: &Spec) -> Figures {
    let [low, high] = bench::weights(&spec.limits);
    Figures { dft_low, dft_high, objective: low * dft_low + high * dft_high }
}

fn in_band(b: &Bin, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&b.hz)
}

/// The limit of a machine under a spec, with the feed-forward as it stands. Phase and gain margin are left out, which only lowers it.
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
    let mut model = Model::new(&h, spec, sample_time_s, settings);
    let unsolved = LimitError::NotSolved { taps: h.taps };
    let weights = bench::weights(&spec.limits);
    let sum = model.lower(weights, settings.rounds).ok_or(unsolved)?;
    let cuts = model.cuts.len();
    // The cuts of the sum serve the single bands as well; a few more rounds sharpen them.
    let mut alone = |b: usize| {
        let mut one = [0.0; 2];
        one[b] = weights[b];
        (settings.alone > 0).then(|| model.lower(one, settings.alone).map_or(0.0, |l| l.objective / weights[b]))
    };
    let (dft_low, dft_high) = (alone(0), alone(1));
    let limited = spec.limits.dft_low.is_some() || spec.limits.dft_high.is_some();
    let verdict = if limited && model.impossible() { Verdict::Impossible } else { Verdict::Open };
    Ok(Limit {
        sum,
        dft_low,
        dft_high,
        verdict,
        max_sensitivity: spec.margins.max_sensitivity,
        gain_crossover_hz: spec.margins.gain_crossover_hz,
        tail: settings.tail,
        work: LimitWork { taps: h.taps, cuts, rounds: model.rounds },
    })
}

/// Samples of the plant's pulse response that set the unit of the taps: a quarter of a period at 400 Hz and 25 kHz.
const UNIT_SAMPLES: usize = 16;
/// Radius of the ball of coordinates that is searched: norms up to so many times the level, far beyond any use. The length of S adds less than
/// 1 to it, taps only beyond 1e7 of their unit.
const BALL: f64 = 100.0;

/// What stands for 1 in the programme: the limits, or without any a tenth of what the window shows under no control.
fn level(h: &Horizon, spec: &Spec) -> f64 {
    if spec.limits.dft_low.is_some() || spec.limits.dft_high.is_some() {
        return 1.0;
    }
    let norm =
        |band: [f64; 2]| h.bins.iter().filter(|b| in_band(b, band)).map(|b| b.still.norm_sqr()).sum::<f64>().sqrt();
    let still = 0.1 * weighted(norm(LOW_BAND_HZ), norm(HIGH_BAND_HZ), spec).objective;
    if still > 0.0 { still } else { 1.0 }
}

/// A row at a point.
fn value(row: &[f64], x: &[f64]) -> f64 {
    row.iter().zip(x).map(|(r, x)| r * x).sum::<f64>() + row[x.len()]
}

/// A programme that keeps its cuts between objectives.
struct Model<'a> {
    h: &'a Horizon,
    spec: &'a Spec,
    settings: &'a LimitSettings,
    /// What stands for 1 in the programme, and what each band's norm is multiplied by for it.
    level: f64,
    scale: [f64; 2],
    /// Rows of both bands over the coordinates, times their scale; two gaps before the constant for the bounds of the norms.
    bands: [Vec<Vec<f64>>; 2],
    basis: Basis,
    pointwise: Pointwise,
    /// Cuts over the coordinates: one row for a half space, three for a disk.
    cuts: Vec<Vec<Vec<f64>>>,
    rounds: usize,
}

/// A cut further than this from a point is left out of the next round; it comes back when it is broken.
const FAR: f64 = 0.3;

impl<'a> Model<'a> {
    fn new(h: &'a Horizon, spec: &'a Spec, sample_time_s: f64, settings: &'a LimitSettings) -> Model<'a> {
        let size = h.shaped_plant[..h.taps.min(UNIT_SAMPLES)].iter().map(|x| x * x).sum::<f64>().sqrt();
        let unit = 1.0 / size.max(f64::MIN_POSITIVE);
        let level = level(h, spec);
        let scale = bench::weights(&spec.limits).map(|w| w / level);
        let moves = [LOW_BAND_HZ, HIGH_BAND_HZ].map(|band| moved(h, |b| in_band(b, band)));
        let all: Vec<(&Affine, f64)> = (0..2).flat_map(|b| moves[b].iter().map(move |a| (a, scale[b]))).collect();
        let basis = Basis::of(&all, &h.shaped_plant[..h.taps], unit);
        let bands = [(0, LOW_BAND_HZ), (1, HIGH_BAND_HZ)].map(|(b, band)| {
            let mut rows: Vec<Vec<f64>> = moves[b].iter().map(|a| basis.row(a, scale[b], 2)).collect();
            for mut row in noise(h, &basis, scale[b], |b| in_band(b, band)) {
                row.splice(h.taps..h.taps, [0.0; 2]);
                rows.push(row);
            }
            rows
        });
        let pointwise = Pointwise {
            sample_time_s,
            tail: settings.tail,
            max_sensitivity: spec.margins.max_sensitivity,
            crossover_hz: spec.margins.gain_crossover_hz,
        };
        let mut model = Model { h, spec, settings, level, scale, bands, basis, pointwise, cuts: vec![], rounds: 0 };
        model.pointwise.first(h).into_iter().for_each(|c| model.add(c));
        model
    }

    /// The programme: coordinates of the taps, then the two norms over their weights.
    fn programme(&self, weights: [f64; 2], limited: bool) -> Programme {
        let n = self.h.taps;
        let scale = self.scale;
        let mut p = Programme { cost: vec![0.0; n + 2], ball: (n, BALL), top: BALL, ..Programme::default() };
        for b in 0..2 {
            p.cost[n + b] = weights[b] / bench::weights(&self.spec.limits)[b];
            let mut cone = vec![vec![0.0; n + 3]];
            cone[0][n + b] = 1.0;
            cone.extend(self.bands[b].iter().cloned());
            p.cones.push(cone);
        }
        for cut in &self.cuts {
            match cut.as_slice() {
                [half] => p.half_spaces.push(half.clone()),
                cone => p.cones.push(cone.to_vec()),
            }
        }
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

    /// |command of the move| <= peak at every sample of the horizon; the noise would only add.
    fn add_effort(&self, p: &mut Programme, peak: f64) {
        let n = self.h.taps;
        let mut shaped = self.h.target.clone();
        self.h.shaping.apply(&mut shaped);
        for k in 0..n {
            for sign in [1.0, -1.0] {
                let row = (0..n).map(|m| if m <= k { -sign * shaped[k - m] } else { 0.0 }).collect();
                let constant = peak - sign * self.h.forward[k];
                p.half_spaces.push(self.basis.row(&Affine { row, constant }, 1.0 / peak, 2));
            }
        }
    }

    /// The move's part of every limited harmonic; the noise would only add.
    fn add_harmonics(&self, p: &mut Programme) {
        let n = self.h.taps;
        for limit in &self.spec.limits.harmonics {
            let Some(bin) = self.h.bins.iter().find(|b| b.k == limit.k) else { continue };
            let moved = correlated(&bin.command[self.h.ahead..], &self.h.target);
            let row = |part: &dyn Fn(Complex<f64>) -> f64| {
                let row = moved.iter().map(|x| -part(*x)).collect();
                self.basis.row(&Affine { row, constant: part(bin.still) }, 1.0 / limit.amplitude, 2)
            };
            let mut bound = vec![0.0; n + 3];
            bound[n + 2] = 1.0;
            p.cones.push(vec![bound, row(&|x| x.re), row(&|x| x.im)]);
        }
    }

    fn add(&mut self, cut: Cut) {
        let n = self.h.taps;
        self.cuts.push(match cut {
            Cut::Half(a) => vec![self.basis.row(&a, 1.0, 2)],
            Cut::Disk(bound, [re, im]) => {
                let mut first = vec![0.0; n + 3];
                first[n + 2] = bound;
                vec![first, self.basis.row(&re, 1.0, 2), self.basis.row(&im, 1.0, 2)]
            }
        });
    }

    /// Leaves out the cuts far from a point.
    fn thin(&mut self, x: &[f64]) {
        self.cuts.retain(|cut| match cut.as_slice() {
            [half] => value(half, x) < FAR,
            [bound, re, im] => value(bound, x) - value(re, x).hypot(value(im, x)) < FAR,
            _ => true,
        });
    }

    /// Both norms at a point.
    fn figures(&self, x: &[f64]) -> Figures {
        let norm = |b: usize| self.bands[b].iter().map(|r| value(r, x).powi(2)).sum::<f64>().sqrt() / self.scale[b];
        weighted(norm(0), norm(1), self.spec)
    }

    /// Rounds of solving and cutting; the highest bound met. None where nothing was solved.
    fn lower(&mut self, weights: [f64; 2], rounds: usize) -> Option<Bound> {
        let n = self.h.taps;
        let mut best: Option<Bound> = None;
        for _ in 0..rounds.max(1) {
            self.rounds += 1;
            let Answer::Found { x, bound, .. } = self.programme(weights, false).solve() else { break };
            let bound = bound * self.level;
            let q = self.basis.taps(&x[..n]);
            let (missed, found) = self.pointwise.cuts(self.h, &sensitivity(self.h, &q));
            let at = self.figures(&x);
            // Every round's bound is one; the highest stands, with what its point missed.
            if best.as_ref().is_none_or(|b| bound > b.objective) {
                best = Some(Bound { objective: bound, at, missed: missed.max(0.0) });
            }
            if missed <= self.settings.tolerance {
                // The last point meets everything: an earlier bound can be higher by the solver's tolerance only.
                if let Some(b) = &mut best {
                    (b.at, b.missed) = (at, missed.max(0.0));
                }
                break;
            }
            self.thin(&x);
            found.into_iter().for_each(|c| self.add(c));
        }
        best.map(|b| Bound { objective: b.objective.max(0.0), ..b })
    }

    /// Whether the limits of the spec are proven to exclude each other.
    fn impossible(&mut self) -> bool {
        self.rounds += 1;
        matches!(self.programme(bench::weights(&self.spec.limits), true).solve(), Answer::Infeasible)
    }
}
