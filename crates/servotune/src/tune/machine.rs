//! What is tuned: a plant model or a measured response, prepared once for thousands of candidates.

use super::objective::Minimise;
use super::record_figures::{Asked, RecordFigure};
use super::requirements::{Requirement, What};
use super::section_slope::SectionSlope;
use super::section_slope::in_parameters;
use super::step_figures::{MoveEnd, envelope_from, overshoot, worst_outside};
use super::write_figures::{WriteBuffers, WriteSource};
use super::{Spec, TuneError};
use crate::controller::Controller;
use crate::feedback::{LoopOnGrid, LoopPower, Magnitude, PowerWork, ResponseCurve, SampledPlant};
use crate::frf::{Frf, gathered};
use crate::lti::{DiscretePlant, FrequencyResponse, Plant, Section};
use crate::pes::{Slopes, StepScene, StepWork};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A machine to be tuned.
#[derive(Clone, Copy, Debug)]
pub enum Machine<'a> {
    /// By its model: exact margins, exact simulation.
    Model(&'a Plant),
    /// By its measured response: margins from the points of the sweep, PES from the spectrum.
    Response {
        /// The sweep, position over command.
        frf: &'a Frf,
        /// How the plant goes on outside the sweep, for the PES only; without it, along the slope of the first points.
        continuation: Option<&'a Plant>,
    },
}

/// By which way a result was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Route {
    /// Over a plant model.
    Model,
    /// Straight on the measured response.
    Response,
    /// On equivalent responses of a model with physics, one an amplitude.
    Physics,
}

impl Machine<'_> {
    /// The way that this machine takes.
    pub fn route(&self) -> Route {
        match self {
            Machine::Model(_) => Route::Model,
            Machine::Response { .. } => Route::Response,
        }
    }

    /// |P| at an angular frequency (rad/s), hold left out; of a response the nearest point.
    pub fn gain(&self, w: f64) -> f64 {
        match self {
            Machine::Model(plant) => plant.at(w).norm(),
            Machine::Response { frf, .. } => {
                let at = frf.w_rad_s().partition_point(|x| *x < w).min(frf.w_rad_s().len() - 1);
                frf.value()[at].norm()
            }
        }
    }
}

/// Points of a sweep below half the sample rate that a search needs at least.
const POINTS: usize = 20;

/// The plant of a sweep with its hold.
pub(super) fn curve(frf: &Frf, continuation: Option<&Plant>, t: f64) -> Result<ResponseCurve, TuneError> {
    // A search reads the curve some hundred thousand times: of a long sweep the means of neighbours that lie on one line. Margins are judged over every point.
    let long = gathered(frf);
    let mut curve = ResponseCurve::of(long.as_ref().map_or(frf, |g| &g.frf), t)?;
    if let Some(plant) = continuation {
        curve = curve.continued(DiscretePlant::of(plant, t)?);
    }
    let points = curve.w_rad_s().len();
    if points < POINTS {
        return Err(TuneError::Sweep { points, half_rate_hz: 0.5 / t, needed: POINTS });
    }
    Ok(curve)
}

/// A machine made ready: its response on the grid, its records, its sums over frequency.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    pub sampled: SampledPlant,
    plant: PlantAt,
    write: Option<WriteSource>,
    step: Option<StepScene>,
    /// The profile's move and where it ends.
    moving: Option<(StepScene, MoveEnd)>,
    /// Power of the position and of the command under the disturbance.
    disturbance: Option<[LoopPower; 2]>,
}

#[derive(Clone, Debug)]
enum PlantAt {
    Model(Box<DiscretePlant>),
    Curve(Box<ResponseCurve>),
}

/// Buffers for one machine and one thread.
#[derive(Clone, Debug)]
pub(super) struct Buffers {
    pub on: LoopOnGrid,
    /// Figures of the candidate seen last, in the order of [`Asked::figures`].
    pub figures: Vec<f64>,
    /// Slopes of each figure in every parameter, where asked for.
    pub slopes: Vec<Vec<f64>>,
    write: WriteBuffers,
    step: StepWork,
    moving: StepWork,
    weights: Vec<f64>,
    sections: Slopes,
    power: PowerWork,
}

