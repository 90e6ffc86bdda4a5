//! A certificate for a terminal: limits with their bounds, margins, and what was found.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use servotune::verify::{
    BoundedFigure, CaseProof, Certificate, LimitVerdict, ProvenLimit, Stability, TableFinding, WriteBox, WriteOpen,
};

/// Columns of a table of limits with what is proved of each.
pub(super) fn proven_columns(digits: NumberFormat) -> Vec<Column> {
    vec![
        Column::words("figure"),
        Column::words("required"),
        Column::numbers("proven low", "", digits),
        Column::numbers("proven high", "", digits),
        Column::numbers("at", "Hz", digits),
        Column::words("unit"),
        Column::words("verdict"),
    ]
}

/// One table a machine, then the findings and the verdict.
pub fn certificate_text(c: &Certificate) -> Result<String, ReportError> {
    let digits = NumberFormat::Significant(6);
    let mut text = String::new();
    for (i, case) in c.cases.iter().enumerate() {
        let stability = stability_words(case.bounds.stability);
        let count = case.bounds.encirclements.map_or("not counted".to_owned(), |n| n.to_string());
        text += &format!(
            "Machine {} ({}): {stability}; encirclements of -1: {count}; {} cells.\n",
            i + 1,
            case.sha256.get(..12).unwrap_or_default(),
            case.bounds.cells
        );
        let mut table = Table::new("Bounds that hold at every frequency", proven_columns(digits));
        for l in &case.limits {
            let side = if l.side == "at_least" { "at least" } else { "at most" };
            let verdict = match l.verdict {
                LimitVerdict::Proved => "proved",
                LimitVerdict::Violated => "VIOLATED",
                LimitVerdict::NotProved => "NOT PROVED",
            };
            table.push(vec![
                l.name.as_str().into(),
                format!("{side} {}", l.required).as_str().into(),
                l.proven.low.into(),
                l.proven.high.into(),
                l.proven.hz.into(),
                l.unit.as_str().into(),
                verdict.into(),
            ])?;
        }
        let b = &case.bounds;
        let us =
            |x: BoundedFigure| BoundedFigure { low: x.low.map(|s| s * 1e6), high: x.high.map(|s| s * 1e6), hz: x.hz };
        for (name, x, unit) in [
            ("modulus margin", b.modulus_margin, "ratio"),
            ("delay margin", us(b.delay_margin_s), "us"),
            ("disk margin", b.disk_margin, "ratio"),
        ] {
            table.push(vec![
                name.into(),
                "".into(),
                x.low.into(),
                x.high.into(),
                x.hz.into(),
                unit.into(),
                "".into(),
            ])?;
        }
        text += &table.text();
        text += &case.write_box.as_ref().map_or(String::new(), |w| write_line(w) + "\n");
        for s in &case.sweep_again {
            text += &format!(
                "Too coarse to promise: sweep {:.1} to {:.1} Hz again, points at most {:.3} Hz apart.\n",
                s.low_hz, s.high_hz, s.spacing_hz
            );
        }
        text.push('\n');
    }
    for said in sentences(&c.findings) {
        text += &format!("{said}\n");
    }
    text += if c.proved { "Proved.\n" } else { "NOT PROVED.\n" };
    Ok(text)
}

/// The verdict in a sentence: what is not proved, by how much, and what to sweep again.
pub fn certificate_sentence(c: &Certificate) -> String {
    if c.proved {
        return "Proved: every limit holds at every frequency.".into();
    }
    let mut parts = Vec::new();
    let many = c.cases.len() > 1;
    for (i, case) in c.cases.iter().enumerate() {
        let of = if many { format!("machine {}: ", i + 1) } else { String::new() };
        match case.bounds.stability {
            Stability::Stable => {}
            Stability::Unstable => parts.push(format!("{of}the loop is unstable")),
            Stability::Undecided => parts.push(format!("{of}stability is not proved")),
        }
        for l in case.limits.iter().filter(|l| l.verdict != LimitVerdict::Proved) {
            let side = if l.side == "at_least" { "at least" } else { "at most" };
            let proven = open_reason(c, case, l);
            // A certificate keeps the field of the plant file in which the unit stands; a sentence says what it means.
            let unit = match l.unit.as_str() {
                "position_unit" => "position units",
                "command_unit" => "command units",
                unit => unit,
            };
            parts.push(format!("{of}{} {side} {} {unit} ({proven})", l.name, l.required));
        }
        parts.extend(case.sweep_again.iter().map(|s| {
            format!(
                "{of}sweep {:.1} to {:.1} Hz again, points at most {:.3} Hz apart",
                s.low_hz, s.high_hz, s.spacing_hz
            )
        }));
    }
    parts.extend(sentences(&c.findings).into_iter().map(|s| s.trim_end_matches('.').to_owned()));
    format!("Not proved: {}.", parts.join("; "))
}

