//! Histograms of one quantity, a panel for each group, on common bins.
//!
//! In: groups of numbers. Out: a [`Figure`]. Convention: bars are counts; what is not finite is left out. Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Series};

/// One group.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its numbers.
    pub values: &'a [f64],
}

/// Counts on `bins` equal bins from the smallest to the largest of all groups, a panel for each group.
pub fn histogram(
    title: &str,
    caption: &str,
    (quantity, unit): (&str, &str),
    groups: &[Group],
    bins: usize,
) -> Result<Figure, ReportError> {
    let (low, high) = ends(groups);
    let width = (high - low) / bins.max(1) as f64;
    let at: Vec<f64> = (0..bins.max(1)).map(|i| low + i as f64 * width).collect();
    let mut panels = Vec::new();
    let mut tallest = 1.0f64;
    for (i, group) in groups.iter().enumerate() {
        let counts = counts(group.values, low, width, at.len());
        tallest = counts.iter().copied().fold(tallest, f64::max);
        let mut panel = Panel::new(Axis::linear(quantity, unit), Axis::counts("Machines"));
        panel.height = 0.6;
        panel.x.range = Some((low, high));
        let kind = Kind::Bars { from: 0.05 * width, to: 0.95 * width };
        panel.marks.push(Series::new(group.name, Ink::Data((i % 6) as u8), kind, &at, &counts)?.into());
        panels.push(panel);
    }
    for panel in &mut panels {
        panel.y.range = Some((0.0, 1.05 * tallest));
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: true, panels })
}

/// The ends of all groups, never equal.
pub(super) fn ends(groups: &[Group]) -> (f64, f64) {
    let all = || groups.iter().flat_map(|g| g.values).copied().filter(|v| v.is_finite());
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match low < high {
        true => (low, high),
        false if low.is_finite() => (low - 0.5, low + 0.5),
        false => (0.0, 1.0),
    }
}

/// Numbers in each bin; the largest of all belongs to the last.
fn counts(values: &[f64], low: f64, width: f64, bins: usize) -> Vec<f64> {
    let mut counts = vec![0.0; bins];
    for v in values.iter().filter(|v| v.is_finite()) {
        counts[(((v - low) / width) as usize).min(bins - 1)] += 1.0;
    }
    counts
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_finite_number_is_counted_once() {
        let (a, b) = ([0.0, 1.0, 2.0, 10.0], [f64::NAN, 5.0, 9.99]);
        assert_eq!(counts(&a, 0.0, 1.0, 10), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let groups = [Group { name: "a", values: &a }, Group { name: "b", values: &b }];
        let figure = histogram("t", "c", ("x", "V"), &groups, 10).unwrap();
        assert_eq!(figure.panels.len(), 2);
        assert_eq!(figure.panels[1].x.range, Some((0.0, 10.0)));
    }

    #[test]
    fn one_place_and_no_number_have_ends() {
        assert_eq!(ends(&[Group { name: "a", values: &[3.0, 3.0] }]), (2.5, 3.5));
        assert_eq!(ends(&[Group { name: "a", values: &[f64::NAN] }]), (0.0, 1.0));
    }
}
