//! The page of a certificate: what is proved of every limit on every machine, what is left open and why, the box and what is taken for granted.
//!
//! In: a [`Certificate`] with a name for each machine. Out: a [`Page`]. Convention: room is the share of the limit by which a figure keeps it,
//! below 0 where it misses it; nothing but "proved" is green. Spec: `specs/report.md`, `specs/certificate.md`.

use super::ReportError;
use super::certificate::{certificate_sentence, open_reason, proven_columns, sentences, stability_words, write_line};
use super::limit_cards::first_upper;
use super::number::{MISSING, NumberFormat, typographic};
use super::page::{Block, Card, Page, Section};
use super::proven_limit::{in_words, name, word};
use super::proven_room::{room, room_figure};
use super::table::{Cell, Column, Table, Verdict};
use super::tuned::Units;
use servotune::verify::{BoundedFigure, CaseProof, Certificate, LimitVerdict as Proven, ProvenLimit, Stability, Word};

/// A certificate with the names that it does not hold itself.
#[derive(Clone, Debug)]
pub struct CertificateView<'a> {
    /// The gain table.
    pub name: &'a str,
    /// The certificate.
    pub certificate: &'a Certificate,
    /// A name for each of its cases, in order.
    pub machines: &'a [String],
    /// Units of position and command.
    pub units: Units<'a>,
    /// Inputs with digests, program.
    pub provenance: Vec<(String, String)>,
}

/// Machines beyond which their tables are folded.
const OPEN: usize = 3;
const DIGITS: NumberFormat = NumberFormat::Significant(5);

/// The page.
pub fn certificate_page(v: &CertificateView<'_>) -> Result<Page, ReportError> {
    let c = v.certificate;
    let verdict = overall(c);
    let mut blocks = vec![Block::Notice(verdict, certificate_sentence(c))];
    blocks.extend(sentences(&c.findings).into_iter().map(|said| Block::Notice(Verdict::Fail, said)));
    blocks.push(Block::Table(side_by_side(v)?));
    if let Some(figure) = room_figure(c, &|i| machine_name(v, i))? {
        blocks.push(Block::Figure(figure));
    }
    let mut machines = Vec::new();
    for (i, case) in c.cases.iter().enumerate() {
        let blocks = case_blocks(v, case)?;
        let heading = format!("Machine {}: {}", i + 1, machine_name(v, i));
        match c.cases.len() <= OPEN {
            true => machines.push(Section { heading, blocks }),
            false => {
                machines.push(Section { heading: "Machines".into(), blocks: vec![Block::Details(heading, blocks)] })
            }
        }
    }
    if c.cases.len() > OPEN {
        let blocks = machines.into_iter().flat_map(|s| s.blocks).collect();
        machines = vec![Section { heading: "Machines".into(), blocks }];
    }
    let mut sections = vec![Section { heading: "Verdict".into(), blocks }];
    sections.append(&mut machines);
    sections.push(Section { heading: "The box, and what is taken for granted".into(), blocks: granted(c)? });
    Ok(Page {
        title: format!("Certificate: {}", v.name),
        subtitle: "Every limit with bounds that hold at every frequency".into(),
        cards: cards(v, verdict),
        sections,
        provenance: v.provenance.clone(),
    })
}

/// Green only where everything is proved; red where something is known to be wrong.
fn overall(c: &Certificate) -> Verdict {
    let wrong = |case: &CaseProof| {
        case.bounds.stability == Stability::Unstable || case.limits.iter().any(|l| l.verdict == Proven::Violated)
    };
    match c.proved {
        true => Verdict::Ok,
        false if !c.findings.is_empty() || c.cases.iter().any(wrong) => Verdict::Fail,
        false => Verdict::Warn,
    }
}

fn machine_name(v: &CertificateView<'_>, i: usize) -> String {
    let digest = || v.certificate.cases.get(i).and_then(|c| c.sha256.get(..12)).unwrap_or_default().to_owned();
    v.machines.get(i).cloned().unwrap_or_else(digest)
}

/// A certificate keeps the field of the plant file in which the unit stands.
fn unit<'a>(v: &CertificateView<'a>, unit: &'a str) -> &'a str {
    match unit {
        "position_unit" => v.units.position,
        "command_unit" => v.units.command,
        other => other,
    }
}

