//! Whatever an input is called, a page is well formed, fetches nothing, and runs only its own script.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune_report::figure::{Axis, Circle, Figure, Ink, Kind, Mark, Note, Panel, Region, RuleLine, Series};
use servotune_report::number::NumberFormat;
use servotune_report::page::{Block, Card, Page, Section};
use servotune_report::svg::{Size, standalone};
use servotune_report::table::{Cell, Column, Table, Verdict};
use std::collections::BTreeSet;

const NASTY: &str =
    "a</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&amp;<!-- ]]> \u{0}\u{1b}[2J \u{202e}.csv";

/// A figure with every kind of mark, all texts nasty, gaps and infinities in the data.
fn nasty_figure() -> Figure {
    let mut panel = Panel::new(Axis::linear(NASTY, NASTY), Axis { label: NASTY.into(), ..Axis::degrees(NASTY) });
    let (x, y) = ([1.0, 2.0, 3.0, f64::NAN], [1.0, f64::NAN, f64::INFINITY, 2.0]);
    let kinds = [
        Kind::Solid,
        Kind::Dashed,
        Kind::Points,
        Kind::Stairs,
        Kind::Bars { from: -0.2, to: 0.2 },
        Kind::Caps { from: -0.2, to: 0.2 },
        Kind::Band { upper: vec![2.0; 4] },
    ];
    for (index, kind) in kinds.into_iter().enumerate() {
        let name = format!("{NASTY}{index}");
        let series = Series::new(&name, Ink::Data(index as u8), kind, &x, &y).unwrap();
        panel.marks.push(series.along(NASTY, NASTY, &[1.0, 2.0, 3.0, 4.0]).unwrap().into());
    }
    panel.marks.push(RuleLine::vertical(2.0, NASTY, Ink::Limit));
    panel.marks.push(RuleLine::horizontal(1.0, NASTY, Ink::Limit));
    panel.marks.push(Region::of_x(f64::NEG_INFINITY, 2.0, NASTY, Ink::Muted));
    panel.marks.push(Region::of_y(1.5, f64::INFINITY, NASTY, Ink::Muted));
    let circle = Circle { centre: (1.0, 1.0), radius: 0.5, filled: true, label: NASTY.into(), ink: Ink::Plain };
    panel.marks.push(Mark::Circle(circle));
    panel.marks.push(Mark::Note(Note { at: (1.0, 1.0), text: NASTY.into(), ink: Ink::Plain }));
    let mut lower = panel.clone();
    lower.equal_aspect = true;
    Figure { title: NASTY.into(), caption: NASTY.into(), share_x: false, panels: vec![panel, lower] }
}

fn nasty_page() -> Page {
    let mut table =
        Table::new(NASTY, vec![Column::words(NASTY), Column::numbers(NASTY, NASTY, NumberFormat::Significant(3))]);
    table.push(vec![NASTY.into(), Cell::from(1.0).flagged(Verdict::Warn, NASTY)]).unwrap();
    let blocks = vec![
        Block::Prose(NASTY.into()),
        Block::Notice(Verdict::Fail, NASTY.into()),
        Block::Table(table.clone()),
        Block::Figure(nasty_figure()),
        Block::Pair(nasty_figure(), nasty_figure()),
        Block::Code(NASTY.into()),
        Block::Details(NASTY.into(), vec![Block::Table(table), Block::Figure(nasty_figure())]),
    ];
    let card =
        |verdict| Card { label: NASTY.into(), value: NASTY.into(), unit: NASTY.into(), note: NASTY.into(), verdict };
    Page {
        title: NASTY.into(),
        subtitle: NASTY.into(),
        cards: vec![card(None), card(Some(Verdict::Ok))],
        sections: (0..3).map(|_| Section { heading: NASTY.into(), blocks: blocks.clone() }).collect(),
        provenance: vec![(NASTY.into(), NASTY.into())],
    }
}

#[derive(Default)]
struct Found {
    ids: BTreeSet<String>,
    wanted: BTreeSet<String>,
    tags: Vec<String>,
}

/// Walks through the tags; panics where one is not closed, an attribute or id stands twice, or something is fetched.
fn walk(text: &str) -> Found {
    const VOID: [&str; 2] = ["meta", "br"];
    let (mut found, mut open, mut rest) = (Found::default(), Vec::<String>::new(), text);
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains('>'), "a stray > in {:?}", &rest[..start]);
        rest = &rest[start + 1..];
        if let Some(after) = rest.strip_prefix("!DOCTYPE html>") {
            rest = after;
            continue;
        }
        // Quoted values contain no < or >, which the assertion on attributes confirms.
        let end = rest.find('>').expect("a tag that ends");
        let (tag, after) = (&rest[..end], &rest[end + 1..]);
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "closed in the wrong order");
            continue;
        }
        let name = tag.split([' ', '/']).next().unwrap().to_owned();
        attributes(tag[name.len()..].trim_end_matches('/'), &mut found);
        found.tags.push(name.clone());
        if name == "script" || name == "style" {
            let end = rest.find(&format!("</{name}>")).expect("an end of raw text");
            assert!(!rest[..end].contains("<!--") && !rest[..end].contains("@import"));
            rest = &rest[end + name.len() + 3..];
        } else if !tag.ends_with('/') && !VOID.contains(&name.as_str()) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "never closed: {open:?}");
    found
}

