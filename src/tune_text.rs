//! A tuning in words for a terminal.

use super::Failure;
use super::slot;
use servotune::controller::Controller;
use servotune::physics::Restored;
use servotune::tune::{Outcome, PhysicalTuning, Spec};
use servotune_report::physical::{amplitude_table, limit_cycle_sentences};
use servotune_report::tuned::{Units, conflicts_table, gains_table, limits_table};

/// The outcome for a terminal.
pub(super) fn text(
    outcome: &Outcome,
    start: Option<&Controller>,
    spec: &Spec,
    units: Units<'_>,
) -> Result<String, Failure> {
    let before = outcome.before().and_then(|b| b.first()).map(|p| &p.judged);
    let after = outcome.after().first().map(|p| &p.judged);
    let mut text = format!("{}\n\n", slot::verdict(outcome).1);
    text += &limits_table(before, after, units)?.text();
    if let Outcome::Infeasible(i) = outcome {
        text.push('\n');
        text += &conflicts_table(i, units)?.text();
    }
    text.push('\n');
    text += &gains_table(start, outcome.controller(), outcome.at_bounds())?.text();
    let o = outcome.objective();
    let unit = spec.objective.unit(units.position, units.command);
    text += &format!(
        "\nObjective {}: {:.4e} {unit}; {} of {} polishes ended there, {} candidates.\n",
        o.name.name(),
        o.value,
        o.starts_at_best,
        o.starts,
        outcome.work().evaluations
    );
    Ok(text)
}

/// The outcome of a tuning with physics for a terminal.
pub(super) fn physical_text(
    physics: &Restored,
    t: &PhysicalTuning,
    start: Option<&Controller>,
    units: Units<'_>,
) -> Result<String, Failure> {
    let bounds = t.outcome.at_bounds();
    let mut text = format!("{}\nPhysics: {}.\n\n", slot::physical_verdict(t).1, physics.names().join(", "));
    text += &limits_table(t.before.as_ref().map(|b| &b.judged), Some(&t.after.judged), units)?.text();
    text.push('\n');
    text += &amplitude_table(&t.after.margins, &t.after.linear, units)?.text();
    text += &limit_cycle_sentences(&t.after.margins, units);
    if let Outcome::Infeasible(i) = &t.outcome {
        text.push('\n');
        text += &conflicts_table(i, units)?.text();
    }
    text.push('\n');
    text += &gains_table(start, t.outcome.controller(), bounds)?.text();
    Ok(text)
}
