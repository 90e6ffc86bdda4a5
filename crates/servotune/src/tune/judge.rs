//! The exact judgement of one controller on one machine, independent of the search's shortcuts.

use super::exact_loop::exact_loop;
use super::machine::curve;
use super::requirements::{FoundFigures, Judged, Requirement};
use super::step_figures::{MoveEnd, overshoot, settling_s};
use super::{Machine, Spec, TuneError};
use crate::controller::Controller;
use crate::feedback::{Margins, MeasuredLoop, ModelLoop, OpenLoop, confirmed_margins, margins};
use crate::lti::{DiscretePlant, FrequencyResponse, Plant};
use crate::pes::{Profile, SpectralPes, SpectralWork, StepScene, StepWork, WindowDft, simulate};
use serde::Serialize;

/// One controller on one machine: all margins, and every requirement judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// Margins, refined on the function itself.
    pub margins: Margins,
    /// Requirements with what was found.
    pub judged: Judged,
}

/// Judges a controller: margins, curves and bandwidth refined on the loop; the whole write and a step simulated, or the write read off the
/// spectrum of a response.
pub fn judge(machine: &Machine<'_>, controller: &Controller, spec: &Spec) -> Result<Judgement, TuneError> {
    let wanted = Requirement::list(&spec.margins, &spec.limits);
    let (margins, mut found) = judge_loop(machine, controller, spec)?;
    if let Some(profile) = &spec.profile {
        match machine {
            Machine::Model(plant) => simulated(plant, controller, spec, profile, &mut found)?,
            Machine::Response { frf, continuation } => {
                let harmonics: Vec<usize> = spec.limits.harmonics.iter().map(|h| h.k).collect();
                let bins = bins(spec, profile, &harmonics);
                let plant = curve(frf, *continuation, controller.sample_time_s)?;
                let s = SpectralPes::new(profile, &plant, controller, bins, true)?;
                let mut amplitude = Vec::new();
                let chain = controller.sections()?.chain;
                found.command_peak = Some(s.write(&chain, &mut SpectralWork::default(), &mut amplitude));
                bands(s.dft(), &amplitude, spec, &mut found);
            }
        }
    }
    let model = match machine {
        Machine::Model(plant) => Some(*plant),
        Machine::Response { continuation, .. } => *continuation,
    };
    if let Some(plant) = model {
        stepped(plant, controller, spec, &mut found)?;
    }
    if let (Some(d), None, Some(_)) = (&spec.disturbance, &spec.profile, spec.limits.command_rms) {
        found.command_rms = Some(super::machine::command_rms(machine, controller, d)?);
    }
    Ok(Judgement { margins, judged: Judged::of(&wanted, found) })
}

/// The figures of the loop alone.
pub(super) fn judge_loop(
    m: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
) -> Result<(Margins, FoundFigures), TuneError> {
    let sections = controller.sections()?;
    let (limits, curves) = (&spec.margins, &spec.limits.curve);
    Ok(match m {
        Machine::Model(plant) => {
            let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
            let l = ModelLoop::new(&sampled, &sections)?;
            exact_loop(&l, confirmed_margins(&l)?, &|w| sampled.at(w), limits, curves)
        }
        Machine::Response { frf, continuation } => {
            let plant = curve(frf, *continuation, controller.sample_time_s)?;
            let l = MeasuredLoop::new(frf, &sections)?;
            let (margins, mut found) = exact_loop(&l, margins(&l), &|w| plant.at(w), limits, curves);
            // A sweep that ends before L turns negative has its last point to speak of; beyond it |L| is taken to stay below that.
            found.within_sweep = true;
            found.gain_margin_db = margins.gain_margin_db.or_else(|| Some(-20.0 * l.at(l.end_rad_s()).norm().log10()));
            (margins, found)
        }
    })
}

/// The figures of the whole write, as `simulate` gives them, over the bands of the spec.
fn simulated(
    plant: &Plant,
    c: &Controller,
    spec: &Spec,
    profile: &Profile,
    found: &mut FoundFigures,
) -> Result<(), TuneError> {
    let write = simulate(plant, c, profile)?;
    let start = profile.first_servo_sample();
    let [first, last] = profile.pes.window;
    let window = &write.pes[start + first..start + last];
    let harmonics: Vec<usize> = spec.limits.harmonics.iter().map(|h| h.k).collect();
    let dft = WindowDft::new(window.len(), profile.pes.sample_rate_hz, bins(spec, profile, &harmonics));
    let mut amplitude = Vec::new();
    dft.amplitudes(window, &mut amplitude);
    bands(&dft, &amplitude, spec, found);
    found.command_peak = Some(write.command.iter().fold(0.0, |a, u| u.abs().max(a)));
    let power = write.command.iter().map(|u| u * u).sum::<f64>() / write.command.len().max(1) as f64;
    found.command_rms = spec.limits.command_rms.map(|_| power.sqrt());
    Ok(())
}