impl Prepared {
    /// `asked`: the figures of records that count.
    pub fn of(machine: &Machine<'_>, spec: &Spec, asked: &Asked, base: &Controller) -> Result<Prepared, TuneError> {
        let t = base.sample_time_s;
        let model = |what: &'static str| TuneError::NeedsModel { what };
        let (sampled, plant, stepped) = match machine {
            Machine::Model(plant) => {
                if let Some(p) = plant.physics.first() {
                    return Err(TuneError::Physics { effect: p.effect.clone() });
                }
                let plant = DiscretePlant::of(plant, t)?;
                (SampledPlant::of_model(&plant), PlantAt::Model(Box::new(plant.clone())), Some(plant))
            }
            Machine::Response { frf, continuation } => {
                let curve = curve(frf, *continuation, t)?;
                let model = continuation.map(|p| DiscretePlant::of(p, t)).transpose()?;
                (curve.sampled(), PlantAt::Curve(Box::new(curve)), model)
            }
        };
        let step = match (asked.step_samples, &stepped) {
            (0, _) => None,
            (samples, Some(plant)) => Some(StepScene::new(plant, samples)),
            (_, None) => return Err(model("overshoot and settling of a step")),
        };
        let moving = match (asked.moves(), &stepped) {
            (false, _) => None,
            (true, Some(plant)) => {
                let spiral = &spec.write("the end of the move")?.spiral;
                let end = MoveEnd::of(spiral, spec.limits.at_end.band(), t);
                Some((StepScene::of_move(plant, spiral), end))
            }
            (true, None) => return Err(model("the end of the move")),
        };
        let of_write = |f| {
            matches!(f, RecordFigure::Band(_) | RecordFigure::Harmonic(_) | RecordFigure::CommandPeak)
                || f == RecordFigure::CommandRms && spec.profile.is_some()
                || f == RecordFigure::Objective && asked.minimise.of_write()
        };
        let write = if asked.any(of_write) {
            let profile = spec.write("a figure of the PES")?;
            let [first, last] = profile.pes.window;
            for band in asked.bands_hz.iter().filter(|_| asked.minimise == Minimise::Dft) {
                if profile.bins_in(*band) == 0 {
                    let (samples, rate_hz) = (last - first, profile.pes.sample_rate_hz);
                    let key = "objective.bands_hz".to_owned();
                    return Err(super::SpecError::EmptyBand { key, band: *band, samples, rate_hz }.into());
                }
            }
            Some(match &plant {
                PlantAt::Model(plant) => WriteSource::model(profile, plant, &sampled, asked)?,
                PlantAt::Curve(curve) => {
                    if asked.any(|f| f == RecordFigure::CommandRms) {
                        return Err(model("the command's rms over a write"));
                    }
                    WriteSource::response(profile, curve, base, asked)?
                }
            })
        } else {
            None
        };
        let summed = asked.minimise == Minimise::Disturbance
            || asked.any(|f| f == RecordFigure::CommandRms) && spec.profile.is_none();
        let disturbance = match (&spec.disturbance, summed) {
            (Some(d), true) => {
                let (mut position, mut command) = (LoopPower::on(&sampled), LoopPower::on(&sampled));
                position.add(&sampled, Magnitude::PS, |hz| d.density(hz, t));
                command.add(&sampled, Magnitude::T, |hz| d.density(hz, t));
                Some([position, command])
            }
            (None, true) => return Err(super::SpecError::NeedsDisturbance.into()),
            _ => None,
        };
        Ok(Prepared { sampled, plant, write, step, moving, disturbance })
    }

    /// The plant with its hold at `w` (rad/s).
    pub fn at(&self, w: f64) -> Complex<f64> {
        match &self.plant {
            PlantAt::Model(p) => p.at(w),
            PlantAt::Curve(c) => c.at(w),
        }
    }

    /// Where the loop ends (rad/s): at half the sample rate, or with the sweep.
    pub fn end_rad_s(&self) -> f64 {
        let last = self.sampled.w_rad_s().last().copied().unwrap_or(0.0);
        last.min(PI / self.sampled.sample_time_s()) * (1.0 + 1e-12)
    }

    /// Buffers for this machine.
    pub fn buffers(&self) -> Buffers {
        Buffers {
            on: LoopOnGrid::default(),
            figures: Vec::new(),
            slopes: Vec::new(),
            write: WriteBuffers::default(),
            step: StepWork::default(),
            moving: StepWork::default(),
            weights: Vec::new(),
            sections: Slopes::default(),
            power: PowerWork::default(),
        }
    }

    /// All figures of records and sums of one candidate, into the buffers; the loop has been judged before.
    pub fn records(&self, c: &Controller, chain: &[Section], asked: &Asked, aimed: &[Requirement], b: &mut Buffers) {
        b.figures.clear();
        b.figures.resize(asked.figures.len(), f64::NAN);
        if let Some(w) = &self.write {
            w.figures(c, chain, asked, &b.on, &mut b.write, &mut b.figures);
        }
        for (at, sum) in self.summed(asked) {
            b.figures[at] = sum.variance(&b.on).max(0.0).sqrt();
        }
        if let Some(scene) = &self.step {
            scene.run(chain, c.feedforward.as_ref(), c.output_limit, asked.step_samples, &mut b.step);
            if let Some(at) = asked.place(RecordFigure::Overshoot) {
                b.figures[at] = overshoot(&b.step.position).1;
            }
            if let Some(at) = asked.place(RecordFigure::Envelope) {
                let from = envelope_from(settling(aimed, What::Settling), c.sample_time_s);
                b.figures[at] = worst_outside(&b.step.position, from).1;
            }
        }
        if let Some((scene, end)) = &self.moving {
            scene.run(chain, c.feedforward.as_ref(), c.output_limit, scene.samples(), &mut b.moving);
            if let Some(at) = asked.place(RecordFigure::MoveOvershoot) {
                b.figures[at] = end.overshoot(&b.moving.position).1;
            }
            if let Some(at) = asked.place(RecordFigure::MoveEnvelope) {
                b.figures[at] = end.worst_outside(&b.moving.position, settling(aimed, What::MoveSettling)).1;
            }
        }
    }

