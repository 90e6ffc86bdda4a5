//! A whole report as one HTML file that needs nothing else: no network, no other file, not even its own script.
//!
//! In: words, tables and figures. Out: text to be written to a `.html` file. Convention: every text is escaped; the
//! same page is the same bytes. Spec: `specs/report.md`.

use super::escape::harmful;
use super::figure::Figure;
use super::html::{figure, script, style};
use super::svg::Size;
use super::table::{Table, Verdict};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A report.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// What the report is about.
    pub title: String,
    /// Which machine, slot or run.
    pub subtitle: String,
    /// The figures of merit, above all else.
    pub cards: Vec<Card>,
    /// The body.
    pub sections: Vec<Section>,
    /// Where all this comes from, as (name, value): inputs with digests, program, seed.
    pub provenance: Vec<(String, String)>,
}

/// One figure of merit.
#[derive(Clone, Debug, PartialEq)]
pub struct Card {
    /// What it is.
    pub label: String,
    /// Its value, already formatted.
    pub value: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// What it is compared with, such as "at least 35"; may be empty.
    pub note: String,
    /// Whether it is as it should be; `None` where nothing is asked.
    pub verdict: Option<Verdict>,
}

/// A part of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// What is in it.
    pub blocks: Vec<Block>,
}

/// One thing in a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A paragraph.
    Prose(String),
    /// A paragraph that stands out.
    Notice(Verdict, String),
    /// A table.
    Table(Table),
    /// A figure over the whole width.
    Figure(Figure),
    /// Two figures side by side where there is room.
    Pair(Figure, Figure),
    /// Text as a machine would read it, such as a gain file.
    Code(String),
    /// Something to open: its heading and what is inside.
    Details(String, Vec<Block>),
}

impl Page {
    /// The page as HTML.
    pub fn html(&self) -> String {
        let mut count = 0;
        let sections: Vec<Markup> =
            self.sections.iter().enumerate().map(|(index, s)| section(s, index + 1, &mut count)).collect();
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    // A later run may replace a page of this program, and no other.
                    meta name="generator" content="servotune";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    // Nothing may be fetched, whatever an input was called.
                    meta http-equiv="Content-Security-Policy"
                        content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) @if !self.subtitle.is_empty() { " – " (self.subtitle) } }
                    style { (PreEscaped(style())) }
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            @if !self.subtitle.is_empty() { p.subtitle { (self.subtitle) } }
                        }
                        @if !self.cards.is_empty() { (cards(&self.cards)) }
                        @if self.sections.len() > 2 { (contents(&self.sections)) }
                        @if count > 0 {
                            p.hint {
                                "Figures: drag to zoom, double-click for the whole view, Shift-drag to move; the wheel zooms once "
                                "a figure has been clicked. On a touch screen, pinch. Point at a curve to read it; over "
                                "frequency the other pictures of its section show the same place. Click a legend entry to "
                                "hide its curve."
                            }
                        }
                        @for section in &sections { (section) }
                    }
                    footer { (provenance(&self.provenance)) }
                    script { (PreEscaped(script())) }
                }
            }
        };
        page.into_string().replace(harmful, "\u{fffd}")
    }
}

fn cards(cards: &[Card]) -> Markup {
    html! {
        section aria-label="Summary" {
            dl.cards {
                @for card in cards {
                    div class={ "card " (card.verdict.map_or("plain", Verdict::class)) } {
                        dt { (card.label) }
                        dd.value {
                            (card.value) @if !card.unit.is_empty() { " " span.unit { (card.unit) } }
                        }
                        dd.note {
                            @if let Some(verdict) = card.verdict { span class={ "badge " (verdict.class()) } { (verdict.word()) } " " }
                            (card.note)
                        }
                    }
                }
            }
        }
    }
}

fn contents(sections: &[Section]) -> Markup {
    html! {
        nav aria-label="Contents" {
            ul {
                @for (index, section) in sections.iter().enumerate() {
                    li { a href={ "#s" (index + 1) } { (section.heading) } }
                }
            }
        }
    }
}

fn section(section: &Section, number: usize, count: &mut usize) -> Markup {
    let blocks: Vec<Markup> = section.blocks.iter().map(|b| block(b, count)).collect();
    html! {
        section id={ "s" (number) } {
            h2 { (section.heading) }
            @for block in &blocks { (block) }
        }
    }
}

fn block(found: &Block, count: &mut usize) -> Markup {
    let mut draw = |f: &Figure, size: Size| {
        *count += 1;
        figure(f, *count, size)
    };
    match found {
        Block::Prose(text) => html! { p { (text) } },
        Block::Notice(verdict, text) => html! {
            p class={ "notice " (verdict.class()) } { span class={ "badge " (verdict.class()) } { (verdict.word()) } " " (text) }
        },
        Block::Table(table) => table.markup(),
        Block::Figure(f) => draw(f, Size::WIDE),
        Block::Pair(left, right) => {
            let (left, right) = (draw(left, Size::HALF), draw(right, Size::HALF));
            html! { div.pair { (left) (right) } }
        }
        Block::Code(text) => html! { pre tabindex="0" { code { (text) } } },
        Block::Details(summary, blocks) => {
            let inside: Vec<Markup> = blocks.iter().map(|b| block(b, count)).collect();
            html! { details { summary { (summary) } @for block in &inside { (block) } } }
        }
    }
}

fn provenance(rows: &[(String, String)]) -> Markup {
    html! {
        @if !rows.is_empty() {
            h2 { "Provenance" }
            dl.provenance {
                @for (name, value) in rows { div { dt { (name) } dd { (value) } } }
            }
        }
    }
}
