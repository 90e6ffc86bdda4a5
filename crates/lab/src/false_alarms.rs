//! How often the search finds something where nothing is: the parametric bootstrap on cases without physics.
//!
//! In: a folder with one case folder each, all of them sound or with linear parameters off. Out: for each case the strongest candidate
//! on its records beside those of draws made from its own linear refit and noise.

use super::mismatch::{case_folders, diagnosed};
use super::{Study, StudyError};
use servotune::diagnose::DiagnoseSettings;
use std::fmt::Write;
use std::path::Path;

/// Draws for each case.
const DRAWS: usize = 99;

/// Makes the study on every case of `folder`.
pub fn false_alarms(folder: &Path) -> Result<Study, StudyError> {
    let mut settings = DiagnoseSettings::default();
    settings.select.bootstrap = DRAWS;
    let limit = settings.select.false_alarm;
    let mut text = format!(
        "# False alarms of the search\n\n\
         Made by `lab false-alarms --data CASES --out results`, CASES being a folder of cases without physics. For each case {DRAWS} sets of records are \
         made from its own linear refit and its own noise, and the whole first search runs on each: refit, smoothed motion, every law at every point of its grid. The \
         statistic is the closed-form bound of the strongest candidate; below {limit:e} the search would go on towards a finding.\n\n\
         | case | verdict | strongest candidate, log10 of its bound | the same of the draws: median | smallest | chance among the draws | draws below {limit:e} |\n\
         |---|---|---|---|---|---|---|\n"
    );
    let (mut alarms, mut draws) = (0, 0);
    let tens = std::f64::consts::LN_10;
    for path in case_folders(folder)? {
        let d = diagnosed(&path, &settings)?;
        let Some(b) = &d.bootstrap else { continue };
        let of = |i: usize| b.null_log_p.get(i).map_or(f64::NAN, |p| p / tens);
        let verdict = serde_json::to_value(d.verdict)?;
        let _ = writeln!(
            text,
            "| {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {} |",
            d.id,
            verdict.as_str().unwrap_or_default(),
            b.observed_log_p / tens,
            of(b.draws / 2),
            of(0),
            b.p_value,
            b.alarms
        );
        alarms += b.alarms;
        draws += b.draws;
    }
    let _ = writeln!(text, "\nDraws that would have been alarms: {alarms} of {draws}.");
    let mut study = Study::default();
    study.page("mismatch/false_alarms.md", text);
    Ok(study)
}
