//! The page of the sealed set of other forms.

use super::sealed_draw::WHOLE;
use super::sealed_row::{Outcome, Row};
use servotune::numeric::statistics::median;
use std::fmt::Write;

/// Effect over noise from which a name is asked for.
const LAMBDA: f64 = 100.0;
/// Times what repeats differ by from which held-out records count as not explained, and how much worse than the given model is worse.
const LEFT: f64 = 3.0;
const ALIKE: f64 = 1.01;
/// Kinds outside the library.
const OUTSIDE: [&str; 3] = ["detent", "one_sided", "lopsided"];
const NULLS: [&str; 2] = ["sound", "linear_off"];

fn share(of: usize, all: usize) -> String {
    if all == 0 { "none".into() } else { format!("{of} of {all} ({:.0} %)", 100.0 * of as f64 / all as f64) }
}

/// The page: score against its aims, a table of kinds, and every case that is not right.
pub(super) fn page(seed: u64, rows: &[Row], published: Option<usize>) -> String {
    use Outcome::{FalseAlarm, InFamily, Missed, Partly, Right, Unexplained, Wrong};
    let is = |r: &Row, of: &[Outcome]| of.contains(&r.outcome);
    let count = |of: &[&Row], f: &dyn Fn(&Row) -> bool| of.iter().filter(|r| f(r)).count();
    let nulls: Vec<&Row> = rows.iter().filter(|r| NULLS.contains(&&*r.kind)).collect();
    let outside: Vec<&Row> = rows.iter().filter(|r| OUTSIDE.contains(&&*r.kind) && r.lambda >= LAMBDA).collect();
    let named: Vec<&Row> = rows
        .iter()
        .filter(|r| !NULLS.contains(&&*r.kind) && !OUTSIDE.contains(&&*r.kind) && r.lambda >= LAMBDA)
        .collect();
    let singles: Vec<&Row> = named.iter().copied().filter(|r| !r.kind.contains('+')).collect();
    let pairs: Vec<&Row> = named.iter().copied().filter(|r| r.kind.contains('+')).collect();
    let every: Vec<&Row> = rows.iter().collect();
    let under: Vec<&Row> = singles.iter().copied().filter(|r| r.fitted_under).collect();
    let held = rows.iter().fold([0, 0], |a, r| [a[0] + r.held[0], a[1] + r.held[1]]);
    let worse = |r: &Row| r.holdout[2] > ALIKE * r.holdout[0];
    let left = |r: &Row| r.verdict == "named" && r.holdout[2] > LEFT;
    let explained = |r: &Row| r.curve.is_some_and(|c| c >= 0.9);
    let mut text = format!(
        "# A sealed set of other forms\n\nMade by `lab sealed --seed {seed} --out results`: {} cases of two machines of another make (`crates/lab/src/foreign.rs`, `foreign_stage.rs`), drawn by \
         `crates/lab/src/sealed_draw.rs`: LuGre bristles, rounded dead bands, parallel sliders, soft limits, counts, wind, play with a contact, pushes locked in time, curves without a name, pairs. Bodies, sizes, lengths, units and rates \
         (1 to 50 kHz) vary. {} The digests stood in `sealed_digests.txt` before the run{}.{}\n\nLambda is the sum of squares of what acts in the positions of the fitted records, over the sensor's noise.\n\n",
        rows.len(),
        format_args!(
            "In {} the given model was fitted while the effect acted.",
            share(count(&every, &|r| r.fitted_under), rows.len())
        ),
        published
            .map_or(" (the file was not there in this run)".into(), |n| format!("; {n} of {} are those", rows.len())),
        if rows.len() < WHOLE {
            format!(
                " Of the set's {WHOLE} cases {} were run: kinds stand in turn, so that a part holds of all.",
                rows.len()
            )
        } else {
            String::new()
        },
    );
    let line = |text: &mut String, what: &str, value: String, aim: &str| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "| {what} | {value} | {aim} |");
    };
    text += "| | this set | aim |\n|---|---|---|\n";
    line(
        &mut text,
        "false alarms, nothing acts or linear part off",
        share(count(&nulls, &|r| is(r, &[FalseAlarm])), nulls.len()),
        "0",
    );
    line(
        &mut text,
        "one effect, lambda from 100: named alone and right",
        share(count(&singles, &|r| is(r, &[Right])), singles.len()),
        "85 %",
    );
    line(
        &mut text,
        "the same, right or in its family",
        share(count(&singles, &|r| is(r, &[Right, InFamily])), singles.len()),
        "95 %",
    );
    line(
        &mut text,
        "the same, given model fitted under the effect, named alone and right",
        share(count(&under, &|r| is(r, &[Right])), under.len()),
        "85 %",
    );
    line(
        &mut text,
        "two effects: both named, nothing else",
        share(count(&pairs, &|r| is(r, &[Right, InFamily])), pairs.len()),
        "",
    );
    line(
        &mut text,
        "two effects: one of them, nothing else",
        share(count(&pairs, &|r| is(r, &[Partly])), pairs.len()),
        "",
    );
    line(
        &mut text,
        "forced wrong names (all with an effect of the library)",
        share(count(&named, &|r| is(r, &[Wrong])), named.len()),
        "2 %",
    );
    line(
        &mut text,
        "outside the library: not misnamed",
        share(count(&outside, &|r| !is(r, &[Wrong])), outside.len()),
        "95 %",
    );
    line(
        &mut text,
        "of those, a curve explains at least 90 % of the excess on held-out records (beyond what the machine itself leaves when it is simulated without its encoder's noise)",
        share(count(&outside, &explained), outside.len()),
        "80 %",
    );
    line(&mut text, "known numbers inside their 95 % interval", share(held[0], held[1]), "93 to 97 %");
    line(&mut text, "reported simulation worse than the given model's", share(count(&every, &worse), rows.len()), "0");
    line(&mut text, "named with more than three times the noise left", share(count(&every, &left), rows.len()), "0");
    line(
        &mut text,
        "seconds a case, median (two at once on two cores)",
        format!("{:.1}", median(&rows.iter().map(|r| r.seconds).collect::<Vec<_>>()).unwrap_or(f64::NAN)),
        "",
    );
    text += "\n## By kind\n\n| kind | cases | lambda, median | right | in family | partly | wrong | unexplained | nothing said | refused |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
    let mut kinds: Vec<&str> = rows.iter().map(|r| &*r.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let of: Vec<&Row> = rows.iter().filter(|r| r.kind == kind).collect();
        let n = |o: &[Outcome]| count(&of, &|r| is(r, o));
        let _ = writeln!(
            text,
            "| {kind} | {} | {:.1e} | {} | {} | {} | {} | {} | {} | {} |",
            of.len(),
            median(&of.iter().map(|r| r.lambda).collect::<Vec<_>>()).unwrap_or(f64::NAN),
            n(&[Right]),
            n(&[InFamily]),
            n(&[Partly]),
            n(&[Wrong, FalseAlarm]),
            n(&[Unexplained]),
            n(&[Missed, Outcome::Silent]),
            n(&[Outcome::Refused])
        );
    }
    text += "\nFor kinds outside the library *unexplained* is right; for `sound` and `linear_off` *nothing said* is.\n\n## What did not come out right\n\n| case | model fitted under it | lambda | expected | verdict | findings | held out over noise: given, refit, findings | curve |\n|---|---|---:|---|---|---|---|---:|\n";
    let fine = |r: &Row| match r.kind.as_str() {
        k if NULLS.contains(&k) => is(r, &[Outcome::Silent]),
        k if OUTSIDE.contains(&k) => !is(r, &[Wrong]) && explained(r),
        _ => is(r, &[Right]) && r.holdout[2] <= LEFT,
    };
    for r in rows.iter().filter(|r| !fine(r) || worse(r)) {
        let figure = |v: f64| if v < 1e4 { format!("{v:.2}") } else { format!("{v:.0e}") };
        let _ = writeln!(
            text,
            "| {} | {} | {:.1e} | {} | {} | {} | {} | {} |",
            r.id,
            if r.fitted_under { "yes" } else { "no" },
            r.lambda,
            r.expected,
            r.verdict,
            r.findings,
            r.holdout.map(figure).join(", "),
            r.curve.map_or(String::new(), |c| format!("{:.0} %", 100.0 * c))
        );
    }
    text
}
