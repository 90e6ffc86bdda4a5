//! The page of one slot: identification, loop, PES, gains, before and after.
//!
//! In: views of one loop each, made by the caller. Out: a [`Page`]. Spec: `specs/report.md`.

use super::ReportError;
use super::bode::{BodeCurve, BodeMarks, bode};
use super::disturbed::disturbed;
use super::figure::{Figure, Ink, Kind, Region, Series};
use super::limit_cards::limit_cards;
use super::loop_view::LoopView;
use super::margins::margins_table;
use super::move_end::{MoveRecord, move_end};
use super::number::{MISSING, NumberFormat};
use super::nyquist::{NyquistMarks, behind as nyquist_behind, nyquist};
use super::page::{Block, Card, Page, Section};
use super::sensitivity::sensitivity;
use super::steps::{StepLimits, StepResponses};
use super::table::Verdict;
use super::tuned::{Units, limits_table};
use super::write::{NamedWrite, WriteView, write_blocks};
use nalgebra::Complex;
use servotune::feedback::{CurveSide, Magnitude};
use servotune::pes::{Profile, coloured};
use servotune::tune::Spec;

/// What a slot's page shows.
#[derive(Debug)]
pub struct SlotView<'a> {
    /// Name of the slot or machine.
    pub name: &'a str,
    /// The verdict in one sentence, and whether it is good.
    pub verdict: (Verdict, String),
    /// Whether the certificate proves the gain table, and what it says; none without one.
    pub certificate: Option<(bool, &'a str)>,
    /// On what the limits were judged, where that is not what the curves show.
    pub judged_on: Option<&'a str>,
    /// Sections about where the plant comes from, shown first.
    pub plant: Vec<Section>,
    /// The controller before.
    pub before: Option<&'a LoopView>,
    /// The controller after.
    pub after: &'a LoopView,
    /// Limits and write.
    pub spec: &'a Spec,
    /// Units of position and command.
    pub units: Units<'a>,
    /// Sections about the gains, shown last.
    pub gains: Vec<Section>,
    /// Inputs with digests, program, seed.
    pub provenance: Vec<(String, String)>,
}

/// The page of one slot.
pub fn slot_page(view: &SlotView<'_>) -> Result<Page, ReportError> {
    let limits = limits_table(view.before.and_then(|b| b.judged.as_ref()), view.after.judged.as_ref(), view.units)?;
    let mut verdict = vec![Block::Notice(view.verdict.0, view.verdict.1.clone()), Block::Table(limits)];
    // Without it, the table's figures would seem to contradict the cards and the curves.
    verdict.extend(view.judged_on.map(|said| Block::Prose(said.to_owned())));
    verdict.extend(
        view.certificate
            .map(|(proved, said)| Block::Notice(if proved { Verdict::Ok } else { Verdict::Warn }, said.to_owned())),
    );
    let mut sections = vec![Section { heading: "Verdict".into(), blocks: verdict }];
    sections.extend(view.plant.iter().cloned());
    sections.push(loop_section(view)?);
    if let Some(profile) = &view.spec.profile {
        sections.push(pes_section(view, profile)?);
    }
    sections.extend(view.gains.iter().cloned());
    Ok(Page {
        title: format!("Servo tuning report: {}", view.name),
        subtitle: "Margins of the open loop, simulated PES, gain table".into(),
        cards: cards(view),
        sections,
        provenance: view.provenance.clone(),
    })
}

/// The page of a loop that nothing is asked of: margins, curves, steps.
pub fn loop_page(view: &SlotView<'_>) -> Result<Page, ReportError> {
    let mut verdict = vec![Block::Notice(view.verdict.0, view.verdict.1.clone())];
    verdict.extend(view.judged_on.map(|said| Block::Prose(said.to_owned())));
    let sections = vec![Section { heading: "Verdict".into(), blocks: verdict }, loop_section(view)?];
    Ok(Page {
        title: format!("Margins: {}", view.name),
        subtitle: "The open loop, its sensitivity functions, its steps".into(),
        cards: cards(view),
        sections,
        provenance: view.provenance.clone(),
    })
}

