//! One slot tuned: what `tune` and `demo` share, from the machine to the gain table and the page.

use super::AnswerError;
use super::linear::{Shown, linear_view};
use super::steps::move_record;
use servotune::controller::Controller;
use servotune::frf::Sweep;
use servotune::identify::Identified;
use servotune::lti::{DiscretePlant, Plant};
use servotune::pes::{figures, simulate, simulate_physical};
use servotune::physics::Restored;
use servotune::tune::{
    DERIVATIVE_FILTER, GainTable, Judged, Machine, Outcome, PhysicalTuning, Spec, judge, margin_intervals,
};
use servotune_report::identified::{
    identified_figure, identified_sentences, ladder_table, order_table, parameter_table,
};
use servotune_report::loop_view::LoopView;
use servotune_report::margins::interval_table;
use servotune_report::page::{Block, Page, Section};
use servotune_report::physical::{PriceView, amplitude_table, limit_cycle_sentences, price_table};
use servotune_report::routes::{RouteView, routes_table};
use servotune_report::sampled::sampled_table;
use servotune_report::slot::{SlotView, slot_page};
use servotune_report::table::Verdict;
use servotune_report::tuned::{Units, conflicts_table, gains_table, sections_table};

/// A slot with everything that is known of it.
pub struct Slot<'a> {
    /// The slot.
    pub name: &'a str,
    /// The model: given, or identified from the sweep.
    pub plant: &'a Plant,
    /// Units of position and command.
    pub units: Units<'a>,
    /// The sweep with the hold it contains, where there is one.
    pub sweep: Option<&'a Sweep>,
    /// What identification said of it, with intervals.
    pub identified: Option<&'a Identified>,
    /// The limits.
    pub spec: &'a Spec,
    /// The gains that it came with.
    pub start: Option<&'a Controller>,
    /// The outcome that the gain table holds.
    pub outcome: &'a Outcome,
    /// The outcome of the other way, over the model, where the first one went straight on the response.
    pub over_model: Option<&'a Outcome>,
    /// The gain table.
    pub table: &'a GainTable,
    /// Whether the certificate proves the table, and what it says; none without one.
    pub certificate: Option<(bool, &'a str)>,
    /// What was read, with digests: name and value.
    pub provenance: Vec<(String, String)>,
    /// The physics and the tuning with it, where the plant has any.
    pub physics: Option<(&'a Restored, &'a PhysicalTuning)>,
}

/// The units of a plant file.
pub fn units(plant: &Plant) -> Units<'_> {
    Units { position: &plant.position_unit, command: &plant.command_unit }
}

/// All that is drawn of one controller on the model.
fn loop_view(
    name: &str,
    slot: &Slot<'_>,
    c: &Controller,
    shown: Shown,
    judged: Judged,
) -> Result<LoopView, AnswerError> {
    let mut view = linear_view(name, slot.plant, c, shown)?;
    if let Some(profile) = &slot.spec.profile {
        let write = match slot.physics {
            Some((physics, _)) => simulate_physical(physics, c, profile)?,
            None => simulate(slot.plant, c, profile)?,
        };
        let stable = view.margins.stable && write.pes.iter().all(|p| p.is_finite());
        view.write = stable.then(|| {
            let figures = figures(&write.pes, profile);
            (write, figures)
        });
        // With physics the steps and the end of the move would be another machine's.
        if slot.spec.limits.at_end.any() && slot.physics.is_none() && view.margins.stable {
            view.move_end = Some(move_record(slot.plant, c, profile)?);
        }
    }
    view.judged = Some(judged);
    Ok(view)
}

/// Said under the verdict where the limits were judged on the measured response.
const JUDGED_ON_RESPONSE: &str = "Cards and table are judged on the measured response, noise as expected power. The curves below are those of the identified \
                                  model, noise as the profile's draw.";

/// The same where both ways of tuning are compared.
const JUDGED_BOTH_WAYS: &str = "Cards and table are judged on the measured response, noise as expected power. The curves below are those of the identified \
                                model, noise as the profile's draw; the section \"Model or measured response\" sets both side by side.";

/// Said under the verdict where the plant has physics.
const JUDGED_WITH_PHYSICS: &str = "Cards and table are judged with the physics of the plant file: margins at the worst amplitude, the write simulated \
                                   with every effect. The curves of L and the steps are those of the linear plant, the write is the one with physics.";

/// Draws of the identified plant for the intervals of the margins, and their seed.
const DRAWS: usize = 200;
const DRAW_SEED: u64 = 1;

