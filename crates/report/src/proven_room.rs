//! The room to each limit that a certificate proves, as bars.
//!
//! In: a [`Certificate`]. Out: a [`Figure`], a panel for each machine. Convention: room is the share of the limit by which a figure keeps it, below 0
//! where it misses it. Spec: `specs/report.md`.

use super::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Series};
use super::proven_limit::{name, word};
use servotune::verify::{Certificate, LimitVerdict as Proven, ProvenLimit};

/// Machines drawn in one figure.
const DRAWN: usize = 6;

/// Worst and best end of the room to a limit as shares of it; none where that end is not bounded, or the limit is 0.
pub(super) fn room(l: &ProvenLimit) -> [Option<f64>; 2] {
    let size = l.required.abs();
    if size == 0.0 {
        return [None, None];
    }
    match l.side.as_str() {
        "at_least" => [l.proven.low, l.proven.high].map(|x| x.map(|x| (x - l.required) / size)),
        _ => [l.proven.high, l.proven.low].map(|x| x.map(|x| (l.required - x) / size)),
    }
}

/// Room to each limit over its proven interval, a panel for each machine; none where nothing is bounded.
pub(super) fn room_figure(
    c: &Certificate,
    machine_name: &dyn Fn(usize) -> String,
) -> Result<Option<Figure>, ReportError> {
    let cases = &c.cases;
    let mut panels = Vec::new();
    for (i, case) in cases.iter().take(DRAWN).enumerate() {
        let shown: Vec<(&ProvenLimit, [Option<f64>; 2])> =
            case.limits.iter().map(|l| (l, room(l))).filter(|(_, r)| r.iter().any(Option::is_some)).collect();
        if shown.is_empty() {
            continue;
        }
        let label = match cases.len() {
            1 => "Room to the limit".to_owned(),
            _ => format!("Room to the limit, {}", machine_name(i)),
        };
        let names: Vec<String> = shown.iter().rev().map(|(l, _)| name(case, l)).collect();
        let mut panel = Panel::new(Axis::linear(&label, "%"), Axis::named("", names.iter().map(String::as_str)));
        panel.height = (0.14 * shown.len() as f64).clamp(0.35, 3.0);
        // The limit itself is always in sight.
        let ends = || shown.iter().flat_map(|(_, r)| r).flatten().map(|x| 100.0 * x);
        let (low, high) = ends().fold((0.0f64, 1.0f64), |(a, b), x| (a.min(x), b.max(x)));
        let air = 0.04 * (high - low);
        panel.x.range = Some((low - air, high + air));
        panel.marks.push(RuleLine::vertical(0.0, if panels.is_empty() { "limit" } else { "" }, Ink::Limit));
        for (row, (l, [worst, best])) in shown.iter().rev().enumerate() {
            let at = row as f64;
            let ink = match l.verdict {
                Proven::Proved => Ink::Data(0),
                Proven::Violated => Ink::Limit,
                Proven::NotProved => Ink::Data(1),
            };
            let said = word(l.verdict).1;
            let mut bar = |from: f64, to: f64, half: f64| -> Result<(), ReportError> {
                let kind = Kind::Band { upper: vec![at + half; 2] };
                let band = Series::new(said, ink, kind, &[100.0 * from, 100.0 * to], &[at - half; 2])?;
                panel.marks.push(band.into());
                Ok(())
            };
            // What is not bounded on its bad side has no bar from the limit: nothing is known there.
            if let Some(worst) = worst {
                bar(0.0, *worst, 0.3)?;
            }
            if let (Some(worst), Some(best)) = (worst, best) {
                let thin = Series::new(said, ink, Kind::Solid, &[100.0 * worst, 100.0 * best], &[at; 2])?;
                panel.marks.push(thin.into());
            }
            if let (None, Some(best)) = (worst, best) {
                panel.marks.push(Series::new(said, ink, Kind::Points, &[100.0 * best], &[at])?.into());
            }
        }
        panels.push(panel);
    }
    let mut caption = "Each bar reaches from the limit to the worst that the proof leaves possible, the line on from there to the best; right of \
                       the red line the limit is kept. A dot without a bar has no bound on its bad side."
        .to_owned();
    if cases.len() > DRAWN {
        caption += &format!(" The first {DRAWN} of {} machines.", cases.len());
    }
    let figure = Figure { title: "Room that is proved".into(), caption, share_x: false, panels };
    Ok((!figure.panels.is_empty()).then_some(figure))
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotune::verify::BoundedFigure;

    fn limit(side: &str, low: Option<f64>, high: Option<f64>, verdict: Proven) -> ProvenLimit {
        ProvenLimit {
            name: "phase_margin_deg".into(),
            side: side.into(),
            required: 40.0,
            unit: "deg".into(),
            proven: BoundedFigure { low, high, hz: None },
            verdict,
        }
    }

    /// At least 40 with 38 to 44: worst 5 % short, best 10 % to spare. At most 40 with the same: worst 10 % too much, best 5 % to spare.
    #[test]
    fn room_is_counted_from_the_limit_towards_its_good_side() {
        let near = |found: [Option<f64>; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| a.is_some_and(|a| (a - b).abs() < 1e-12))
        };
        let both = |side| room(&limit(side, Some(38.0), Some(44.0), Proven::NotProved));
        assert!(near(both("at_least"), [-0.05, 0.1]));
        assert!(near(both("at_most"), [-0.1, 0.05]));
        // Without a low end nothing is known of the worst.
        assert_eq!(room(&limit("at_least", None, Some(44.0), Proven::NotProved))[0], None);
    }
}
