//! Every page in a real browser (headless Chromium): nothing wider than its card, nothing cut, no label over another, no script error, at three
//! widths, in light and in dark. Skipped with a message where no Chromium is installed; `.ci/run` installs it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)]

use crate::program_common::{folder, root, servotune, servotune_with};
use servotune_report::fleet::{CoverageLine, FleetView, SlotLine, fleet_page};
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
    // In a frame of its own a page may be narrower than a browser's window. Without its encoding the browser would guess it, now and then wrongly.
    let around = format!(
        "<!doctype html><meta charset=\"utf-8\"><body style=\"margin:0\"><iframe style=\"border:0;width:{width}px;height:900px\" srcdoc=\"{quoted}\"></iframe></body>"
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
    run(&[
        "margins",
        "--plant",
        "plant.toml",
        "--controller",
        "controller.toml",
        "--controller",
        "gains.toml",
        "--report",
        "several.html",
    ]);
    let proof = ["verify", "gains.toml", "--plant", "plant.toml", "--spec", "spec.toml"];
    run(&[&proof[..], &["--report", "verify.html"]].concat());
    // Another box has no bound of its own: limits are left open, and the page says so.
    run(&[&proof[..], &["--plant", "plant.toml", "--uncertainty", "gain=30%,damping=50%", "--report", "box.html"]]
        .concat());
    let pages = written(&dir);
    assert_eq!(pages.len(), 8);
    hold(browser, &pages, &dir);
}

/// The pages in a folder, their folds open as on paper.
fn written(dir: &Path) -> Vec<(String, String)> {
    let pages = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path());
    let mut pages: Vec<(String, String)> = pages
        .filter(|p: &PathBuf| p.extension().is_some_and(|e| e == "html"))
        .filter(|p| !p.file_name().unwrap().to_string_lossy().starts_with("around_"))
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read_to_string(&p).unwrap()))
        .collect();
    pages.sort();
    pages.into_iter().map(|(n, p)| (n, p.replace("<details>", "<details open>"))).collect()
}

/// The pages of a write: with limits and without, with physics, of a loop that is unstable; its budget; the end of a limited move.
#[test]
fn the_pages_of_a_write_fit_every_width() {
    let Some(browser) = browser() else { return };
    let dir = folder("browser_write");
    let run = |words: &[&str], code: i32| {
        let ran = servotune_with(words, Some(&dir), None);
        assert_eq!(ran.code, code, "{words:?}: {}{}", ran.out, ran.err);
    };
    for (from, to) in [
        ("specs/machines/tunable.toml", "plant.toml"),
        ("specs/controllers/nominal.toml", "controller.toml"),
        ("specs/profiles/spiral.toml", "profile.toml"),
    ] {
        std::fs::copy(root(from), dir.join(to)).unwrap();
    }
    let spec = std::fs::read_to_string(root("specs/limits/paper.toml")).unwrap();
    let spec = spec.replace("../profiles/spiral.toml", "profile.toml");
    std::fs::write(dir.join("spec.toml"), &spec).unwrap();
    let ended = spec.replace("[search]", "[limits.move]\novershoot = 0.1\nband = 0.02\nsettling_s = 4e-3\n\n[search]");
    std::fs::write(dir.join("move.toml"), ended).unwrap();
    let controller = std::fs::read_to_string(dir.join("controller.toml")).unwrap();
    let loud: String =
        controller.lines().map(|l| if l.starts_with("kp") { "kp = 9.0\n".into() } else { format!("{l}\n") }).collect();
    std::fs::write(dir.join("loud.toml"), loud).unwrap();
    let machine = ["--plant", "plant.toml", "--profile", "profile.toml", "--controller"];
    run(&[&["simulate"][..], &machine, &["controller.toml", "--report", "plain.html"]].concat(), 0);
    run(
        &[&["simulate"][..], &machine, &["controller.toml", "--spec", "spec.toml", "--report", "limits.html"]].concat(),
        0,
    );
    run(&[&["simulate"][..], &machine, &["loud.toml", "--report", "unstable.html"]].concat(), 1);
    run(
        &[&["budget"][..], &machine, &["controller.toml", "--predict", "loud.toml", "--report", "budget.html"]]
            .concat(),
        1,
    );
    let tune =
        ["tune", "--plant", "plant.toml", "--spec", "move.toml", "--controller", "controller.toml", "--starts", "2"];
    let ran =
        servotune_with(&[&tune[..], &["--out", "gains.toml", "--report", "move.html"]].concat(), Some(&dir), None);
    assert!(ran.code <= 1, "{}{}", ran.out, ran.err);
    let pages = written(&dir);
    let page = |name: &str| pages.iter().find(|(n, _)| n == name).map(|(_, p)| p.as_str()).unwrap();
    // The tunable machine misses the limits of its write: no green verdict stands on the page.
    assert!(page("limits.html").contains("Missed: ") && !page("limits.html").contains("notice ok"));
    assert!(page("unstable.html").contains("unstable") && !page("unstable.html").contains("badge ok"));
    assert!(page("plain.html").contains("Nothing was asked") && !page("plain.html").contains("class=\"badge"));
    assert!(
        page("move.html").contains("End of the move")
            && page("move.html").contains("Sensitivity against the disturbance")
    );
    assert_eq!(pages.len(), 5);
    hold(browser, &pages, &dir);
}

