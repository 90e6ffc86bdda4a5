//! One spiral write: the document and the page of `simulate`.

use super::slot::units;
use super::{AnswerError, Named, Say, restored};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::feedback::{DescribedLoop, DescribedPlant, ModelLoop, confirmed_margins, linear_crossover_hz, margins};
use servotune::lti::{DiscretePlant, Plant};
use servotune::pes::{ClosedLoop, PesFigures, Profile, WindowDft, context, figures, simulate, simulate_physical};
use servotune::tune::{FoundFigures, Judged, Limits, MarginLimits, Requirement, Spec, TuneError};
use servotune_report::page::Page;
use servotune_report::simulated::{SimulatedView, simulated_page};
use servotune_report::write::{NamedWrite, WriteView};

/// A write and its figures.
#[derive(Clone, Debug, Serialize)]
pub struct Simulated {
    /// Whether the loop is stable; at the size of the move where there is physics.
    pub stable: bool,
    /// Whether the command reached the output limit.
    pub limited: bool,
    /// Unit of the PES.
    pub position_unit: String,
    /// Of the PES (Hz).
    pub sample_rate_hz: f64,
    /// PES at the servo clock; empty where it did not stay finite.
    pub pes: Vec<f64>,
    /// Effects beyond linear that were simulated; absent without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<&'static str>,
    /// Absent where the record runs away.
    #[serde(flatten)]
    pub figures: Option<PesFigures>,
    /// The record as it came, finite or not.
    #[serde(skip)]
    pub run: ClosedLoop,
}

/// Simulates the write of a profile.
pub fn simulated(
    plant: Named<'_, Plant>,
    controller: Named<'_, Controller>,
    profile: &Profile,
    say: Say<'_>,
) -> Result<Simulated, AnswerError> {
    let sections = controller.value.sections();
    let sections = sections.map_err(|source| AnswerError::Controller { file: controller.file.into(), source })?;
    let sampled = DiscretePlant::of(plant.value, controller.value.sample_time_s)
        .map_err(|source| AnswerError::Plant { file: plant.file.into(), source })?;
    let judged = confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?;
    let physics = restored(plant, &context(profile, controller.value), say)?;
    let (run, stable) = match &physics {
        None => (simulate(plant.value, controller.value, profile)?, judged.stable),
        Some(physics) => {
            // A small limit cycle is no unstable loop: the describing functions are asked at the size of the move.
            let described = DescribedPlant::new(physics, linear_crossover_hz(&judged, &sections))?;
            let at_move = described.at_amplitude(profile.spiral.distance);
            let at_move = margins(&DescribedLoop::new(at_move, &sections)?);
            (simulate_physical(physics, controller.value, profile)?, at_move.stable)
        }
    };
    // The figures of a record that runs away say nothing; without an output limit it does not even stay finite.
    let finite = run.pes.iter().all(|p| p.is_finite());
    Ok(Simulated {
        stable,
        limited: run.limited,
        position_unit: plant.value.position_unit.clone(),
        sample_rate_hz: profile.pes.sample_rate_hz,
        pes: if finite { run.pes.clone() } else { Vec::new() },
        physics: physics.as_ref().map(|p| p.names()).unwrap_or_default(),
        figures: (stable && finite).then(|| figures(&run.pes, profile)),
        run,
    })
}

/// The limits of a spec that speak of a write, judged on this one; a band or a harmonic that its window lacks is refused.
fn judged(run: &ClosedLoop, profile: &Profile, spec: &Spec) -> Result<Judged, AnswerError> {
    let asked = Spec { profile: Some(profile.clone()), ..spec.clone() };
    asked.check().map_err(TuneError::from)?;
    let l = &spec.limits;
    let limits = Limits {
        dft_low: l.dft_low,
        dft_high: l.dft_high,
        harmonics: l.harmonics.clone(),
        command_peak: l.command_peak,
        command_rms: l.command_rms,
        ..Limits::default()
    };
    let start = profile.first_servo_sample();
    let [first, last] = profile.pes.window;
    let window = &run.pes[start + first..start + last];
    let dft = WindowDft::whole(window.len(), profile.pes.sample_rate_hz);
    let mut amplitude = Vec::new();
    dft.amplitudes(window, &mut amplitude);
    let norm = |i: usize| spec.objective.bands_hz.get(i).map(|band| dft.band(&amplitude, *band));
    let of = |k: usize| dft.bins().iter().position(|b| *b == k).map_or(f64::NAN, |i| amplitude[i]);
    let power = run.command.iter().map(|u| u * u).sum::<f64>() / run.command.len().max(1) as f64;
    let found = FoundFigures {
        dft_low: norm(0),
        dft_high: norm(1),
        harmonics: limits.harmonics.iter().map(|h| of(h.k)).collect(),
        command_peak: Some(run.command.iter().fold(0.0, |a, u| u.abs().max(a))),
        command_rms: Some(power.sqrt()),
        ..FoundFigures::default()
    };
    Ok(Judged::of(&Requirement::list(&MarginLimits::default(), &limits), found))
}

/// The page of a write; with a spec its limits are drawn and judged.
pub fn written_page(
    plant: Named<'_, Plant>,
    run: &Simulated,
    profile: &Profile,
    spec: Option<&Spec>,
    provenance: Vec<(String, String)>,
) -> Result<Page, AnswerError> {
    let judged = match (&run.figures, spec) {
        (Some(_), Some(spec)) => Some(judged(&run.run, profile, spec)?),
        _ => None,
    };
    let (none, usual) = (Limits::default(), servotune::tune::Objective::usual_bands());
    let write = run.figures.as_ref().map(|figures| WriteView {
        profile,
        front: NamedWrite { name: "simulated", run: &run.run, figures },
        behind: None,
        limits: spec.map_or(&none, |s| &s.limits),
        bands_hz: spec.map_or(&usual, |s| &s.objective.bands_hz),
        units: units(plant.value),
    });
    let view = SimulatedView {
        name: &plant.file.display().to_string(),
        write,
        judged: judged.as_ref(),
        other_profile: spec.and_then(|s| s.profile.as_ref()).is_some_and(|own| own != profile),
        limited: run.limited,
        physics: &run.physics,
        provenance,
    };
    Ok(simulated_page(&view)?)
}
