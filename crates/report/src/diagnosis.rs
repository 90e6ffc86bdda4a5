//! The page of a diagnosis: what the machine does that the model does not, how sure that is, and whether the model now fits.
//!
//! In: a [`Diagnosed`]. Out: a [`Page`]. Convention: the first lines are for the person at the machine, the pictures for the
//! engineer; every error is recorded less simulated position. Spec: `specs/mismatch.md`.

use super::diagnosis_chance::chance_blocks;
use super::diagnosis_curve::curve_section;
use super::diagnosis_error::{error_figure, spectrum_figure};
use super::diagnosis_law::{amplitude_figure, law_figures, unexplained_figure};
use super::diagnosis_place::{Map, time_map, zone_map};
use super::diagnosis_rules::rules_block;
use super::diagnosis_shown::{Shown, figures, short, words};
use super::diagnosis_tables::{confirmed_table, log_blocks, noise_table, records_table, search_blocks, where_table};
use super::number::NumberFormat;
use super::page::{Block, Card, Page, Section};
use super::table::{Cell, Column, Table, Verdict as Badge};
use super::{Figure, ReportError};
use servotune::diagnose::{Diagnosed, Finding, Simulation, Verdict};
use servotune::physics::facts;

/// The record to draw: the hold-out record that the given model misses most, else the fit record.
fn drawn(made: &Diagnosed) -> usize {
    let records = &made.diagnosis.fit.records;
    let worst = |role: &str| {
        (0..records.len())
            .filter(|&i| records[i].role == role)
            .max_by(|&a, &b| records[a].rms_before.total_cmp(&records[b].rms_before))
    };
    worst("holdout").or_else(|| worst("fit")).unwrap_or(0)
}

/// The page of a diagnosis; `provenance` names inputs and program.
pub fn diagnosis_page(made: &Diagnosed, provenance: Vec<(String, String)>) -> Result<Page, ReportError> {
    let shown =
        Shown { made, position: &made.refitted.position_unit, command: &made.refitted.command_unit, run: drawn(made) };
    let d = &made.diagnosis;
    let (badge, sentence) = verdict(made, shown.position);
    let mut first = vec![Block::Notice(badge, sentence)];
    first.extend(d.findings.iter().map(|f| Block::Prose(said(f))));
    first.extend(rules_block(&shown)?);
    let mut sections = vec![Section { heading: "Verdict".into(), blocks: first }];
    if !d.findings.is_empty() {
        sections.push(findings_section(&shown)?);
    }
    sections.extend(curve_section(d.free_form.as_ref())?);
    sections.push(next_section(&shown));
    sections.push(fit_section(&shown)?);
    sections.push(place_section(&shown)?);
    let laws = law_section(&shown)?;
    if !laws.blocks.is_empty() {
        sections.push(laws);
    }
    let mut search = search_blocks(&shown)?;
    search.extend(confirmed_table(&shown)?.map(Block::Table));
    search.extend(chance_blocks(&shown)?);
    sections.push(Section { heading: "The search".into(), blocks: search });
    let mut logs = log_blocks(&shown)?;
    logs.push(Block::Table(noise_table(&shown)?));
    logs.extend(d.remarks.iter().map(|r| Block::Prose(r.clone())));
    sections.push(Section { heading: "Logs and noise".into(), blocks: logs });
    Ok(Page {
        title: format!("Diagnosis: {}", d.id),
        subtitle: "Where simulation and machine differ, and the physics that was left out".into(),
        cards: cards(&shown),
        sections,
        provenance,
    })
}

/// The verdict in words, for a terminal.
pub fn diagnosis_sentence(made: &Diagnosed) -> String {
    verdict(made, &made.refitted.position_unit).1.replace('\u{2212}', "-")
}

