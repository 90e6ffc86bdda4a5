//! The documents: sentences are short, links lead somewhere, every page of the site is in its list, commands are understood, and the first
//! tutorial runs as written.
#![allow(clippy::unwrap_used)]

use crate::program_common::{folder, root, servotune, servotune_with};
use std::path::{Path, PathBuf};

fn markdown(dir: &str) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(root(dir)).unwrap().map(|e| e.unwrap().path()).collect();
    all.retain(|p| p.extension().is_some_and(|e| e == "md"));
    all.sort();
    all
}

/// Every file with words for a reader.
fn documents() -> Vec<PathBuf> {
    let mut all = vec![root("README.md"), root("examples/README.md")];
    for dir in ["specs", "specs/decisions", "results", "book/src", "examples/stage", "examples/galvo", "examples/vcm"] {
        all.extend(markdown(dir));
    }
    all
}

/// Longest sentence of a page written by hand (words).
const WORDS: usize = 40;

/// Sentences of a page, which end at full stops, question and exclamation marks only. Paragraphs, list items, cells of tables stand apart;
/// code counts as one word, fenced code as none. `scripts/house.py` counts by the same rule.
fn sentences(text: &str) -> Vec<String> {
    let unfenced: String = text.split("```").step_by(2).collect::<Vec<_>>().join("\n\n");
    let mut blocks = vec![String::new()];
    for line in unfenced.lines() {
        let code = line.split('`').enumerate().map(|(i, part)| if i % 2 == 0 { part } else { "code" });
        let plain = code.collect::<String>();
        let plain = plain.trim();
        let number = plain.split_once(". ").is_some_and(|(n, _)| n.chars().all(|c| c.is_ascii_digit()));
        if plain.starts_with('|') {
            blocks.extend(plain.split('|').map(str::to_owned));
            blocks.push(String::new());
        } else if plain.is_empty() || plain.starts_with('#') {
            blocks.push(String::new());
        } else {
            if number || plain.starts_with("- ") || plain.starts_with("* ") {
                blocks.push(String::new());
            }
            let last = blocks.last_mut().unwrap();
            last.push(' ');
            last.push_str(plain);
        }
    }
    let mut found = Vec::new();
    for block in blocks {
        let mut sentence = Vec::new();
        for word in block.split_whitespace() {
            sentence.push(word);
            if word.trim_end_matches(['"', '\'', ')', ']', '*', '_']).ends_with(['.', '?', '!']) {
                found.push(std::mem::take(&mut sentence).join(" "));
            }
        }
        found.push(sentence.join(" "));
    }
    found
}

#[test]
fn a_sentence_ends_at_its_stop() {
    let text = "# A\n\nOne: two;\nthree `a b. c`. (Four.) Five?\n- six\n  seven 1.5\n1. eight\n\n| nine. ten | eleven |\n```\nno. no\n```\ntwelve";
    let mut read = sentences(text);
    read.retain(|s| !s.is_empty() && s != "1.");
    let expected =
        ["One: two; three code.", "(Four.)", "Five?", "- six seven 1.5", "eight", "nine.", "ten", "eleven", "twelve"];
    assert_eq!(read, expected);
}

/// Pages of results that a person writes; the others are made by commands whole.
const WRITTEN_RESULTS: [&str; 4] = ["README.md", "comparison.md", "mismatch/history.md", "mismatch/shortfalls.md"];

#[test]
fn no_sentence_is_longer_than_forty_words() {
    let mut pages = vec![root("README.md"), root("CHANGELOG.md")];
    for dir in ["specs", "specs/decisions", "book/src"] {
        pages.extend(markdown(dir));
    }
    pages.extend(WRITTEN_RESULTS.map(|p| root("results").join(p)));
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for page in pages.iter().filter(|p| !p.ends_with("specs/rules.md")) {
        let text = std::fs::read_to_string(page).unwrap();
        // The catalogue of laws and the table of rules are made from the code: lists of parameters, no sentences.
        let (before, laws) = text.split_once("\n## Laws\n").unwrap_or((&text, ""));
        let behind = laws.split_once("\n## ").map_or("", |(_, rest)| rest);
        for sentence in sentences(before).into_iter().chain(sentences(behind)) {
            let words = sentence.split_whitespace().count();
            seen += 1;
            if words > WORDS {
                wrong.push(format!("{}: {words} words: {sentence}", page.display()));
            }
        }
    }
    assert!(seen > 2000, "{seen} sentences");
    assert!(wrong.is_empty(), "{} sentences above {WORDS} words:\n{}", wrong.len(), wrong.join("\n"));
}

