//! The rules that a verdict was decided by.

use super::ReportError;
use super::diagnosis_shown::Shown;
use super::number::NumberFormat;
use super::page::Block;
use super::table::{Cell, Column, Table};
use servotune::diagnose::decision_rules;

/// Every rule that was consulted, with the value that was met, folded; nothing where the log decided alone.
pub(super) fn rules_block(s: &Shown) -> Result<Option<Block>, ReportError> {
    let mut table = Table::new(
        "Rules consulted for this verdict, in order (servotune diagnose --rules lists all, with reasons)",
        vec![
            Column::words("Rule"),
            Column::words("Statistic"),
            Column::numbers("Value", "", NumberFormat::Significant(4)),
            Column::numbers("Threshold", "", NumberFormat::Significant(4)),
            Column::words("Unit"),
            Column::words("Met"),
        ],
    );
    let all = &s.made.consulted;
    for (_, c) in all.iter().enumerate().filter(|(i, c)| !all[..*i].contains(c)) {
        let Some(rule) = decision_rules().find(|r| r.name == c.rule) else { continue };
        table.push(vec![
            rule.name.into(),
            rule.statistic.into(),
            Cell::from(c.value.filter(|v| v.is_finite())),
            rule.threshold.into(),
            rule.unit.into(),
            if c.met { "yes" } else { "no" }.into(),
        ])?;
    }
    Ok((!table.is_empty()).then(|| Block::Details("Rules that decided".into(), vec![Block::Table(table)])))
}