/// Norms over the first two bands and the limited harmonics; none of a band without a bin.
fn bands(dft: &WindowDft, amplitude: &[f64], spec: &Spec, found: &mut FoundFigures) {
    let norm = |i: usize| {
        let band = *spec.objective.bands_hz.get(i)?;
        dft.inside(band).next().map(|_| dft.band(amplitude, band))
    };
    (found.dft_low, found.dft_high) = (norm(0), norm(1));
    let of = |k: usize| dft.bins().iter().position(|b| *b == k).map_or(0.0, |i| amplitude[i]);
    found.harmonics = spec.limits.harmonics.iter().map(|h| of(h.k)).collect();
}

/// The bins of the first two bands and the limited harmonics, ascending.
pub(super) fn bins(spec: &Spec, profile: &Profile, harmonics: &[usize]) -> Vec<usize> {
    let [first, last] = profile.pes.window;
    let n = last - first;
    let inside = |k: usize| {
        let hz = k as f64 * profile.pes.sample_rate_hz / n as f64;
        let mut bands = spec.objective.bands_hz.iter();
        bands.any(|[low, high]| (*low..=*high).contains(&hz)) || harmonics.contains(&k)
    };
    (1..=n / 2).filter(|&k| inside(k)).collect()
}

/// Overshoot and settling of a step of the reference and of the profile's move, where a limit asks for them.
fn stepped(plant: &Plant, c: &Controller, spec: &Spec, found: &mut FoundFigures) -> Result<(), TuneError> {
    let (l, t) = (&spec.limits, c.sample_time_s);
    let mut work = StepWork::default();
    let mut run = |scene: &StepScene| -> Result<Vec<f64>, TuneError> {
        scene.run(&c.sections()?.chain, c.feedforward.as_ref(), c.output_limit, scene.samples(), &mut work);
        Ok(std::mem::take(&mut work.position))
    };
    if l.overshoot_percent.is_some() || l.settling_s.is_some() {
        let samples = super::record_figures::step_samples(spec, t);
        let position = run(&StepScene::new(&DiscretePlant::of(plant, t)?, samples))?;
        found.overshoot_percent = l.overshoot_percent.map(|_| overshoot(&position).1);
        found.settling_s = l.settling_s.map(|_| settling_s(&position, t));
    }
    if let Some(profile) = spec.profile.as_ref().filter(|_| l.at_end.any()) {
        let position = run(&StepScene::of_move(&DiscretePlant::of(plant, t)?, &profile.spiral))?;
        let end = MoveEnd::of(&profile.spiral, l.at_end.band(), t);
        found.move_overshoot = l.at_end.overshoot.map(|_| end.overshoot(&position).1);
        found.move_settling_s = l.at_end.settling_s.map(|_| end.settling_s(&position));
    }
    Ok(())
}

/// How many times later the way back comes where a loop may be slow.
const LASTING: f64 = 16.0;

/// The weighted sum of the DFT norms on a measured response with the way back much later; none for a model, whose write is simulated, and where
/// the objective is another.
///
/// A loop that forgets slowly still sees the move before, which the ordinary period takes for part of the write.
pub(super) fn lasting_objective(
    m: &Machine<'_>,
    controller: &Controller,
    spec: &Spec,
) -> Result<Option<f64>, TuneError> {
    let Machine::Response { frf, continuation } = m else { return Ok(None) };
    let Some(profile) = spec.profile.as_ref().filter(|_| spec.objective.minimise == super::Minimise::Dft) else {
        return Ok(None);
    };
    let plant = curve(frf, *continuation, controller.sample_time_s)?;
    let s = SpectralPes::lasting(profile, &plant, controller, bins(spec, profile, &[]), false, LASTING)?;
    let mut amplitude = Vec::new();
    s.write(&controller.sections()?.chain, &mut SpectralWork::default(), &mut amplitude);
    let weights = super::record_figures::band_weights(spec);
    Ok(Some(spec.objective.bands_hz.iter().zip(weights).map(|(b, w)| w * s.dft().band(&amplitude, *b)).sum()))
}

pub(super) fn judged(machines: &[Machine<'_>], c: &Controller, spec: &Spec) -> Result<Vec<Judgement>, TuneError> {
    machines.iter().map(|m| judge(m, c, spec)).collect()
}
