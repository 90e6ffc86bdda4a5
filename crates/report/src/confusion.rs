//! Confusion matrices: which class was said of machines of which class.
//!
//! In: counts `[truth][said]`, a matrix for each part of the data. Out: a [`Figure`], a panel for each part. Convention: a row is a true
//! class, from top to bottom; shade is the share of the row; what is right stands on the diagonal. Spec: `specs/report.md`.

use super::error::{ReportError, same_length};
use super::figure::{Axis, Figure, Ink, Mark, Panel, Tile};

/// The matrix of one part.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// Which part.
    pub name: &'a str,
    /// Counts `[truth][said]`.
    pub counts: &'a [Vec<usize>],
}

/// A panel for each part; refuses a matrix that is not as wide and as high as there are names.
pub fn confusion(title: &str, caption: &str, names: &[String], parts: &[Part]) -> Result<Figure, ReportError> {
    let n = names.len();
    let mut panels = Vec::new();
    for part in parts {
        same_length(part.name, "the rows", n, part.counts.len())?;
        let right: usize = part.counts.iter().enumerate().filter_map(|(i, row)| row.get(i)).sum();
        let all: usize = part.counts.iter().flatten().sum();
        let share = if all == 0 { "no machines".to_owned() } else { format!("{right} of {all} right") };
        let said = format!("Said: {}, {share}", part.name);
        let x = Axis::named(&said, names.iter().map(String::as_str));
        // The first class stands at the top.
        let mut panel = Panel::new(x, Axis::named("Truth", names.iter().rev().map(String::as_str)));
        panel.height = 0.8;
        for (truth, row) in part.counts.iter().enumerate() {
            same_length(part.name, "the columns", n, row.len())?;
            let total: usize = row.iter().sum();
            let y = (n - 1 - truth) as f64;
            for (at, &count) in row.iter().enumerate() {
                let x = at as f64;
                let share = count as f64 / total.max(1) as f64;
                // An error is never too faint to be seen.
                let (ink, shade) = if at == truth { (Ink::Data(0), share) } else { (Ink::Limit, share.max(0.35)) };
                panel.marks.push(Mark::Tile(Tile {
                    x: (x - 0.48, x + 0.48),
                    y: (y - 0.46, y + 0.46),
                    shade: if count == 0 { 0.0 } else { shade },
                    text: format!("{count}"),
                    ink,
                }));
            }
        }
        panels.push(panel);
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::svg::{Size, standalone};

    #[test]
    fn rows_are_truths_from_the_top_and_every_count_is_written() {
        let names = ["good".to_owned(), "bad <1>".to_owned()];
        let counts = vec![vec![7, 2], vec![0, 5]];
        let part = Part { name: "test", counts: &counts };
        let figure = confusion("t", "c", &names, &[part]).unwrap();
        let tile = |i: usize| match &figure.panels[0].marks[i] {
            Mark::Tile(t) => (t.x.0 + 0.48, t.y.0 + 0.46, t.text.clone()),
            other => panic!("{other:?}"),
        };
        // Truth 0 said 1: first row (top), second column.
        assert_eq!(tile(1), (1.0, 1.0, "2".to_owned()));
        assert_eq!(tile(2), (0.0, 0.0, "0".to_owned()));
        assert!(figure.panels[0].x.label.contains("12 of 14 right"));
        let svg = standalone(&figure, Size::WIDE);
        assert!(svg.contains(">7</text>") && svg.contains("bad &lt;1&gt;") && !svg.contains("bad <1>"));
    }

    #[test]
    fn a_matrix_of_another_size_is_refused() {
        let counts = vec![vec![1, 0]];
        let names = ["a".to_owned(), "b".to_owned()];
        let part = Part { name: "test", counts: &counts };
        assert!(matches!(confusion("t", "c", &names, &[part]), Err(ReportError::SeriesLength { .. })));
    }
}