/// The verdict for a person at the machine, and whether one can go on with it.
fn verdict(made: &Diagnosed, unit: &str) -> (Badge, String) {
    let d = &made.diagnosis;
    let f = figures(made);
    let which = if d.fit.holdout.is_some() { "records never used for the fit" } else { "the fitted records" };
    let [before, after, floor] = [f.rms_before, f.rms_after, f.noise_floor].map(short);
    let goes = match f.rms_after == f.rms_before {
        true => format!("the error stays {after} {unit} rms, no part of the model being changed"),
        false => format!("the error goes from {before} to {after} {unit} rms"),
    };
    let falls = format!("On {which} {goes}; the noise alone is {floor} {unit}.");
    let names: Vec<String> = d.findings.iter().map(|f| words(&f.effect)).collect();
    match d.verdict {
        Verdict::NoMismatch => {
            (Badge::Ok, "The model agrees with the machine down to the noise: nothing is missing.".into())
        }
        Verdict::Refit if !d.coupling.is_empty() => {
            let inputs: Vec<&str> = d.coupling.iter().map(|c| c.input.as_str()).collect();
            let text = format!("The linear model lacked what {} move, or numbers of it were off", inputs.join(" and "));
            (Badge::Warn, format!("{text}; no physics is missing. {falls}"))
        }
        Verdict::Refit => (
            Badge::Warn,
            format!("Numbers of the linear model were off and have been refitted; no physics is missing. {falls}"),
        ),
        Verdict::DataFault => (
            Badge::Fail,
            "The log is wrong, not the machine: repair the log and record again before the model is blamed.".into(),
        ),
        Verdict::Named => {
            (Badge::Warn, format!("The machine does something that the model lacks: {}. {falls}", names.join(" and ")))
        }
        Verdict::Family => {
            let family = d.findings.first().map_or(Vec::new(), |f| f.family.iter().map(|n| words(n)).collect());
            let text = "The machine does something that the model lacks; these records do not tell which of";
            (Badge::Warn, format!("{text}: {}. {falls}", family.join(", ")))
        }
        Verdict::LocatedUnexplained => {
            let text = "Model and machine differ, and it is known where, but no effect of the library explains it.";
            match &d.free_form {
                Some(curve) => (Badge::Warn, format!("{text} {} {falls}", curve.says)),
                None => (Badge::Fail, format!("{text} {falls}")),
            }
        }
        Verdict::Undecidable => (
            Badge::Warn,
            "These records cannot show whether the model is right: record what is asked for below.".into(),
        ),
    }
}

/// One finding in a paragraph.
fn said(f: &Finding) -> String {
    format!("{}: {}.", capital(&words(&f.effect)), f.says.trim_end_matches('.'))
}

fn capital(text: &str) -> String {
    let mut all = text.chars();
    all.next().map_or_else(String::new, |c| c.to_uppercase().chain(all).collect())
}

fn cards(s: &Shown) -> Vec<Card> {
    let f = figures(s.made);
    let what = if s.made.diagnosis.fit.holdout.is_some() { "Hold-out" } else { "Fit" };
    let times = |rms: f64| {
        if f.noise_floor > 0.0 && rms.is_finite() {
            format!("{} times the noise", NumberFormat::Significant(3).page(rms / f.noise_floor))
        } else {
            String::new()
        }
    };
    let card = |label: String, value: f64, note: String, verdict| Card {
        label,
        value: short(value),
        unit: s.position.into(),
        note,
        verdict,
    };
    // A fifth above the floor is what the spread of repeats allows; the same bound as in the verdict.
    let good = if f.rms_after <= 1.2 * f.noise_floor { Badge::Ok } else { Badge::Warn };
    let share = Card {
        label: "Explained".into(),
        value: NumberFormat::Decimals(1).page(100.0 * f.explained_share),
        unit: "%".into(),
        note: "of what is above the noise".into(),
        verdict: None,
    };
    vec![
        card(format!("{what} rms, as given"), f.rms_before, times(f.rms_before), None),
        card("After a linear refit".into(), f.rms_refit_linear, times(f.rms_refit_linear), None),
        card(capital(s.models()[2]), f.rms_after, times(f.rms_after), Some(good)),
        card("Noise floor rms".into(), f.noise_floor, "one record".into(), None),
        share,
    ]
}