/// A floor of six testers with every verdict, long words and missing numbers: what a real one brings to the page, without running it.
fn floor_page() -> String {
    let verdicts = ["keeps", "tuned", "untunable", "repair", "inspect", "failed"];
    let slot = |k: usize| {
        let wave = |a: f64| 30.0 + 8.0 * (a * k as f64).sin();
        let verdict = verdicts[k % verdicts.len()];
        let both = |x: f64| if verdict == "failed" { [f64::NAN; 2] } else { [x, 1.1 * x] };
        SlotLine {
            tester: format!("T{:03}", k / 16 + 1),
            slot: format!("S{:02}", k % 16 + 1),
            verdict: verdict.into(),
            class: "loose_pushpin".into(),
            phase_margin_deg: both(wave(0.7)),
            gain_margin_db: both(0.2 * wave(1.1)),
            max_sensitivity: both(0.06 * wave(0.3)),
            dft: both(1e-4 * wave(0.9)),
            worst: both(0.01 * wave(0.4) - 0.3),
            limit: "gain_crossover_hz at 40 deg C with the model's uncertainty".into(),
            shared: if k.is_multiple_of(3) { "table_2".into() } else { String::new() },
            note: if k.is_multiple_of(5) {
                "a limit is not proved: gain_margin_db at most 5.81 dB is proved ".repeat(3)
            } else {
                String::new()
            },
            report: k.is_multiple_of(7).then(|| format!("slots/T{k}.html")),
        }
    };
    let slots: Vec<SlotLine> = (0..96).map(slot).collect();
    let line = |k: usize| CoverageLine { tables: k, share: 1.0 - 0.5 / k as f64, at_most: 1.0 - 0.4 / k as f64 };
    let why = "the pushpin is loose: the response near 1222 Hz moved and the DFT of the high band is twice its limit";
    let view = FleetView {
        run: "2026-week-47 of the second hall".into(),
        verdicts: verdicts.iter().map(|v| ((*v).to_owned(), 16)).collect(),
        count: slots.len(),
        slots,
        position_unit: "track".into(),
        coverage: (1..9).map(line).collect(),
        ways: vec![("one table for all".into(), 0.5), ("a table for each slot".into(), 1.0)],
        tables: (1..5).map(|k| (format!("table_{k}"), format!("T00{k}/S01"), 20)).collect(),
        work: (0..30).map(|k| (format!("T001/S{k:02}"), 1e-3, "repair_pushpin".into(), why.into())).collect(),
        drift: (0..30).map(|k| (format!("T001/S{k:02}"), -0.4, 12.0, [8.0, 30.0, f64::INFINITY])).collect(),
        margin_limits: [Some(31.0), Some(5.5), Some(2.65)],
        provenance: vec![("FLEET.toml".into(), "0123456789abcdef".repeat(4))],
    };
    fleet_page(&view).unwrap().html()
}

/// The pages of the gate and of a floor.
#[test]
fn the_pages_of_machines_and_of_a_floor_fit_every_width() {
    let Some(browser) = browser() else { return };
    let dir = folder("browser_floor");
    let run = |words: &[&str], most: i32| {
        let ran = servotune_with(words, Some(&dir), None);
        assert!(ran.code <= most, "{words:?}: {}{}", ran.out, ran.err);
    };
    run(&["twin", "line", "--out", "line", "--count", "60"], 0);
    run(&["features", "line", "--out", "features.csv"], 0);
    let train = ["train", "features.csv", "--label", "label", "--hidden", "8", "--epochs", "5", "--folds", "2"];
    run(&[&train[..], &["--out", "gate.json", "--report", "train.html"]].concat(), 0);
    run(&["classify", "features.csv", "--gate", "gate.json", "--report", "classify.html"], 1);
    let mut pages = written(&dir);
    assert_eq!(pages.len(), 2);
    pages.push(("fleet".into(), floor_page().replace("<details>", "<details open>")));
    hold(browser, &pages, &dir);
}

/// One frequency in every picture of a section: what the pointer reads in the Bode plot is marked on the Nyquist curve, and the other way.
#[test]
fn a_frequency_read_in_one_picture_is_shown_in_the_others() {
    let Some(browser) = browser() else { return };
    let dir = folder("browser_linked");
    let words = ["margins", "--plant", root("specs/machines/healthy.toml").to_str().unwrap(), "--controller"]
        .map(str::to_owned);
    let controller = root("specs/controllers/nominal.toml");
    let mut words: Vec<&str> = words.iter().map(String::as_str).collect();
    words.extend([controller.to_str().unwrap(), "--report", "margins.html"]);
    assert_eq!(servotune_with(&words, Some(&dir), None).code, 0);
    let page = std::fs::read_to_string(dir.join("margins.html")).unwrap();
    let moved = page.replace("</body>", &format!("<script>{LINKED}</script></body>"));
    let file = dir.join("moved.html");
    std::fs::write(&file, moved).unwrap();
    let ran = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--window-size=1300,1000",
            "--virtual-time-budget=3000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", dir.join("profile").display()))
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&ran.stdout).into_owned();
    let said = dom.split("id=\"linked\">").nth(1).and_then(|s| s.split('<').next()).unwrap_or("the script did not run");
    assert_eq!(said, "nyquist 1 bode 2 left 0");
}

/// Points at the middle of the Bode plot, then at the mark that this makes on the Nyquist curve, then away.
const LINKED: &str = include_str!("browser/linked.js");