    /// Slopes of the figures that are `wanted` in every parameter, into the buffers; the candidate is the one seen last.
    #[allow(clippy::too_many_arguments, reason = "one call site's locals")]
    pub fn record_slopes(
        &self,
        c: &Controller,
        chain: &[Section],
        slopes: &[SectionSlope],
        asked: &Asked,
        aimed: &[Requirement],
        wanted: &[bool],
        b: &mut Buffers,
    ) {
        b.slopes.resize_with(asked.figures.len(), Vec::new);
        b.slopes.iter_mut().for_each(Vec::clear);
        if !wanted.contains(&true) {
            return;
        }
        if let Some(w) = &self.write {
            w.slopes(c, chain, slopes, asked, &self.sampled, &b.on, wanted, &b.figures, &mut b.write, &mut b.slopes);
        }
        let place = |f| asked.place(f).filter(|at| wanted[*at]);
        for (at, sum) in self.summed(asked).filter(|(at, _)| wanted[*at]) {
            sum.slopes(&self.sampled, chain, &b.on, &mut b.power, &mut b.sections.sections);
            let half = 0.5 / b.figures[at].max(f64::MIN_POSITIVE);
            b.sections.sections.iter_mut().flatten().for_each(|d| *d *= half);
            in_parameters(&b.sections, slopes, &mut b.slopes[at]);
        }
        let Buffers { step, moving, weights, sections, slopes: out, .. } = b;
        let mut one_hot = |scene: &StepScene, work: &mut StepWork, at: usize, (sample, slope): (usize, f64)| {
            weights.clear();
            weights.resize(sample + 1, 0.0);
            weights[sample] = slope;
            scene.backward(chain, weights, &[], work, sections);
            in_parameters(sections, slopes, &mut out[at]);
        };
        if let Some(scene) = &self.step {
            if let Some(at) = place(RecordFigure::Overshoot) {
                let sample = overshoot(&step.position).0;
                one_hot(scene, step, at, (sample, 100.0));
            }
            if let Some(at) = place(RecordFigure::Envelope) {
                let from = envelope_from(settling(aimed, What::Settling), c.sample_time_s);
                let (sample, _, slope) = worst_outside(&step.position, from);
                one_hot(scene, step, at, (sample, slope));
            }
        }
        if let Some((scene, end)) = &self.moving {
            if let Some(at) = place(RecordFigure::MoveOvershoot) {
                let (sample, _, slope) = end.overshoot(&moving.position);
                one_hot(scene, moving, at, (sample, slope));
            }
            if let Some(at) = place(RecordFigure::MoveEnvelope) {
                let (sample, _, slope) = end.worst_outside(&moving.position, settling(aimed, What::MoveSettling));
                one_hot(scene, moving, at, (sample, slope));
            }
        }
    }
}

impl Prepared {
    /// The figures that are sums over frequency, by their place.
    fn summed(&self, asked: &Asked) -> impl Iterator<Item = (usize, &LoopPower)> {
        let position = (asked.minimise == Minimise::Disturbance).then_some(0);
        let command = asked.place(RecordFigure::CommandRms).filter(|_| self.write.is_none());
        let sums = self.disturbance.as_ref();
        [position, command].into_iter().enumerate().filter_map(move |(i, at)| Some((at?, &sums?[i])))
    }
}

/// The settling limit of a step or of the move that is aimed at (s).
fn settling(aimed: &[Requirement], what: What) -> f64 {
    aimed.iter().find(|w| w.what == what).map_or(f64::INFINITY, |w| w.limit)
}

/// Expected root mean square of the command under a disturbance at the plant's input (command_unit).
pub(super) fn command_rms(m: &Machine<'_>, c: &Controller, d: &super::Disturbance) -> Result<f64, TuneError> {
    let t = c.sample_time_s;
    let sampled = match m {
        Machine::Model(plant) => SampledPlant::of_model(&DiscretePlant::of(plant, t)?),
        Machine::Response { frf, continuation } => curve(frf, *continuation, t)?.sampled(),
    };
    let mut on = LoopOnGrid::default();
    sampled.close(&c.sections()?.chain, &mut on);
    let mut power = LoopPower::on(&sampled);
    power.add(&sampled, Magnitude::T, |hz| d.density(hz, t));
    Ok(power.variance(&on).max(0.0).sqrt())
}
