//! The page of one simulated write: limits that it keeps or misses, its record, its spectrum, the move.
//!
//! In: the closed loop's record with figures, and what is asked of it. Out: a [`Page`]. Convention: an unstable loop has no figures; the limits of the
//! write alone are judged here, not margins and steps. Spec: `specs/report.md`, `specs/pes.md`.

use super::ReportError;
use super::limit_cards::limit_cards;
use super::number::{MISSING, NumberFormat};
use super::page::{Block, Card, Page, Section};
use super::table::Verdict;
use super::tuned::{figure_words, limits_table};
use super::write::{WriteView, move_figure, write_blocks};
use servotune::tune::{Judged, JudgedLimit};

/// A simulated write.
#[derive(Clone, Debug)]
pub struct SimulatedView<'a> {
    /// The plant.
    pub name: &'a str,
    /// The record; none where the loop is unstable.
    pub write: Option<WriteView<'a>>,
    /// The limits of the write, judged; none where there is no spec.
    pub judged: Option<&'a Judged>,
    /// The spec's own profile is another one.
    pub other_profile: bool,
    /// The command reached the output limit.
    pub limited: bool,
    /// Effects beyond linear that were simulated.
    pub physics: &'a [&'static str],
    /// Inputs with digests, program.
    pub provenance: Vec<(String, String)>,
}

/// Most cards.
const CARDS: usize = 6;

/// The page.
pub fn simulated_page(v: &SimulatedView<'_>) -> Result<Page, ReportError> {
    let mut sections = vec![Section { heading: "Verdict".into(), blocks: verdict(v)? }];
    if let Some(write) = &v.write {
        sections.push(Section { heading: "PES of the write".into(), blocks: write_blocks(write)? });
        let blocks = vec![Block::Figure(move_figure(write)?)];
        sections.push(Section { heading: "Position under the move".into(), blocks });
    }
    Ok(Page {
        title: format!("Simulated write: {}", v.name),
        subtitle: "PES, its spectrum, command and position of one spiral write".into(),
        cards: cards(v),
        sections,
        provenance: v.provenance.clone(),
    })
}

fn verdict(v: &SimulatedView<'_>) -> Result<Vec<Block>, ReportError> {
    let mut blocks = Vec::new();
    let prose = |words: &str| Block::Prose(words.to_owned());
    match (&v.write, v.judged) {
        (None, _) => blocks.push(Block::Notice(
            Verdict::Fail,
            "The closed loop is unstable: a PES has no figures. servotune margins says where.".into(),
        )),
        (Some(_), None) => {
            blocks.push(prose("Nothing was asked of this write; with --spec its limits are drawn and judged."));
        }
        (Some(write), Some(judged)) => {
            let missed = judged.limits.iter().filter(|l| !l.met());
            let names: Vec<String> = missed.map(|l: &JudgedLimit| figure_words(l.wanted.what, write.units).0).collect();
            blocks.push(match (names.is_empty(), judged.limits.is_empty()) {
                (_, true) => prose("The spec has no limit on a write."),
                (true, _) => Block::Notice(Verdict::Ok, "Every limit on the write is met.".into()),
                (false, _) => Block::Notice(Verdict::Fail, format!("Missed: {}.", names.join(", "))),
            });
            if !judged.limits.is_empty() {
                blocks.push(Block::Table(limits_table(None, Some(judged), write.units)?));
            }
            blocks.push(prose(
                "Margins, curves and steps of the spec are judged by servotune tune and proved by servotune verify.",
            ));
        }
    }
    if v.other_profile && v.judged.is_some() {
        let words = "The spec names another profile: its limits were set for that write, not for this one.";
        blocks.push(Block::Notice(Verdict::Warn, words.into()));
    }
    if v.limited {
        let words = "The command reached output_limit: the loop was not linear during the write.";
        blocks.push(Block::Notice(Verdict::Warn, words.into()));
    }
    if !v.physics.is_empty() {
        blocks.push(Block::Prose(format!("Simulated with: {}.", v.physics.join(", "))));
    }
    Ok(blocks)
}

fn cards(v: &SimulatedView<'_>) -> Vec<Card> {
    let short = NumberFormat::Significant(3);
    let Some(write) = &v.write else {
        return vec![Card {
            label: "Closed loop".into(),
            value: "unstable".into(),
            unit: String::new(),
            note: String::new(),
            verdict: Some(Verdict::Fail),
        }];
    };
    let mut all = v.judged.map_or_else(Vec::new, |j| limit_cards(j, write.units));
    all.truncate(CARDS);
    let (run, f) = (write.front.run, write.front.figures);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0f64, |a, x| a.max(x.abs()));
    let error = largest(&mut run.reference.iter().zip(&run.position).map(|(r, y)| r - y));
    let (position, command) = (write.units.position, write.units.command);
    let plain = [
        ("DFT, low band", f.dft_low, position, "600 to 1500 Hz"),
        ("DFT, high band", f.dft_high, position, "1500 to 3000 Hz"),
        ("PES deviation", Some(f.pes_std), position, "of the window"),
        ("PES range", Some(f.pes_range), position, "of the window"),
        ("Command peak", Some(largest(&mut run.command.iter().copied())), command, "of the record"),
        ("Largest error", Some(error), position, "reference - position"),
    ];
    let asked: Vec<String> = all.iter().map(|c| c.label.clone()).collect();
    let more =
        plain.into_iter().filter(|(label, ..)| !asked.iter().any(|a| a == label)).map(|(label, value, unit, note)| {
            Card {
                label: label.into(),
                value: value.map_or_else(|| MISSING.to_owned(), |x| short.page(x)),
                unit: unit.into(),
                note: note.into(),
                verdict: None,
            }
        });
    let room = CARDS - all.len();
    all.extend(more.take(room));
    all
}