fn findings_section(s: &Shown) -> Result<Section, ReportError> {
    let d = &s.made.diagnosis;
    let columns = ["Effect", "Part of the machine", "Not told apart from"].map(Column::words);
    let chance = Column::words("Chance under noise alone");
    let mut list = Table::new("Findings, strongest first", columns.into_iter().chain([chance]).collect());
    let mut numbers = Table::new(
        "Their numbers, with 95 % intervals",
        vec![
            Column::words("Parameter"),
            Column::numbers("Value", "", NumberFormat::Significant(5)),
            Column::numbers("From", "", NumberFormat::Significant(5)),
            Column::numbers("To", "", NumberFormat::Significant(5)),
            Column::words("Unit"),
            Column::words("Effect"),
        ],
    );
    for f in &d.findings {
        let port = serde_json::to_value(f.port).ok();
        let port = port.as_ref().and_then(|v| v.as_str()).unwrap_or_default().to_owned();
        let others: Vec<String> = f.family.iter().filter(|n| **n != f.effect).map(|n| words(n)).collect();
        let others = if others.is_empty() { "nothing: told apart".to_owned() } else { others.join(", ") };
        let p = if f.p_value <= 1.1e-300 {
            "below 1e\u{2212}300".into()
        } else {
            NumberFormat::Significant(2).page(f.p_value)
        };
        list.push(vec![
            words(&f.effect).as_str().into(),
            port.as_str().into(),
            others.as_str().into(),
            p.as_str().into(),
        ])?;
        for (name, e) in &f.parameters {
            // A number that was set, not estimated, has no interval.
            let known = e.low < e.high;
            let end = |v: f64| Cell::from(known.then_some(v));
            let unit = if e.unit == "1" { "" } else { &e.unit };
            numbers.push(vec![
                words(name.strip_suffix("_deg").unwrap_or(name)).as_str().into(),
                e.value.into(),
                end(e.low),
                end(e.high),
                unit.into(),
                words(&f.effect).as_str().into(),
            ])?;
        }
    }
    let mut blocks = vec![Block::Table(list)];
    for f in &d.findings {
        if let Some(x) = facts(&f.effect) {
            blocks.push(Block::Prose(format!("Law of {}: {}", words(&f.effect), x.equation)));
        }
    }
    if !numbers.is_empty() {
        blocks.push(Block::Table(numbers));
    }
    blocks.push(Block::Table(where_table(s)?));
    Ok(Section { heading: "Findings".into(), blocks })
}

fn next_section(s: &Shown) -> Section {
    let next = &s.made.diagnosis.next_experiment;
    let mut blocks = vec![Block::Prose(format!("{}.", capital(next.what.replace('`', "").trim_end_matches('.'))))];
    if next.expected_separation > 0.0 {
        // Beyond a million the number only says that one of the two simulations runs away.
        let sure = 1e6;
        let found = NumberFormat::Significant(3).page(next.expected_separation.min(sure));
        let found = if next.expected_separation > sure { format!("more than {found}") } else { found };
        blocks.push(Block::Prose(format!(
            "Expected separation: {found} (twice the difference of log-likelihood between the model found and its \
             strongest rival; above some 20 one record decides)."
        )));
    }
    Section { heading: "What to record next".into(), blocks }
}

fn fit_section(s: &Shown) -> Result<Section, ReportError> {
    let how = match s.made.diagnosis.fit.simulation {
        Simulation::ClosedLoop => "Simulated in closed loop, from reference and excitation through the controller.",
        Simulation::OpenLoop => "Simulated in open loop, from the recorded command.",
    };
    let mut blocks = vec![
        Block::Prose(how.into()),
        Block::Figure(error_figure(s)?),
        Block::Figure(spectrum_figure(s)?),
        Block::Table(records_table(s)?),
    ];
    if let Some(open) =
        s.made.diagnosis.fit.open_loop.as_ref().filter(|_| s.made.diagnosis.fit.simulation == Simulation::ClosedLoop)
    {
        blocks.push(Block::Prose(format!(
            "Feedback hides errors. From the recorded command alone the error is {} {u} rms as given, {} after the linear \
             refit and {} with the corrected model; there the noise alone makes {}.",
            short(open.rms_before),
            short(open.rms_refit_linear),
            short(open.rms_after),
            short(open.noise_floor),
            u = s.position
        )));
    }
    Ok(Section { heading: "Before and after".into(), blocks })
}

fn place_section(s: &Shown) -> Result<Section, ReportError> {
    let map = Map::of(s);
    Ok(Section {
        heading: "Where it shows".into(),
        blocks: vec![Block::Figure(time_map(s, &map)?), Block::Figure(zone_map(s, &map)?)],
    })
}

fn law_section(s: &Shown) -> Result<Section, ReportError> {
    let mut blocks: Vec<Block> = law_figures(s)?.into_iter().map(Block::Figure).collect();
    let more: [Option<Figure>; 2] = [amplitude_figure(s)?, unexplained_figure(s)?];
    blocks.extend(more.into_iter().flatten().map(Block::Figure));
    Ok(Section { heading: "The law behind it".into(), blocks })
}