/// Targets of `[words](target)`, code left out.
fn links(text: &str) -> Vec<String> {
    let mut fenced = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        }
        if fenced {
            continue;
        }
        // Inside backticks nothing is a link.
        let plain: String = line.split('`').step_by(2).collect();
        for part in plain.split("](").skip(1) {
            if let Some((target, _)) = part.split_once(')') {
                found.push(target.to_owned());
            }
        }
    }
    found
}

/// What `{{#include FILE}}` or `{{#include FILE:ANCHOR}}` puts into a page: the file, and the text that is taken.
fn includes(text: &str, beside: &Path) -> Vec<(String, String)> {
    let named = text.split("{{#include ").skip(1).filter_map(|s| s.split_once("}}").map(|(p, _)| p));
    named
        .map(|target| {
            let (file, anchor) = target.split_once(':').unwrap_or((target, ""));
            let whole = std::fs::read_to_string(beside.join(file)).unwrap_or_default();
            let (from, to) = (format!("ANCHOR: {anchor} "), format!("ANCHOR_END: {anchor} "));
            let between = || whole.split_once(&from)?.1.split_once(&to).map(|(part, _)| part.to_owned());
            let taken = if anchor.is_empty() { whole.clone() } else { between().unwrap_or_default() };
            assert!(!taken.is_empty(), "{target}: nothing is included");
            (file.to_owned(), taken)
        })
        .collect()
}

/// Places of a page that `#place` leads to: its headings in small letters, blanks as hyphens, signs left out.
fn places(text: &str) -> Vec<String> {
    let kept = |c: char| match c {
        c if c.is_alphanumeric() || c == '_' || c == '-' => Some(c.to_ascii_lowercase()),
        c if c.is_whitespace() => Some('-'),
        _ => None,
    };
    let heading = |line: &str| line.starts_with('#').then(|| line.trim_start_matches('#').trim().to_owned());
    text.lines().filter_map(heading).map(|h| h.chars().filter_map(kept).collect()).collect()
}

#[test]
fn every_link_and_every_include_leads_to_a_file_and_to_a_place_in_it() {
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for file in documents() {
        let text = std::fs::read_to_string(&file).unwrap();
        let beside = file.parent().unwrap();
        let included = includes(&text, beside);
        // What a page includes stands in that page: its links are read from there, not from where it came.
        let taken = included.iter().flat_map(|(_, part)| links(part));
        let targets: Vec<String> =
            links(&text).into_iter().chain(taken).chain(included.iter().map(|(p, _)| p.clone())).collect();
        for target in targets {
            let (path, place) = target.split_once('#').unwrap_or((&target, ""));
            if path.contains("://") || path.starts_with("mailto:") {
                continue;
            }
            seen += 1;
            let to = if path.is_empty() { file.clone() } else { beside.join(path) };
            if !to.exists() {
                wrong.push(format!("{}: {target}", file.display()));
            } else if !place.is_empty() {
                let there = std::fs::read_to_string(&to).unwrap();
                let parts = includes(&there, to.parent().unwrap()).into_iter().map(|(_, part)| part);
                if !parts.chain([there.clone()]).any(|t| places(&t).iter().any(|p| p == place)) {
                    wrong.push(format!("{}: {target}: no such place", file.display()));
                }
            }
        }
    }
    assert!(seen > 60, "{seen} links");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_page_of_the_site_is_in_its_list() {
    let list = std::fs::read_to_string(root("book/src/SUMMARY.md")).unwrap();
    for page in markdown("book/src") {
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        assert!(name == "SUMMARY.md" || list.contains(&format!("({name})")), "{name}");
    }
}

/// The commands of a document, words as a shell would cut them where nothing is quoted; comments behind them are left out.
fn commands(file: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(file).unwrap();
    let mut all: Vec<String> = Vec::new();
    let mut fenced = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if fenced {
            all.push(line.trim().to_owned());
        } else {
            all.extend(line.split('`').skip(1).step_by(2).map(str::to_owned));
        }
    }
    let bare = |line: &String| line.strip_prefix("servotune ").map(|s| s.split(" #").next().unwrap().to_owned());
    let whole = |line: &String| !line.contains(['|', '"', '\'', '(', ';']) && !line.contains("&&");
    all.iter()
        .filter(|l| whole(l))
        .filter_map(bare)
        .map(|l| l.split_whitespace().map(str::to_owned).collect())
        .collect()
}