/// The page of the slot.
pub fn page(slot: &Slot<'_>) -> Result<Page, AnswerError> {
    let after_controller = slot.outcome.controller();
    let judged_after = slot.physics.map_or(&slot.outcome.after()[0].judged, |(_, t)| &t.after.judged);
    let both: Vec<&Controller> = std::iter::once(after_controller).chain(slot.start).collect();
    let shown = Shown::of(slot.plant, &both)?;
    let after = loop_view("after", slot, after_controller, shown, judged_after.clone())?;
    let judged_before = match slot.physics {
        Some((_, t)) => t.before.as_ref().map(|p| &p.judged),
        None => slot.outcome.before().and_then(|b| b.first()).map(|p| &p.judged),
    };
    let before = match (slot.start, judged_before) {
        (Some(c), Some(judged)) => Some(loop_view("before", slot, c, shown, judged.clone())?),
        _ => None,
    };
    let view = SlotView {
        name: slot.name,
        verdict: slot.physics.map_or_else(|| verdict(slot.outcome), |(_, t)| physical_verdict(t)),
        judged_on: slot
            .physics
            .map(|_| JUDGED_WITH_PHYSICS)
            .or(slot.sweep.map(|_| if slot.over_model.is_some() { JUDGED_BOTH_WAYS } else { JUDGED_ON_RESPONSE })),
        plant: [plant_sections(slot)?, physical_sections(slot, before.as_ref(), &after)?].concat(),
        before: before.as_ref(),
        after: &after,
        spec: slot.spec,
        units: slot.units,
        certificate: slot.certificate,
        gains: gain_sections(slot)?,
        provenance: slot.provenance.clone(),
    };
    Ok(slot_page(&view)?)
}

/// The verdict in a sentence.
pub fn verdict(outcome: &Outcome) -> (Verdict, String) {
    match outcome {
        Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => {
            let held = match outcome {
                Outcome::Tuned(_) => "Every limit is met",
                _ => "Every limit is met, but not with the room that `guard` asks for",
            };
            let filter = if t.work.filter_searched {
                format!(
                    " The derivative filter was searched: no table with {DERIVATIVE_FILTER} sample times was found."
                )
            } else {
                String::new()
            };
            if t.at_bounds.is_empty() {
                let verdict = if held.len() > 20 { Verdict::Warn } else { Verdict::Ok };
                return (verdict, format!("{held}.{filter}"));
            }
            let names: Vec<String> = t.at_bounds.iter().map(|b| b.parameter.to_string()).collect();
            (
                Verdict::Warn,
                format!("{held}. Search bounds set {}: widening them may do better.{filter}", names.join(", ")),
            )
        }
        Outcome::Infeasible(i) => {
            let names: Vec<String> = i.conflicts.iter().map(|c| c.what.to_string()).collect();
            let confirmed = if i.confirmed {
                "tuning again with the relaxed limits met them"
            } else {
                "not confirmed by tuning again"
            };
            (
                Verdict::Fail,
                format!(
                    "No gains within the bounds were found that meet every limit. In conflict: {}. The best compromise misses by {:.3} % of each; {confirmed}.",
                    names.join(", "),
                    100.0 * i.share
                ),
            )
        }
    }
}

/// The verdict of a tuning with physics.
pub fn physical_verdict(t: &PhysicalTuning) -> (Verdict, String) {
    match &t.outcome {
        o if o.tuned().is_some() && !t.after.judged.passes() => {
            let missed = t.after.judged.limits.iter().filter(|l| !l.met());
            let names: Vec<String> = missed.map(|l| l.wanted.what.to_string()).collect();
            let what = if names.is_empty() { "a stable loop at every amplitude".to_owned() } else { names.join(", ") };
            (Verdict::Fail, format!("With the physics the limits are not all met; missed: {what}."))
        }
        outcome => verdict(outcome),
    }
}

/// What the physics does to margins, write and gains.
fn physical_sections(
    slot: &Slot<'_>,
    before: Option<&LoopView>,
    after: &LoopView,
) -> Result<Vec<Section>, AnswerError> {
    let Some((physics, tuning)) = slot.physics else { return Ok(vec![]) };
    let mut writes = Vec::new();
    for (view, c, proof) in [
        (before, slot.start, tuning.before.as_ref()),
        (Some(after), Some(slot.outcome.controller()), Some(&tuning.after)),
    ] {
        if let (Some(view), Some(c), Some(proof)) = (view, c, proof) {
            let profile = slot.spec.write("tuning a plant with physics").map_err(servotune::tune::TuneError::from)?;
            let write = simulate(slot.plant, c, profile)?;
            let stable = proof.linear.stable && write.pes.iter().all(|p| p.is_finite());
            writes.push((view, proof, stable.then(|| figures(&write.pes, profile))));
        }
    }
    let views: Vec<PriceView<'_>> = writes
        .iter()
        .map(|(view, proof, linear)| PriceView {
            name: &view.name,
            linear: (&proof.linear, linear.as_ref()),
            physical: (&proof.margins.worst, view.write.as_ref().map(|(_, f)| f)),
        })
        .collect();
    let units = slot.units;
    let words = format!(
        "The plant file carries: {}. Each effect was simulated as it stands; the gains were tuned on the plant's equivalent response at {} amplitudes at once.",
        physics.names().join(", "),
        tuning.amplitudes.len()
    );
    let mut blocks = vec![
        Block::Prose(words),
        Block::Table(price_table(&views, units)?),
        Block::Table(amplitude_table(&tuning.after.margins, &tuning.after.linear, units)?),
    ];
    let cycles = limit_cycle_sentences(&tuning.after.margins, units);
    if !cycles.is_empty() {
        blocks.push(Block::Prose(cycles));
    }
    Ok(vec![Section { heading: "Physics".into(), blocks }])
}

