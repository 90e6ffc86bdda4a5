//! The page of false alarms, its rows, and the counts that the table of decision rules carries.

use super::StudyError;
use super::false_alarms_said::{EXACT, LOST, NO_REPEATS, Said};
use serde::Serialize;
use servotune::diagnose::{Consequence, Counted};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Level of the upper bounds.
const LEVEL: f64 = 0.95;

/// A case with its alarms.
#[derive(Serialize)]
struct Line<'a> {
    id: &'a str,
    model: &'a str,
    told: &'a str,
    verdict: &'a str,
    alarms: BTreeMap<Consequence, String>,
}

#[derive(Serialize)]
struct Document<'a> {
    seed: u64,
    /// Cases with this alarm, and cases that could have had it.
    counts: BTreeMap<Consequence, Counted>,
    cases: Vec<Line<'a>>,
}

fn lines(all: &[Said]) -> Vec<Line<'_>> {
    let all =
        all.iter().map(|s| Line { id: &s.id, model: &s.model, told: &s.told, verdict: &s.verdict, alarms: s.alarms() });
    all.collect()
}

/// Cases of which a question is answered with yes that had an alarm, and those of them that could have had it.
fn count(lines: &[Line], what: Consequence, which: impl Fn(&Line) -> bool) -> [usize; 2] {
    let could = |l: &&Line| match what {
        _ if !which(l) => false,
        // Where the given model is off or was fitted, a refit is right; what repeats tell is left open by no verdict.
        Consequence::Refit => l.model == EXACT,
        Consequence::Open => l.told == NO_REPEATS,
        _ => true,
    };
    let had = |l: &&&Line| match what {
        Consequence::Anything => !l.alarms.is_empty(),
        _ => l.alarms.contains_key(&what),
    };
    let of: Vec<&Line> = lines.iter().filter(could).collect();
    [of.iter().filter(had).count(), of.len()]
}

/// The count that the table of rules carries.
fn counted(lines: &[Line], what: Consequence) -> Counted {
    let [alarms, of] = count(lines, what, |l| l.model != LOST);
    Counted { alarms, of, lost: count(lines, what, |l| l.model == LOST) }
}

/// The rate that so few alarms as these, or fewer, would stay above once in twenty (Clopper and Pearson 1934, one-sided); with none it is nearly three
/// over the cases.
fn bound([alarms, of]: [usize; 2]) -> f64 {
    if alarms >= of {
        return 1.0;
    }
    // Chance of as few alarms at a rate p.
    let few = |p: f64| {
        let mut term = (1.0 - p).powi(of as i32);
        let mut sum = term;
        for i in 0..alarms {
            term *= (of - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let p = 0.5 * (low + high);
        if few(p) > 1.0 - LEVEL { low = p } else { high = p }
    }
    high
}

/// The rows.
pub(super) fn document(seed: u64, all: &[Said]) -> Result<String, StudyError> {
    let cases = lines(all);
    let counts = Consequence::COUNTED.into_iter().map(|what| (what, counted(&cases, what))).collect();
    Ok(serde_json::to_string_pretty(&Document { seed, counts, cases })? + "\n")
}

/// Counts with their bounds, where they come from, and every alarm.
pub(super) fn page(seed: u64, all: &[Said]) -> String {
    let cases = lines(all);
    let mut text = format!(
        "# False alarms where nothing acts\n\nMade by `lab false-alarms --seed {seed} --count {} --out results`. The whole diagnosis, all rules in force, on machines of another make \
         (`crates/lab/src/foreign.rs`, `foreign_stage.rs`) on which nothing acts beside their linear part. Bodies, noise, sizes, units and rates (1 to 50 kHz) are drawn from the seed.\n\n\
         The given model is the machine's own (*exact*), was fitted to a multisine under noise and in closed loop (*fitted*), or is wrong in gain, stiffness and damping by up to 20, 30 and 40 % (*off*). \
         A fit whose gain came out with the other sign, or more than a factor of two off, is *lost*: such a model is nonsense, and what it leads to is counted apart. \
         A refit is a false alarm where the model is exact, and nowhere else; a verdict is left open only where no record was repeated.\n\n\
         An alarm is counted once a case and kind. The bound is that of Clopper and Pearson, one-sided at 95 %: with no alarm among n cases nearly 3/n, the rule of three.\n\n\
         | alarm | cases with it | at most (95 %) | with a lost model | at most (95 %) |\n|---|---:|---:|---:|---:|\n",
        all.len()
    );
    let told = |c: [usize; 2]| match c {
        [_, 0] => "none could | ".to_owned(),
        [alarms, of] => format!("{alarms} of {of} | {:.1} %", 100.0 * bound(c)),
    };
    for what in Consequence::COUNTED {
        let Counted { alarms, of, lost } = counted(&cases, what);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "| {} | {} | {} |", what.says(), told([alarms, of]), told(lost));
    }
    text += "\n## By machine and by what was told\n\n| machine | model | told beside the plant | cases | with an alarm |\n|---|---|---|---:|---:|\n";
    let machine = |l: &Line| if l.id.ends_with("stage_sound") { "stage" } else { "arm" };
    let groups: BTreeSet<(&str, &str, &str)> = cases.iter().map(|l| (machine(l), l.model, l.told)).collect();
    for (made, model, told) in groups {
        let here = |l: &Line| (machine(l), l.model, l.told) == (made, model, told);
        let [alarms, of] = count(&cases, Consequence::Anything, here);
        let _ = writeln!(text, "| {made} | {model} | {told} | {of} | {alarms} |");
    }
    text += "\n## Every alarm\n\n";
    if cases.iter().all(|l| l.alarms.is_empty()) {
        text += "None.\n";
        return text;
    }
    text += "| case | model | told | verdict | alarm | what was said |\n|---|---|---|---|---|---|\n";
    for l in &cases {
        for (what, said) in &l.alarms {
            let said = said.replace('|', "/");
            let _ =
                writeln!(text, "| {} | {} | {} | {} | {} | {said} |", l.id, l.model, l.told, l.verdict, what.says());
        }
    }
    text
}