fn attributes(text: &str, found: &mut Found) {
    let mut names = BTreeSet::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let end = rest.find(['=', ' ']).unwrap_or(rest.len());
        let name = &rest[..end];
        assert!(name.bytes().all(|b| b.is_ascii_alphanumeric() || b"-:".contains(&b)), "attribute {name:?}");
        assert!(names.insert(name.to_owned()), "attribute {name} stands twice in {text}");
        assert!(!name.starts_with("on"), "a handler in markup: {text}");
        let Some(value) = rest[end..].strip_prefix("=\"") else {
            rest = rest[end..].trim_start();
            continue;
        };
        let close = value.find('"').expect("a quoted value");
        let (value, after) = (&value[..close], &value[close + 1..]);
        assert!(!value.contains('<'), "{value}");
        match name {
            "id" => assert!(found.ids.insert(value.to_owned()), "id {value} stands twice"),
            "aria-labelledby" => found.wanted.extend(value.split(' ').map(str::to_owned)),
            "clip-path" => {
                found.wanted.insert(value.strip_prefix("url(#").and_then(|v| v.strip_suffix(')')).unwrap().to_owned());
            }
            "href" => {
                found.wanted.insert(value.strip_prefix('#').expect("a link inside the page").to_owned());
            }
            "src" | "srcset" | "style" | "action" | "data" => panic!("{name} may fetch: {value}"),
            _ => {}
        }
        rest = after.trim_start();
    }
}

#[test]
fn a_page_is_well_formed_and_complete_in_itself_whatever_its_inputs_are_called() {
    let html = nasty_page().html();
    // For a look at it in a browser, where nothing may pop up.
    std::fs::write(std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("nasty.html"), &html).unwrap();
    let found = walk(&html);
    assert!(found.wanted.is_subset(&found.ids), "{:?}", found.wanted.difference(&found.ids));
    let count = |name: &str| found.tags.iter().filter(|t| *t == name).count();
    // Twelve figures with their data, and the one script of the page.
    assert_eq!((count("figure"), count("svg"), count("script"), count("img")), (12, 24, 13, 0));
    assert_eq!(html.matches("alert(1)</script>").count(), 0);
    assert_eq!(html.matches("<script>").count(), 1);
    // The only address is the name of the SVG name space.
    assert_eq!(html.matches("http://").count(), html.matches("http://www.w3.org/2000/svg").count());
    assert_eq!(html.matches("https://").count(), 0);
    assert!(!html.contains(['\u{1b}', '\u{0}', '\u{202e}']), "control characters reach the page");
}

#[test]
fn the_data_of_a_figure_are_json_that_gives_the_text_back() {
    let html = nasty_page().html();
    let start = html.find("type=\"application/json\">").unwrap() + "type=\"application/json\">".len();
    let json = &html[start..start + html[start..].find("</script>").unwrap()];
    let data: serde_json::Value = serde_json::from_str(json).unwrap();
    let first = &data["panels"][0]["series"][0];
    // The one character that turns the direction of text is replaced everywhere.
    assert_eq!(first["name"].as_str().unwrap(), format!("{NASTY}0").replace('\u{202e}', "\u{fffd}"));
    // NaN and infinity are gaps.
    assert_eq!(first["y"], serde_json::json!([1.0, null, null, 2.0]));
}

#[test]
fn a_picture_that_stands_alone_is_well_formed() {
    for size in [Size::WIDE, Size::HALF, Size::NARROW] {
        let svg = standalone(&nasty_figure(), size);
        let found = walk(&svg);
        assert!(found.wanted.is_subset(&found.ids));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "a number that is none");
        assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
    }
}

#[test]
fn an_empty_page_and_empty_figures_are_drawn_too() {
    let empty = Figure { title: String::new(), caption: String::new(), share_x: true, panels: Vec::new() };
    let bare = Figure { panels: vec![Panel::new(Axis::frequency(), Axis::decibels("Magnitude"))], ..empty.clone() };
    let mut page = nasty_page();
    page.cards.clear();
    page.provenance.clear();
    page.sections = vec![Section {
        heading: "Empty".into(),
        blocks: vec![
            Block::Figure(empty),
            Block::Figure(bare),
            Block::Table(Table::new("none", vec![Column::words("a")])),
        ],
    }];
    walk(&page.html());
}