/// Most cards.
const CARDS: usize = 6;

/// The limits as they were judged; margins that nothing is asked of fill the row.
fn cards(view: &SlotView<'_>) -> Vec<Card> {
    let short = NumberFormat::Significant(3);
    let mut all = view.after.judged.as_ref().map_or_else(Vec::new, |j| limit_cards(j, view.units));
    all.truncate(CARDS);
    let m = &view.after.margins;
    let asked = |label: &str| all.iter().any(|c| c.label == label);
    let plain = [
        ("Phase margin", m.phase_margin_deg, "deg"),
        ("Gain margin", m.gain_margin_db, "dB"),
        ("Max sensitivity Ms", Some(m.max_sensitivity), ""),
        ("Gain crossover", m.gain_crossover_hz, "Hz"),
    ];
    let more: Vec<Card> = plain
        .into_iter()
        .filter(|(label, ..)| !asked(label))
        .map(|(label, value, unit)| Card {
            label: label.into(),
            value: value.map_or_else(|| MISSING.to_owned(), |v| short.page(v)),
            unit: unit.into(),
            note: "of the model".into(),
            verdict: None,
        })
        .collect();
    let room = CARDS - all.len();
    all.extend(more.into_iter().take(room));
    all
}

/// The curves that the spec asks of this magnitude, as lines of the limit, and the band of the crossover.
fn requirements(figure: &mut Figure, view: &SlotView<'_>, of: &[Magnitude]) -> Result<(), ReportError> {
    let Some(panel) = figure.panels.first_mut() else { return Ok(()) };
    for (i, c) in view.spec.limits.curve.iter().enumerate().filter(|(_, c)| of.contains(&c.of)) {
        let side = if c.side == CurveSide::AtLeast { "at least" } else { "at most" };
        let name = format!("curve {}: |{:?}| {side}", i + 1, c.of);
        panel.marks.push(Series::new(&name, Ink::Limit, Kind::Solid, &c.hz, &c.db)?.into());
    }
    if let Some([low, high]) = view.spec.margins.gain_crossover_hz.filter(|_| of.contains(&Magnitude::L)) {
        let label = format!("crossover {low} to {high} Hz");
        panel.marks.insert(0, Region::of_x(low, high, &label, Ink::Muted));
    }
    Ok(())
}

/// Density (command_unit²/Hz) of what the spec says acts at the plant's input, else of the profile's windage; none without either.
fn disturbance(spec: &Spec, sample_time_s: f64) -> Option<Box<dyn Fn(f64) -> f64 + '_>> {
    if let Some(d) = &spec.disturbance {
        return Some(Box::new(move |hz| d.density(hz, sample_time_s)));
    }
    let noise = &spec.profile.as_ref()?.noise;
    (noise.windage_rms > 0.0).then(|| {
        Box::new(coloured(noise.windage_rms, noise.windage_corner_hz, sample_time_s)) as Box<dyn Fn(f64) -> f64>
    })
}

