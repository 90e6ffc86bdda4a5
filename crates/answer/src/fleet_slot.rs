//! The full report of one slot of a fleet: what the fleet's page leads to.

use super::AnswerError;
use super::slot::{self, Slot, provenance};
use servotune::frf::Sweep;
use servotune::lti::Plant;
use servotune::tune::{Machine, Outcome, Reached, Route, SearchWork, Tuned, judge, ranges};
use servotune_fleet::{Context, OwnTable, SlotRow, SlotSource, gain_table_of};
use servotune_report::page::Block;
use servotune_report::table::Verdict;
use servotune_report::tuned::figure_name;

/// Where the page of a slot lies beside the fleet's page.
pub(super) fn file(row: &SlotRow) -> String {
    format!("slots/{}_{}.html", row.tester, row.slot)
}

/// The page of a slot; none where it could not be identified or judged.
pub(super) fn html(context: &Context, source: &dyn SlotSource, row: &SlotRow) -> Result<Option<String>, AnswerError> {
    let loaded = source.load(row.index);
    let (Some(frf), Some(model), Some(current)) = (loaded.machine.response, &row.model, &row.current) else {
        return Ok(None);
    };
    let plant = Plant::try_from(model.plant.clone())?;
    let start = row.own_gains.as_ref().unwrap_or(&context.base);
    // The best table there is; where none was sought, the gains in the slot.
    let found = row.table.as_ref().or(row.nearest.as_ref());
    let gains = found.map_or(start, |t| &t.gains);
    let judged = found.map_or(current, |t: &OwnTable| &t.judged);
    let frf = frf.with_hold(context.hold);
    let machine = Machine::Response { frf: &frf, continuation: Some(&plant) };
    let work = SearchWork {
        route: Route::Response,
        starts: 0,
        evaluations: 0,
        feasible_starts: 0,
        back_offs: 0,
        filter_searched: false,
    };
    let outcome = Outcome::Tuned(Tuned {
        controller: gains.clone(),
        before: Some(vec![judge(&machine, start, &context.spec)?]),
        after: vec![judge(&machine, gains, &context.spec)?],
        objective: Reached { name: context.spec.objective.minimise, value: f64::NAN, starts: 0, starts_at_best: 0 },
        at_bounds: Vec::new(),
        ranges: ranges(&[machine], &context.spec, context.base.sample_time_s),
        work,
    });
    let table = gain_table_of(context, row, gains, judged)?;
    let digest = loaded.digest;
    let sweep =
        Sweep { coherence: None, notes: Vec::new(), rows_read: frf.len(), source_digest: digest, frf: frf.clone() };
    let name = row.id();
    let page = slot::page(&Slot {
        name: &name,
        plant: &plant,
        units: slot::units(&plant),
        sweep: Some(&sweep),
        identified: None,
        spec: &context.spec,
        // Gains that stay are no tuning: there is nothing before them.
        start: found.map(|_| start),
        outcome: &outcome,
        over_model: None,
        table: &table,
        certificate: None,
        provenance: provenance(&table),
        physics: None,
    })?;
    let mut page = page;
    // The page's verdict is that of the response as measured; the fleet asks for more, and its badge with it.
    let notice = page.sections.first_mut().and_then(|s| s.blocks.first_mut());
    if let (false, Some(Block::Notice(verdict, text))) = (judged.passes, notice) {
        *verdict = Verdict::Fail;
        *text = format!(
            "In the worst case ({}) {} is missed by {:.1} %.",
            if judged.case.is_empty() { "as measured" } else { &judged.case },
            figure_name(judged.limit),
            100.0 * judged.worst
        );
    }
    Ok(Some(page.html()))
}
