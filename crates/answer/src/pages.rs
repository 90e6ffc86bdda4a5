//! The pages of single commands: a model beside its sweep, the margins of a loop.
//!
//! In: what the command found. Out: a [`Page`] of the same parts as that of a slot. Spec: `specs/report.md`.

use super::linear::{Shown, linear_view};
use super::slot::{decided, identified_blocks, units};
use super::{AnswerError, Named};
use servotune::controller::Controller;
use servotune::frf::Sweep;
use servotune::identify::Identified;
use servotune::lti::Plant;
use servotune::tune::{Minimise, Objective, Spec};
use servotune_report::number::NumberFormat;
use servotune_report::overlay::overlay_page;
use servotune_report::page::{Card, Page, Section};
use servotune_report::slot::{SlotView, loop_page};
use servotune_report::table::Verdict;

/// The page of `identify`; `accepted` is what its exit code says.
pub fn identified_page(
    name: &str,
    sweep: &Sweep,
    id: &Identified,
    accepted: bool,
    provenance: Vec<(String, String)>,
) -> Result<Page, AnswerError> {
    let short = NumberFormat::Significant(3);
    let hz = sweep.frf.w_rad_s().iter().map(|w| w / std::f64::consts::TAU);
    let (low, high) = hz.fold((f64::INFINITY, 0.0f64), |(a, b), f| (a.min(f), b.max(f)));
    let card = |label: &str, value: String, unit: &str, note: &str, verdict| Card {
        label: label.into(),
        value,
        unit: unit.into(),
        note: note.into(),
        verdict,
    };
    let verdict = if accepted { Verdict::Ok } else { Verdict::Warn };
    let cards = vec![
        card("Order", id.plant.order().to_string(), "", "body and two for each resonance pair", None),
        card("Dead time", short.page(1e6 * id.plant.delay_s), "us", "", None),
        card(
            "Points",
            sweep.frf.len().to_string(),
            "",
            &format!("{} to {} Hz", short.page(low), short.page(high)),
            None,
        ),
        card("Model", if accepted { "holds" } else { "doubtful" }.into(), "", "see below", Some(verdict)),
    ];
    let mut blocks = identified_blocks(sweep, id)?;
    blocks.extend(decided(sweep));
    Ok(Page {
        title: format!("Plant model: {name}"),
        subtitle: "Measured response, model, and how well it is known".into(),
        cards,
        sections: vec![Section { heading: "Model".into(), blocks }],
        provenance,
    })
}

/// The page of `margins --plant`: the linear loop.
pub fn margins_page(
    plant: Named<'_, Plant>,
    controller: Named<'_, Controller>,
    provenance: Vec<(String, String)>,
) -> Result<Page, AnswerError> {
    let view = linear_view("loop", plant.value, controller.value, Shown::of(plant.value, &[controller.value])?)?;
    let name = plant.file.display().to_string();
    // Nothing is asked of this loop.
    let spec = Spec {
        profile: None,
        sample_time_s: None,
        guard: 0.0,
        further_room: Vec::new(),
        objective: Objective { minimise: Minimise::Room, bands_hz: Vec::new() },
        disturbance: None,
        margins: Default::default(),
        limits: Default::default(),
        structure: Default::default(),
        search: Default::default(),
    };
    let verdict = match view.margins.stable {
        true => (Verdict::Ok, "The closed loop is stable.".to_owned()),
        false => (Verdict::Fail, "The closed loop is unstable.".to_owned()),
    };
    let beyond = (!plant.value.physics.is_empty()).then_some("Effects beyond linear are left out of this page.");
    Ok(loop_page(&SlotView {
        name: &name,
        verdict,
        judged_on: beyond,
        plant: Vec::new(),
        before: None,
        after: &view,
        spec: &spec,
        units: units(plant.value),
        certificate: None,
        gains: Vec::new(),
        provenance,
    })?)
}

/// The page of `margins --plant` with several controllers: all of them in the same pictures, linear.
pub fn compared_page(
    plant: Named<'_, Plant>,
    controllers: &[Named<'_, Controller>],
    provenance: Vec<(String, String)>,
) -> Result<Page, AnswerError> {
    let values: Vec<&Controller> = controllers.iter().map(|c| c.value).collect();
    let shown = Shown::of(plant.value, &values)?;
    let loops = controllers
        .iter()
        .map(|c| linear_view(&c.file.display().to_string(), plant.value, c.value, shown))
        .collect::<Result<Vec<_>, _>>()?;
    let beyond = (!plant.value.physics.is_empty()).then_some("Effects beyond linear are left out of this page.");
    Ok(overlay_page(&plant.file.display().to_string(), &loops, units(plant.value), beyond, provenance)?)
}