fn required(l: &ProvenLimit) -> String {
    let side = if l.side == "at_least" { "at least" } else { "at most" };
    format!("{side} {}", typographic(&l.required.to_string()))
}

fn cards(v: &CertificateView<'_>, verdict: Verdict) -> Vec<Card> {
    let c = v.certificate;
    let limits = || c.cases.iter().flat_map(|case| &case.limits);
    let (proved, all) = (limits().filter(|l| l.verdict == Proven::Proved).count(), limits().count());
    let stability = c.cases.iter().map(|case| case.bounds.stability);
    let stability = stability.max_by_key(|s| match s {
        Stability::Stable => 0,
        Stability::Undecided => 1,
        Stability::Unstable => 2,
    });
    let of_stability = |s| match s {
        Stability::Stable => Verdict::Ok,
        Stability::Undecided => Verdict::Warn,
        Stability::Unstable => Verdict::Fail,
    };
    let worst = limits().filter_map(|l| room(l)[0].map(|x| (x, l))).min_by(|a, b| a.0.total_cmp(&b.0));
    let card = |label: &str, value: String, unit: &str, note: String, verdict| Card {
        label: label.into(),
        value,
        unit: unit.into(),
        note,
        verdict,
    };
    let machines = match c.cases.len() {
        1 => "on one machine".to_owned(),
        n => format!("on every one of {n} machines"),
    };
    let open = all - proved;
    let not_all = if limits().any(|l| l.verdict == Proven::Violated) { Verdict::Fail } else { Verdict::Warn };
    vec![
        card("Certificate", if c.proved { "proved" } else { "not proved" }.into(), "", machines, Some(verdict)),
        card(
            "Limits proved",
            format!("{proved} of {all}"),
            "",
            if open == 0 { "none is left open".into() } else { format!("{open} not proved") },
            Some(if open == 0 { Verdict::Ok } else { not_all }),
        ),
        card(
            "Closed loop",
            stability.map_or(MISSING, stability_words).to_lowercase(),
            "",
            if c.uncertainty.any() { "every member of every box" } else { "as the plants stand" }.into(),
            stability.map(of_stability),
        ),
        card(
            "Least room proved",
            worst.map_or_else(|| MISSING.to_owned(), |(x, _)| NumberFormat::Decimals(2).page(100.0 * x)),
            "%",
            worst.map_or_else(String::new, |(_, l)| format!("to {}, {}", in_words(&l.name), required(l))),
            worst.filter(|(_, l)| l.verdict != Proven::Proved).map(|(_, l)| word(l.verdict).0),
        ),
    ]
}

/// Limits down, machines across.
fn side_by_side(v: &CertificateView<'_>) -> Result<Table, ReportError> {
    let c = v.certificate;
    let mut columns = vec![Column::words("limit"), Column::words("required"), Column::words("unit")];
    columns.extend((0..c.cases.len()).map(|i| Column::words(&machine_name(v, i))));
    let mut table = Table::new("Proven intervals, machine by machine", columns);
    let Some(first) = c.cases.first() else { return Ok(table) };
    for (row, l) in first.limits.iter().enumerate() {
        let mut cells = vec![name(first, l).as_str().into(), required(l).as_str().into(), unit(v, &l.unit).into()];
        cells.extend(c.cases.iter().map(|case| {
            case.limits.get(row).map_or(Cell::from(""), |l| {
                let (verdict, said) = word(l.verdict);
                Cell::from(interval(l.proven).as_str()).flagged(verdict, said)
            })
        }));
        table.push(cells)?;
    }
    Ok(table)
}

fn interval(b: BoundedFigure) -> String {
    match (b.low, b.high) {
        (Some(low), Some(high)) if DIGITS.text(low) == DIGITS.text(high) => DIGITS.page(low),
        (Some(low), Some(high)) => format!("{} to {}", DIGITS.page(low), DIGITS.page(high)),
        (Some(low), None) => format!("{} and above", DIGITS.page(low)),
        (None, Some(high)) => format!("{} and below", DIGITS.page(high)),
        (None, None) => "no bound".into(),
    }
}

