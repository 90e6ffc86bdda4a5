//! The catalogue of effects as text.
//!
//! In: the facts of the library. Out: a page of Markdown, which `specs/effects.md` carries, and the same as a document. Spec: `specs/effects.md`.

use serde_json::{Value, json};
use servotune::physics::{CurvePort, Entry, Facts, Key, Need, curves, data_facts, library};
use std::fmt::Write;

const HEAD: &str = "# Effects

What the library knows of every effect, printed by `servotune diagnose --effects` (`--json` gives the same as a document). How a diagnosis uses it: `specs/mismatch.md`.

- *Units*: position and command are the machine's own. Torques are counted in command units, positive in the direction of motion.
- *In a file*: whether an entry of `[[plant.physics]]` gives the key. \"reported\" keys are made from the others; a file may hold them and they say nothing.
- *Takes*: values beyond are refused by name. A key without a word there takes any finite number.
- *Search*: what the diagnosis takes it from. \"free\" is a strength, estimated without a range. All else is scanned or tried at these points, then refined.
- *Fixed*: its strength is 1 by definition. *Per record*: its strengths are each record's own.

Noise is the sensor's, rms; travel the largest distance from the middle of the positions; a record the longest one.
";

/// Laws of the search, then those of the estimation of curves.
fn laws() -> impl Iterator<Item = &'static Facts> {
    library().iter().chain(curves()).map(|e| e.facts())
}

fn entry(f: &Facts) -> &'static str {
    match f.entry {
        Entry::Command => "command",
        Entry::Torque => "torque",
        Entry::Position => "position",
    }
}

/// A word of an enumeration as documents carry it.
fn port(f: &Facts) -> String {
    json!(f.port).as_str().unwrap_or_default().to_owned()
}

fn need(key: &Key) -> String {
    let of = |names: &[&str]| names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(" or ");
    let mut text = match key.need {
        Need::Always => "required".to_owned(),
        Need::Unless(others) => format!("required, or {}", of(others)),
        Need::Where(words) => format!("required: {words}"),
        Need::Or(number) => format!("else {number}"),
        Need::OrElse(words) | Need::OrToml(words) => format!("else {words}"),
        Need::Reported => "reported".to_owned(),
    };
    if let Some(other) = key.beside {
        text = format!("beside `{other}`, {text}");
    }
    text
}

fn takes(key: &Key) -> &'static str {
    let text = key.takes.text();
    if text == "a finite number" {
        ""
    } else {
        text.trim_start_matches("a finite number ").trim_start_matches("a number ")
    }
}

/// The page.
pub(super) fn text() -> String {
    let mut out = String::from(HEAD);
    // Writing to a String cannot fail.
    out.push_str("\n## Laws\n");
    for f in laws() {
        let flags = [(f.fixed, ", fixed"), (f.per_record, ", per record")];
        let flags: String = flags.iter().filter(|(is, _)| *is).map(|(_, word)| *word).collect();
        let _ = write!(
            out,
            "\n### {}\n\n{}. {}: enters at {}{flags}.\n\n",
            f.name,
            upper(f.says),
            upper(&port(f)),
            entry(f)
        );
        let _ = write!(
            out,
            "`{}`\n\n| key | unit | means | in a file | takes | search |\n|---|---|---|---|---|---|\n",
            f.equation
        );
        for k in f.keys {
            let unit = k.unit.text("position", "command");
            let cells = [&format!("`{}`", k.name), &unit, k.means, &need(k), takes(k), &k.prior.text()];
            row(&mut out, &cells);
        }
        let confused = f.confused_with.join(", ");
        let _ =
            write!(out, "\n- Confused with: {confused}.\n- Experiment: {}.\n- Source: {}.\n", f.experiment, f.source);
    }
    out.push_str(
        "\n## Curves without a name\n\nEntries of effect `free_form`: `port`, `argument`, `unit` and `[[plant.physics.knots]]` with `at` and `value` (`velocity` too over position and velocity); `lag_s` above 0 behind an amplifier.\n\n\
         | port | argument | unit of the argument | unit of the value | equation |\n|---|---|---|---|---|\n",
    );
    for curve in CurvePort::ALL {
        let ([port, argument], [of, unit]) = (curve.names(), curve.units("position", "command"));
        row(&mut out, &[port, argument, &of, &unit, &format!("`{}`", curve.known().equation)]);
    }
    out.push_str(
        "\n## Effects of data and statistics\n\nFound by their own tests, without columns; a simulation leaves an entry of one of them out and says so.\n\n\
         | effect | port | says | equation | confused with | experiment | source |\n|---|---|---|---|---|---|---|\n",
    );
    for f in data_facts() {
        let (name, equation) = (format!("`{}`", f.name), format!("`{}`", f.equation));
        let confused = if f.confused_with.is_empty() { "none".to_owned() } else { f.confused_with.join(", ") };
        row(&mut out, &[&name, &port(f), f.says, &equation, &confused, f.experiment, f.source]);
    }
    out
}

fn row(out: &mut String, cells: &[&str]) {
    let line: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
    out.push_str(&format!("| {} |\n", line.join(" | ")).replace("|  |", "| |").replace("|  |", "| |"));
}

fn upper(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

/// The same as a document: one object an effect.
pub(super) fn document() -> Value {
    let key = |k: &Key| {
        json!({ "key": k.name, "unit": k.unit.text("position", "command"), "means": k.means, "in_file": need(k),
            "takes": k.takes.text(), "search": k.prior.text() })
    };
    let of = |f: &Facts| {
        json!({ "effect": f.name, "port": f.port, "enters_at": entry(f), "fixed": f.fixed, "per_record": f.per_record,
            "says": f.says, "equation": f.equation, "keys": f.keys.iter().map(key).collect::<Vec<_>>(),
            "confused_with": f.confused_with, "experiment": f.experiment, "source": f.source })
    };
    laws().chain(data_facts().iter().copied()).map(of).collect()
}
