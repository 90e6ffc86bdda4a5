//! Every page in a real browser (headless Chromium): nothing wider than its card, nothing cut, no label over another, no script error, at three
//! widths, in light and in dark. Skipped with a message where no Chromium is installed; `.ci/run` installs it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)]

mod program_common;

use program_common::{folder, servotune, servotune_with};
use servotune_report::number::NumberFormat;
use servotune_report::page::{Block, Page, Section};
use servotune_report::table::{Cell, Column, Table, Verdict};
use std::path::{Path, PathBuf};
use std::process::Command;

const PROBE: &str = include_str!("browser/probe.js");

/// The browser's name; none where it is not installed.
fn browser() -> Option<&'static str> {
    let runs = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(runs);
    if found.is_none() {
        eprintln!("skipped: no chromium on the path (apt-get install chromium)");
    }
    found
}

/// What the probe says of a page at a width (px): one line a fault.
fn faults(browser: &str, page: &str, width: u32, dark: bool, dir: &Path) -> Vec<String> {
    let probed = page.replacen("<head>", &format!("<head><script>{PROBE}</script>"), 1);
    let quoted = probed.replace('&', "&amp;").replace('"', "&quot;");
    // In a frame of its own a page may be narrower than a browser's window.
    let around = format!(
        "<!doctype html><body style=\"margin:0\"><iframe style=\"border:0;width:{width}px;height:900px\" srcdoc=\"{quoted}\"></iframe></body>"
    );
    let file = dir.join(format!("around_{width}_{dark}.html"));
    std::fs::write(&file, around).unwrap();
    let profile = dir.join(format!("profile_{width}_{dark}"));
    let ran = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1500,1000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--blink-settings=preferredColorScheme={}", if dark { 0 } else { 1 }))
        .args(["--virtual-time-budget=4000", "--dump-dom"])
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&ran.stdout).into_owned();
    let said = dom.rsplit_once("id=\"probe\">").map(|(_, s)| s).and_then(|s| s.split_once("END")).map(|(s, _)| s);
    let said = said.unwrap_or_else(|| panic!("the page did not load: {}", String::from_utf8_lossy(&ran.stderr)));
    let mut lines = said.lines();
    let head = lines.next().unwrap();
    let scheme = if dark { "dark" } else { "light" };
    assert!(head.starts_with(&format!("PROBE {width} {scheme}")), "{head}");
    lines.filter(|l| !l.is_empty()).map(str::to_owned).collect()
}

/// Looks at every page at every width.
fn hold(browser: &str, pages: &[(String, String)], dir: &Path) {
    let mut all = Vec::new();
    for (name, page) in pages {
        for (width, dark) in [(1300, false), (900, true), (390, false), (390, true)] {
            all.extend(
                faults(browser, page, width, dark, dir).into_iter().map(|f| format!("{name} at {width} px: {f}")),
            );
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// What the probe is for, it finds; otherwise the tests below would hold nothing.
#[test]
fn the_probe_finds_what_is_wrong() {
    let Some(browser) = browser() else { return };
    let dir = folder("browser_probe");
    let page = "<!DOCTYPE html><html><head></head><body><main><section id=\"s1\"><div style=\"width:700px\" class=\"card\">wide</div>\
                <div class=\"scroll\" style=\"overflow-x:auto\"><table><tr><td style=\"min-width:900px\">x</td></tr></table></div>\
                <svg width=\"200\" height=\"50\"><text x=\"10\" y=\"20\">one label</text><text x=\"20\" y=\"22\">another</text></svg>\
                <script>undefined_name();</script></section></main></body></html>";
    let found = faults(browser, page, 390, false, &dir).join("\n");
    for fault in ["the page is", "wider than its box", "cut by", "label over \"another\"", "script error"] {
        assert!(found.contains(fault), "`{fault}` is missing in:\n{found}");
    }
}

/// Wide tables, many rows, long words, folds.
fn hard_page() -> String {
    let digits = NumberFormat::Significant(17);
    let mut wide = Table::new(
        "Second-order sections with more columns than any page is wide",
        (0..9).map(|k| Column::numbers(&format!("coefficient {k}"), "command_unit/position_unit", digits)).collect(),
    );
    let mut long = Table::new("Slots", vec![Column::words("slot"), Column::words("why"), Column::words("verdict")]);
    for k in 0..40 {
        wide.push((0..9).map(|j| Cell::from(f64::from(k * j) / 7.0)).collect()).unwrap();
        let why = "gain_margin_db at the temperature of 40 deg C with the model's uncertainty ".repeat(3);
        let flagged = Cell::from("tuned").flagged(Verdict::Warn, "at lower bound");
        long.push(vec![format!("T{k:03}/S{k:02}").as_str().into(), why.as_str().into(), flagged]).unwrap();
    }
    let page = Page {
        title: "a_title_without_any_blank_that_is_longer_than_a_phone_is_wide_and_goes_on".into(),
        subtitle: "subtitle".into(),
        cards: vec![],
        sections: vec![Section {
            heading: "Tables".into(),
            blocks: vec![
                Block::Table(wide.clone()),
                Block::Table(long),
                Block::Details("Folded".into(), vec![Block::Table(wide)]),
                Block::Code("a line of code that is longer than a phone is wide and scrolls in its own box ".repeat(4)),
            ],
        }],
        provenance: vec![("sweep".into(), "0123456789abcdef".repeat(4))],
    };
    // Folds are opened, as on paper.
    page.html().replace("<details>", "<details open>")
}

#[test]
fn wide_tables_and_long_words_fit_every_width() {
    let Some(browser) = browser() else { return };
    hold(browser, &[("hard".into(), hard_page())], &folder("browser_hard"));
}

/// The pages of the program itself on a machine of its own making.
#[test]
fn the_program_s_pages_fit_every_width() {
    let Some(browser) = browser() else { return };
    let dir = folder("browser_pages");
    let run = |words: &[&str]| {
        let ran = servotune_with(words, Some(&dir), None);
        assert!(ran.code <= 1, "{words:?}: {}{}", ran.out, ran.err);
    };
    assert_eq!(servotune(&["init", "motor", dir.to_str().unwrap()]).code, 0);
    run(&[
        "identify",
        "sweep.csv",
        "--position-unit",
        "rad",
        "--command-unit",
        "A",
        "--out",
        "plant.toml",
        "--report",
        "identified.html",
    ]);
    run(&["margins", "--plant", "plant.toml", "--controller", "controller.toml", "--report", "margins.html"]);
    let search = ["--spec", "spec.toml", "--controller", "controller.toml"];
    run(&[&["tune", "--plant", "plant.toml", "--out", "gains.toml", "--report", "model.html"][..], &search].concat());
    run(&[&["tune", "--frf", "sweep.csv", "--out", "direct.toml", "--report", "sweep.html"][..], &search].concat());
    run(&[&["pareto", "--plant", "plant.toml", "--out", "front.html"][..], &search].concat());
    let pages: Vec<(String, String)> = std::fs::read_dir(&dir)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p: &PathBuf| p.extension().is_some_and(|e| e == "html"))
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read_to_string(&p).unwrap()))
        .collect();
    assert_eq!(pages.len(), 5);
    let open: Vec<(String, String)> =
        pages.into_iter().map(|(n, p)| (n, p.replace("<details>", "<details open>"))).collect();
    hold(browser, &open, &dir);
}
