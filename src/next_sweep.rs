//! `servotune next-sweep`: the few tones that would narrow the margins' intervals most.

use super::performance_arguments::NextSweepArguments;
use super::{Ending, Failure, Screen, load};
use servotune::feedback::{LoopVerdict, PlanSettings, sweep_plan};
use servotune::frf::Hold;
use servotune_report::budget::{narrowing_table, tones_table};

pub(super) fn run(a: &NextSweepArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let controller = load::controller(&a.controller)?;
    let taken = load::Taken {
        how: &a.taken,
        unstable_poles: a.unstable_poles,
        hold: Hold::of(a.hold_included.then_some(controller.sample_time_s)),
        controller: Some(&a.controller),
    };
    let sweep = load::sweep(&a.frf, &a.reading, &taken, screen)?;
    let sections =
        controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
    let settings = PlanSettings {
        tones: a.tones,
        sweep_amplitude: a.sweep_amplitude,
        command_limit: a.command_limit,
        position_limit: a.position_limit.unwrap_or(f64::INFINITY),
        periods: a.periods,
        settle_s: a.settle_s,
    };
    let plan = sweep_plan(&sweep.frf, &sections, &settings)?;
    let none = "No tone narrows the intervals by 1 % of their mean width: none is planned.\n";
    let known = match plan.before.verdict {
        LoopVerdict::NotKnown => "Stability is NOT KNOWN from this sweep.\n",
        _ => "",
    };
    let text = format!(
        "{known}{}{}\n{}\n{:.2} s of machine time; every point again would take {:.2} s.\n",
        if plan.tones.is_empty() { none } else { "" },
        tones_table(&plan, "command unit")?.text(),
        narrowing_table(&plan)?.text(),
        plan.seconds,
        plan.full_seconds
    );
    screen.result(&plan, &text)?;
    // Margins that are not known are none to accept, however useful the tones.
    Ok(if plan.before.verdict == LoopVerdict::NotKnown { Ending::Rejected } else { Ending::Accepted })
}