fn loop_section(view: &SlotView<'_>) -> Result<Section, ReportError> {
    let after = view.after;
    let curve = |v: &'_ LoopView| (v.name.clone(), v.hz.clone(), v.open_loop.clone());
    let all: Vec<_> = std::iter::once(after).chain(view.before).map(curve).collect();
    let curves: Vec<BodeCurve> =
        all.iter().map(|(name, hz, l)| BodeCurve { name, frequency_hz: hz, response: l, relative_std: None }).collect();
    let m = &after.margins;
    let marks = BodeMarks {
        trusted_hz: None,
        phase_margin: m.gain_crossover_hz.zip(m.phase_margin_deg),
        gain_margin: m.phase_crossover_hz.zip(m.gain_margin_db),
    };
    let caption = match view.before {
        Some(_) => "The marked margins are those after tuning.",
        None => "The marked margins are the smallest.",
    };
    let mut open = bode("Open loop", caption, &curves, &marks)?;
    requirements(&mut open, view, &[Magnitude::L])?;
    let limit = view.spec.margins.max_sensitivity;
    let disk_margin = (m.disk_margin > 0.0 && m.disk_margin < 2.0).then_some(m.disk_margin);
    let nyquist_marks = NyquistMarks { max_sensitivity_limit: limit, disk_margin, points: vec![] };
    let one = Complex::new(1.0, 0.0);
    let s: Vec<_> = after.open_loop.iter().map(|l| one / (one + l)).collect();
    let t: Vec<_> = after.open_loop.iter().map(|l| l / (one + l)).collect();
    let s_before: Option<Vec<_>> = view.before.map(|b| b.open_loop.iter().map(|l| one / (one + l)).collect());
    let behind = view.before.zip(s_before.as_ref()).map(|(b, s)| (b.name.as_str(), &b.hz[..], &s[..]));
    let mut gang = sensitivity("Sensitivity functions", "", &after.hz, &s, &t, limit, behind)?;
    requirements(&mut gang, view, &[Magnitude::S, Magnitude::T])?;
    let mut curve = nyquist("Nyquist curve", "", &after.hz, &after.open_loop, &nyquist_marks)?;
    if let Some(b) = view.before {
        nyquist_behind(&mut curve, &b.name, &b.hz, &b.open_loop)?;
    }
    let mut blocks = vec![Block::Figure(open), Block::Figure(gang)];
    let mut steps: Vec<(&str, &StepResponses)> = after.steps.iter().map(|s| (after.name.as_str(), s)).collect();
    if steps.is_empty() {
        blocks.push(Block::Figure(curve));
    } else {
        steps.extend(view.before.and_then(|b| b.steps.as_ref().map(|s| (b.name.as_str(), s))));
        let l = &view.spec.limits;
        let asked = StepLimits { overshoot_percent: l.overshoot_percent, settling_s: l.settling_s };
        let drawn = super::steps::steps(&steps, asked, [view.units.position, view.units.command])?;
        blocks.push(Block::Pair(curve, drawn));
    }
    let at_end: Vec<(&str, &MoveRecord)> = std::iter::once(after)
        .chain(view.before)
        .filter_map(|v| v.move_end.as_ref().map(|r| (v.name.as_str(), r)))
        .collect();
    if !at_end.is_empty() {
        blocks.push(Block::Figure(move_end(&at_end, &view.spec.limits.at_end, view.units.position)?));
    }
    if let Some(density) = disturbance(view.spec, after.sample_time_s) {
        blocks.push(Block::Figure(disturbed(after, view.before, &density, view.units.position)?));
    }
    blocks.push(Block::Table(margins_table(m)?));
    blocks.push(Block::Details("All crossings".into(), vec![Block::Table(super::margins::crossings_table(m)?)]));
    if let Some(before) = view.before {
        let table = Block::Table(margins_table(&before.margins)?);
        blocks.push(Block::Details("Margins before tuning".into(), vec![table]));
    }
    Ok(Section { heading: "Loop".into(), blocks })
}

fn pes_section(view: &SlotView<'_>, profile: &Profile) -> Result<Section, ReportError> {
    let heading = "PES of a spiral write".to_owned();
    let Some((run, figures)) = &view.after.write else {
        let notice = Block::Notice(Verdict::Fail, "The closed loop is unstable: there is no PES to show.".into());
        return Ok(Section { heading, blocks: vec![notice] });
    };
    let before = view.before.and_then(|b| b.write.as_ref());
    let blocks = write_blocks(&WriteView {
        profile,
        front: NamedWrite { name: "after", run, figures },
        behind: before.map(|(run, figures)| NamedWrite { name: "before", run, figures }),
        limits: &view.spec.limits,
        bands_hz: &view.spec.objective.bands_hz,
        units: view.units,
    })?;
    Ok(Section { heading, blocks })
}