/// `--help` at the end is reached only where every word before it is one of the command's.
#[test]
fn every_command_in_readme_and_site_is_understood() {
    let mut files = vec![root("README.md")];
    files.extend(markdown("book/src"));
    let mut seen = 0;
    for file in files {
        for words in commands(&file) {
            // A command named in passing, or with placeholders for options.
            if words.iter().any(|w| w == "..." || w == "FILE...") {
                continue;
            }
            let asked: Vec<&str> = words.iter().map(String::as_str).chain(["--help"]).collect();
            let ran = servotune(&asked);
            assert_eq!(ran.code, 0, "{}: {}: {}", file.display(), words.join(" "), ran.err);
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen} commands");
}

#[test]
fn the_first_tutorial_runs_as_written() {
    let dir = folder("tutorial");
    let text = std::fs::read_to_string(root("book/src/sweep_to_table.md")).unwrap();
    let blocks = text.split("```sh\n").skip(1).filter_map(|s| s.split_once("```").map(|(b, _)| b));
    let mut ran_all = Vec::new();
    for line in blocks.flat_map(str::lines).filter(|l| !l.is_empty()) {
        let words: Vec<&str> = line.strip_prefix("servotune ").unwrap().split_whitespace().collect();
        let ran = servotune_with(&words, Some(&dir), None);
        assert_eq!(ran.code, 0, "{line}: {}{}", ran.out, ran.err);
        ran_all.push(words[0].to_owned());
    }
    assert_eq!(ran_all, ["init", "check", "margins", "identify", "tune", "verify", "export", "export"]);
    assert!(dir.join("gains.certificate.json").is_file() && dir.join("report.html").is_file());
}

/// What a floor of sixteen slots needs less of than one of thousands, as in the demo.
const SMALLER: [(&str, &str); 3] =
    [("pilots = 32", "pilots = 4"), ("scouts = 192", "scouts = 16"), ("explained = 40", "explained = 1")];

/// The table of README.md in a folder of `servotune init spiral .`. The demo and its diagnosis take a minute and have tests of their own.
/// Searches have few starts, fronts few points: what they find is tested elsewhere.
#[test]
fn the_commands_of_readme_run_as_written() {
    let dir = folder("readme");
    assert_eq!(servotune_with(&["init", "spiral", "."], Some(&dir), None).code, 0);
    let text = std::fs::read_to_string(root("README.md")).unwrap();
    let mut ran_all = 0;
    for line in text.lines().filter_map(|l| l.strip_prefix("| `servotune ")) {
        let mut words: Vec<&str> = line.split('`').next().unwrap().split_whitespace().collect();
        if ["demo", "diagnose"].contains(&words[0]) {
            continue;
        }
        match words[..2] {
            ["tune", _] => words.extend(["--starts", "3"]),
            ["pareto", _] => words.extend(["--points", "3"]),
            ["fleet", "run"] => {
                let floor = std::fs::read_to_string(dir.join(words[2])).unwrap();
                let less = SMALLER.iter().fold(floor, |text, (from, to)| {
                    assert!(text.contains(from), "{from}");
                    text.replace(from, to)
                });
                std::fs::write(dir.join(words[2]), less).unwrap();
            }
            _ => {}
        }
        let ran = servotune_with(&words, Some(&dir), None);
        // 1: done, with something to look at, such as a machine that the gate leaves to a person.
        assert!(ran.code <= 1, "{line}: {}{}", ran.out, ran.err);
        ran_all += 1;
    }
    assert!(ran_all > 20, "{ran_all} commands");
}
