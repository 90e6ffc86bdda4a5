//! Boxes of one quantity, side by side for each group.
//!
//! In: groups of numbers. Out: a [`Figure`] and [`BoxSummary`]. Convention: box from quartile to quartile with the median, whiskers
//! to the outermost numbers within one and a half boxes of it, dots beyond (Tukey). Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Series};
use super::histogram::Group;

/// The five numbers of a box, and what lies beyond.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxSummary {
    /// End of the lower whisker.
    pub low: f64,
    /// First quartile.
    pub first: f64,
    /// Median.
    pub median: f64,
    /// Third quartile.
    pub third: f64,
    /// End of the upper whisker.
    pub high: f64,
    /// Numbers beyond the whiskers.
    pub outliers: Vec<f64>,
}

/// Half width of a box in units of the distance between boxes.
const HALF: f64 = 0.28;

/// The summary of a group; `None` without a finite number.
pub fn summary(values: &[f64]) -> Option<BoxSummary> {
    let mut s: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    s.sort_by(f64::total_cmp);
    let last = s.len().checked_sub(1)?;
    let quantile = |q: f64| {
        let at = q * last as f64;
        let i = at.floor() as usize;
        s[i] + (at - i as f64) * (s[(i + 1).min(last)] - s[i])
    };
    let (first, median, third) = (quantile(0.25), quantile(0.5), quantile(0.75));
    let reach = 1.5 * (third - first);
    let inside = |v: &&f64| **v >= first - reach && **v <= third + reach;
    let low = s.iter().find(inside).copied().unwrap_or(first);
    let high = s.iter().rev().find(inside).copied().unwrap_or(third);
    let outliers = s.iter().copied().filter(|v| *v < low || *v > high).collect();
    Some(BoxSummary { low, first, median, third, high, outliers })
}

/// A box for each group, in their order.
pub fn boxplot(
    title: &str,
    caption: &str,
    (quantity, unit): (&str, &str),
    groups: &[Group],
) -> Result<Figure, ReportError> {
    let names = groups.iter().map(|g| g.name);
    let mut panel = Panel::new(Axis::named("Class", names), Axis::linear(quantity, unit));
    panel.height = 1.4;
    for (i, group) in groups.iter().enumerate() {
        let Some(b) = summary(group.values) else { continue };
        let (at, ink) = (i as f64, Ink::Data((i % 6) as u8));
        let (left, right) = (at - HALF, at + HALF);
        let mut line = |x: &[f64], y: &[f64]| -> Result<(), ReportError> {
            panel.marks.push(Series::new(group.name, ink, Kind::Solid, x, y)?.into());
            Ok(())
        };
        line(&[left, right, right, left, left], &[b.first, b.first, b.third, b.third, b.first])?;
        line(&[left, right], &[b.median, b.median])?;
        line(&[at, at], &[b.third, b.high])?;
        line(&[at, at], &[b.first, b.low])?;
        line(&[at - 0.5 * HALF, at + 0.5 * HALF], &[b.high, b.high])?;
        line(&[at - 0.5 * HALF, at + 0.5 * HALF], &[b.low, b.low])?;
        if !b.outliers.is_empty() {
            let x = vec![at; b.outliers.len()];
            panel.marks.push(Series::new(group.name, ink, Kind::Points, &x, &b.outliers)?.into());
        }
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn quartiles_whiskers_and_one_outlier() {
        let b = summary(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 40.0]).unwrap();
        assert_eq!((b.first, b.median, b.third), (3.0, 5.0, 7.0));
        // One and a half boxes are 6: the whiskers end at 1 and at 8.
        assert_eq!((b.low, b.high, b.outliers.clone()), (1.0, 8.0, vec![40.0]));
        assert_eq!(summary(&[f64::NAN]), None);
    }
}