fn case_blocks(v: &CertificateView<'_>, case: &CaseProof) -> Result<Vec<Block>, ReportError> {
    let b = &case.bounds;
    let count = b.encirclements.map_or("not counted".to_owned(), |n| n.to_string());
    let mut blocks = vec![Block::Prose(format!(
        "The closed loop is {}; encirclements of -1: {count}; {} cells of frequency looked at.",
        stability_words(b.stability),
        b.cells
    ))];
    let mut columns = proven_columns(DIGITS);
    let some_open = case.limits.iter().any(|l| l.verdict == Proven::NotProved);
    if some_open {
        columns.push(Column::words("left open"));
    }
    let mut table = Table::new("Bounds that hold at every frequency", columns);
    for l in &case.limits {
        let (verdict, said) = word(l.verdict);
        let mut open = String::new();
        if l.verdict == Proven::NotProved {
            open = open_reason(v.certificate, case, l);
        }
        let mut row = vec![
            in_words(&l.name).as_str().into(),
            required(l).as_str().into(),
            l.proven.low.into(),
            l.proven.high.into(),
            l.proven.hz.into(),
            unit(v, &l.unit).into(),
            Cell::from("").flagged(verdict, said),
        ];
        row.extend(some_open.then(|| open.as_str().into()));
        table.push(row)?;
    }
    let us = |x: BoundedFigure| BoundedFigure { low: x.low.map(|s| s * 1e6), high: x.high.map(|s| s * 1e6), hz: x.hz };
    for (name, x, unit) in [
        ("modulus margin", b.modulus_margin, "ratio"),
        ("delay margin", us(b.delay_margin_s), "us"),
        ("disk margin", b.disk_margin, "ratio"),
    ] {
        let [low, high, hz] = [x.low, x.high, x.hz].map(Cell::from);
        let mut row = vec![name.into(), "".into(), low, high, hz, unit.into(), "".into()];
        row.extend(some_open.then(|| "".into()));
        table.push(row)?;
    }
    blocks.push(Block::Table(table));
    blocks.extend(case.write_box.as_ref().map(|w| Block::Prose(write_line(w))));
    blocks.extend(case.sweep_again.iter().map(|s| {
        let words = format!(
            "Too coarse to promise: sweep {:.1} to {:.1} Hz again, points at most {:.3} Hz apart.",
            s.low_hz, s.high_hz, s.spacing_hz
        );
        Block::Notice(Verdict::Warn, words)
    }));
    Ok(blocks)
}

/// The box, the word, and what the proof assumes.
fn granted(c: &Certificate) -> Result<Vec<Block>, ReportError> {
    let mut table = Table::new(
        "What may differ from the files",
        vec![Column::words("quantity"), Column::words("share"), Column::words("means")],
    );
    let u = c.uncertainty;
    for (name, share, means) in [
        ("gain", u.gain, "of the plant"),
        ("frequency", u.frequency, "of the body and of every mode, zero and pole together"),
        ("damping", u.damping, "every damping ratio on its own"),
        ("delay", u.delay, "of the dead time"),
    ] {
        let said = match share > 0.0 {
            true => format!("\u{b1} {} %", NumberFormat::Significant(3).page(100.0 * share)),
            false => "as in the file".to_owned(),
        };
        table.push(vec![name.into(), said.as_str().into(), means.into()])?;
    }
    let held = match c.word {
        Word::Double => "double precision".to_owned(),
        Word::Single => "single precision, rounded to nearest".to_owned(),
        Word::Fixed { bits, fraction } => format!("{bits} bits, {fraction} of them behind the point"),
    };
    table.push(vec!["coefficients".into(), "as held".into(), held.as_str().into()])?;
    let mut blocks = vec![Block::Table(table), Block::Prose("Taken for granted:".into())];
    blocks.extend(c.assumptions.iter().map(|a| Block::Prose(first_upper(a) + ".")));
    Ok(blocks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_but_proved_is_green() {
        assert_eq!(
            [Proven::Proved, Proven::Violated, Proven::NotProved].map(|p| word(p).0 == Verdict::Ok),
            [true, false, false]
        );
    }
}