/// The model beside its sweep: in words, as a figure, its ladder and its parameters.
pub(super) fn identified_blocks(sweep: &Sweep, id: &Identified) -> Result<Vec<Block>, AnswerError> {
    let mut blocks = vec![
        Block::Prose(identified_sentences(id).join(" ")),
        Block::Figure(identified_figure(&sweep.frf, id, "Measured response and model")?),
        Block::Table(ladder_table(id)?),
    ];
    if !id.held_out.is_empty() {
        blocks.push(Block::Details("Choice of the order".into(), vec![Block::Table(order_table(id)?)]));
    }
    blocks.push(Block::Details("Parameters with 95 % intervals".into(), vec![Block::Table(parameter_table(id)?)]));
    Ok(blocks)
}

/// What the reader of the sweep decided, folded.
pub(super) fn decided(sweep: &Sweep) -> Option<Block> {
    let notes: Vec<Block> = sweep.notes.iter().map(|n| Block::Prose(n.to_string())).collect();
    (!notes.is_empty()).then(|| Block::Details("What the reader decided about the sweep file".into(), notes))
}

fn plant_sections(slot: &Slot<'_>) -> Result<Vec<Section>, AnswerError> {
    let sampled = DiscretePlant::of(slot.plant, slot.outcome.controller().sample_time_s)?;
    let table = Block::Table(sampled_table(&sampled)?);
    let eq31 = Block::Details("Sampled plant, exact (counterpart of the paper's eq. 31)".into(), vec![table]);
    let (Some(sweep), Some(id)) = (slot.sweep, slot.identified) else {
        return Ok(vec![Section { heading: "Plant".into(), blocks: vec![eq31] }]);
    };
    let mut blocks = identified_blocks(sweep, id)?;
    let controller = slot.outcome.controller();
    if let Some((named, intervals)) = margin_intervals(id, controller, DRAWS, DRAW_SEED)? {
        let caption = "Margins after tuning over the uncertainty of the model (95 %)";
        blocks.push(Block::Table(interval_table(caption, &named, &intervals)?));
    }
    blocks.push(eq31);
    blocks.extend(decided(sweep));
    Ok(vec![Section { heading: "Plant".into(), blocks }])
}

fn gain_sections(slot: &Slot<'_>) -> Result<Vec<Section>, AnswerError> {
    let bounds = slot.outcome.at_bounds();
    let mut blocks = vec![Block::Table(gains_table(slot.start, slot.outcome.controller(), bounds)?)];
    if let Outcome::Infeasible(i) = slot.outcome {
        blocks.push(Block::Table(conflicts_table(i, slot.units)?));
    }
    blocks.push(Block::Details("Sections".into(), vec![Block::Table(sections_table(slot.table.sections())?)]));
    blocks.push(Block::Details("Gain table (gains.toml)".into(), vec![Block::Code(slot.table.text()?)]));
    let mut sections = vec![Section { heading: "Gains".into(), blocks }];
    if let (Some(over_model), Some(sweep)) = (slot.over_model, slot.sweep) {
        let on_response = Machine::Response { frf: &sweep.frf, continuation: Some(slot.plant) };
        let on_model = Machine::Model(slot.plant);
        let judged = |machine: &Machine<'_>, o: &Outcome| judge(machine, o.controller(), slot.spec).map(|p| p.judged);
        let first = (judged(&on_response, slot.outcome)?, judged(&on_model, slot.outcome)?);
        let second = (judged(&on_response, over_model)?, judged(&on_model, over_model)?);
        let table = routes_table(
            RouteView { on_response: &first.0, on_model: &first.1 },
            RouteView { on_response: &second.0, on_model: &second.1 },
            slot.units,
        )?;
        let words = "The gains above were tuned straight on the measured response. The same limits were also tuned over the \
                     identified model; each way's gains are judged by both ways.";
        let gains = gains_table(Some(over_model.controller()), slot.outcome.controller(), &[])?;
        sections.push(Section {
            heading: "Model or measured response".into(),
            blocks: vec![
                Block::Prose(words.into()),
                Block::Table(table),
                Block::Details(
                    "Gains over the model (before) and on the response (after)".into(),
                    vec![Block::Table(gains)],
                ),
            ],
        });
    }
    Ok(sections)
}

/// Provenance of a table for the foot of a page.
pub fn provenance(table: &GainTable) -> Vec<(String, String)> {
    let p = &table.provenance;
    let mut all = vec![
        ("program".to_owned(), format!("servotune {}", p.program)),
        ("seed".to_owned(), p.seed.to_string()),
        ("candidates scored".to_owned(), p.evaluations.to_string()),
        ("spec (SHA-256)".to_owned(), p.spec_sha256.clone()),
    ];
    if !p.physics.is_empty() {
        all.push(("physics".to_owned(), p.physics.join(", ")));
    }
    all.extend(p.inputs.iter().map(|i| (format!("{} (SHA-256)", i.role), i.sha256.clone())));
    all
}