/// What is proved of a limit that is not, or why nothing is.
pub(super) fn open_reason(c: &Certificate, case: &CaseProof, l: &ProvenLimit) -> String {
    let (end, way) = match l.side.as_str() {
        "at_least" => (l.proven.low, "at least"),
        _ => (l.proven.high, "at most"),
    };
    let over_box = case.write_box.as_ref().filter(|w| w.open.is_some() && l.proven.low.is_some());
    match (end, over_box) {
        (Some(x), _) => format!("{way} {x:.4} is proved"),
        (None, Some(w)) if l.side == "at_most" => write_line(w).trim_end_matches('.').to_owned(),
        _ if c.sweep.is_some() && case.write.is_none() && l.proven.high.is_none() => {
            "a sweep alone does not prove it".into()
        }
        _ if c.uncertainty.any() && l.proven.low.is_some() => "no bound over a box".into(),
        _ => "no bound is proved".into(),
    }
}

/// Stability in words.
pub(super) fn stability_words(s: Stability) -> &'static str {
    match s {
        Stability::Stable => "stable",
        Stability::Unstable => "UNSTABLE",
        Stability::Undecided => "not proved stable",
    }
}

/// What was done for the write over a box, or why there is no bound.
pub(super) fn write_line(w: &WriteBox) -> String {
    match w.open {
        None => format!("The write is bounded over the whole box, in {} pieces.", w.boxes),
        Some(why) => {
            let why = match why {
                WriteOpen::NotProvedStable => "the box is not proved stable",
                WriteOpen::MayClip => "a member may reach output_limit",
                WriteOpen::NoDecay => "a pair of the plant's poles does not decay",
                WriteOpen::ShallowRollOff => "the plant falls with less than 1/s²",
                WriteOpen::TooLong => "the record is too long",
            };
            format!("The write has no bound over the box: {why}.")
        }
    }
}

/// Findings in words. Figures found on other files differ for that reason alone, and are counted in one sentence.
pub fn sentences(findings: &[TableFinding]) -> Vec<String> {
    let others = findings.iter().any(|f| matches!(f, TableFinding::Digest { .. }));
    let kept = |f: &&TableFinding| !(others && matches!(f, TableFinding::Figure { .. }));
    let mut said: Vec<String> = findings.iter().filter(kept).map(sentence).collect();
    let left = findings.len() - said.len();
    if left > 0 {
        said.push(format!("Its [after] is of those files: {left} of its figures are not what is proved here."));
    }
    said
}

/// A finding in words.
pub fn sentence(f: &TableFinding) -> String {
    let number = |x: &Option<f64>| x.map_or("none".to_owned(), |x| x.to_string());
    match f {
        TableFinding::Count { found, expected } => {
            format!("Changed: {found} [[section]] rows, but the gains make {expected}.")
        }
        TableFinding::Section { index, key, found, expected } => {
            format!("Changed: [[section]] {index}: {key} = {found}, but the gains make {expected}.")
        }
        TableFinding::Figure { name, stated, proven } => format!(
            "Changed: [after] {name} = {}, but {} to {} is proved.",
            number(stated),
            number(&proven.low),
            number(&proven.high)
        ),
        TableFinding::Digest { role, stated } => {
            format!("Another {role}: the table was made from the one with SHA-256 {stated}.")
        }
        TableFinding::Certificate { path, stated, proven } => {
            format!("The certificate does not hold: {path} = {stated}, the proof gives {proven}.")
        }
    }
}
