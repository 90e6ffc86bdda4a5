//! Marks as SVG elements, in pixels of the unzoomed picture.
//!
//! In: a placed panel. Out: path data. Convention: a NaN lifts the pen; a point is a stroke of no length with round
//! ends, so that zooming by a plain transform keeps it round. Spec: `specs/report.md`.

use super::figure::{Circle, Direction, Kind, Mark, Region, RuleLine, Scale, Series, Tile};
use super::layout::{Layout, Placed};
use super::palette::class;
use std::fmt::Write;

/// As far outside as a place needs to be (px).
const FAR: f64 = 30000.0;

/// A pixel position with two decimals and no superfluous zero; far outside is as good as farther outside.
pub(super) fn px(value: f64) -> String {
    let text = format!("{:.2}", value.clamp(-2.0 * FAR, 2.0 * FAR));
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Which legend entry a name belongs to.
pub(super) fn key_of(layout: &Layout, name: &str) -> Option<usize> {
    if name.is_empty() { None } else { layout.keys.iter().position(|key| key.name == name) }
}

/// The mark as an element of the data layer; words are drawn elsewhere.
pub(super) fn draw(layout: &Layout, placed: &Placed, mark: &Mark, points: usize) -> String {
    match mark {
        Mark::Series(series) => {
            let (style, path) = draw_series(placed, series, points);
            element(&path, style, class(series.ink), key_of(layout, &series.name))
        }
        Mark::Line(line) => rule(placed, line),
        Mark::Region(region) => zone(placed, region),
        Mark::Circle(circle) => ring(placed, circle, key_of(layout, &circle.label)),
        Mark::Note(note) => {
            let (x, y) = (placed.px(note.at.0), placed.py(note.at.1));
            if x.is_nan() || y.is_nan() {
                return String::new();
            }
            element(&format!("M{} {}h0", px(x), px(y)), "dots", class(note.ink), None)
        }
        Mark::Tile(t) => tile(placed, t),
    }
}

/// The strongest shade leaves words on it legible in light and in dark.
const STRONGEST: f64 = 0.42;

fn tile(placed: &Placed, tile: &Tile) -> String {
    let (left, right) = (placed.px(tile.x.0), placed.px(tile.x.1));
    let (bottom, top) = (placed.py(tile.y.0), placed.py(tile.y.1));
    if ![left, right, bottom, top].iter().all(|v| v.is_finite()) {
        return String::new();
    }
    let path = format!("M{} {}H{}V{}H{}z", px(left), px(bottom), px(right), px(top), px(left));
    let shade = px(STRONGEST * tile.shade.clamp(0.0, 1.0));
    let shaded = format!(r#"<path fill-opacity="{shade}""#);
    element(&path, "fill", class(tile.ink), None).replacen("<path", &shaded, 1)
}

fn element(path: &str, style: &str, ink: &str, key: Option<usize>) -> String {
    if path.is_empty() {
        return String::new();
    }
    match key {
        Some(key) => format!(r#"<path class="{style} {ink}" data-k="{key}" d="{path}"/>"#),
        None => format!(r#"<path class="{style} {ink}" d="{path}"/>"#),
    }
}

fn draw_series(placed: &Placed, series: &Series, limit: usize) -> (&'static str, String) {
    let mut path = String::new();
    let place = |x: f64, y: f64| (placed.px(x), placed.py(y));
    let kept = thin(series, limit);
    match &series.kind {
        Kind::Solid | Kind::Dashed => {
            polygon(&mut path, kept.iter().map(|&i| place(series.x[i], series.y[i])));
            (if series.kind == Kind::Solid { "line" } else { "line dash" }, path)
        }
        Kind::Points => {
            for (x, y) in kept.iter().map(|&i| place(series.x[i], series.y[i])) {
                if x.is_finite() && y.is_finite() {
                    let _ = write!(path, "M{} {}h0", px(x), px(y));
                }
            }
            ("dots", path)
        }
        Kind::Stairs => {
            let corners = kept.windows(2).flat_map(|pair| {
                let held = series.y[pair[0]];
                [place(series.x[pair[0]], held), place(series.x[pair[1]], held)]
            });
            let last = kept.last().map(|&i| place(series.x[i], series.y[i]));
            polygon(&mut path, corners.chain(last));
            ("line", path)
        }
        Kind::Bars { from, to } => {
            let floor = match placed.y.scale {
                Scale::Linear => placed.py(0.0),
                Scale::Log10 => placed.area.y + placed.area.h,
            };
            for (&x, &y) in series.x.iter().zip(&series.y) {
                let (left, right, top) = (placed.px(x + from), placed.px(x + to), placed.py(y));
                if left.is_finite() && right.is_finite() && top.is_finite() {
                    let _ = write!(path, "M{} {}V{}H{}V{}z", px(left), px(floor), px(top), px(right), px(floor));
                }
            }
            ("fill", path)
        }
        Kind::Caps { from, to } => {
            for (&x, &y) in series.x.iter().zip(&series.y) {
                let (left, right, row) = (placed.px(x + from), placed.px(x + to), placed.py(y));
                if left.is_finite() && right.is_finite() && row.is_finite() {
                    let _ = write!(path, "M{} {}H{}", px(left), px(row), px(right));
                }
            }
            ("caps", path)
        }
        Kind::Band { upper } => {
            for run in runs(placed, series, upper) {
                let upper_edge = run.iter().rev().map(|&i| place(series.x[i], upper[i]));
                polygon(&mut path, run.iter().map(|&i| place(series.x[i], series.y[i])).chain(upper_edge));
                path.push('z');
            }
            ("band", path)
        }
    }
}

/// Stretches of a band without a gap.
fn runs(placed: &Placed, series: &Series, upper: &[f64]) -> Vec<Vec<usize>> {
    let mut runs: Vec<Vec<usize>> = vec![Vec::new()];
    for (i, ((&x, &low), &high)) in series.x.iter().zip(&series.y).zip(upper).enumerate() {
        let whole = [placed.px(x), placed.py(low), placed.py(high)].iter().all(|v| v.is_finite());
        match runs.last_mut() {
            Some(run) if whole => run.push(i),
            Some(run) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

/// Relative steps in hundredths of a pixel: half as long as places, and the rounding does not add up.
fn polygon(path: &mut String, points: impl Iterator<Item = (f64, f64)>) {
    let mut before: Option<(i64, i64)> = None;
    for (x, y) in points {
        if !(x.is_finite() && y.is_finite()) {
            before = None;
            continue;
        }
        let hundredths = |v: f64| (v.clamp(-FAR, FAR) * 100.0).round() as i64;
        let at = (hundredths(x), hundredths(y));
        match before {
            None => {
                let _ = write!(path, "M{} {}l0 0", hundredth(at.0), hundredth(at.1));
            }
            Some((x, y)) if (x, y) != at => {
                let _ = write!(path, " {} {}", hundredth(at.0 - x), hundredth(at.1 - y));
            }
            Some(_) => {}
        }
        before = Some(at);
    }
}

fn hundredth(value: i64) -> String {
    let text = px(value as f64 / 100.0);
    match text.strip_prefix("-0.") {
        Some(rest) => format!("-.{rest}"),
        None => text.strip_prefix("0.").map_or_else(|| text.clone(), |rest| format!(".{rest}")),
    }
}

/// Indices of the points to draw: all, or first, smallest, largest and last of each bucket, so that no peak is lost.
pub(super) fn thin(series: &Series, limit: usize) -> Vec<usize> {
    let n = series.x.len();
    let ascending = series.x.windows(2).all(|pair| pair[0] < pair[1]);
    if n <= limit.max(8) || !ascending || !matches!(series.kind, Kind::Solid | Kind::Dashed | Kind::Points) {
        return (0..n).collect();
    }
    let buckets = limit.max(8) / 4;
    let mut kept = Vec::with_capacity(limit + 4);
    for bucket in 0..buckets {
        let (start, end) = (bucket * n / buckets, (bucket + 1) * n / buckets);
        let finite = || (start..end).filter(|&i| series.y[i].is_finite());
        let mut four = vec![start, end - 1];
        four.extend(finite().min_by(|&a, &b| series.y[a].total_cmp(&series.y[b])));
        four.extend(finite().max_by(|&a, &b| series.y[a].total_cmp(&series.y[b])));
        // A gap stays a gap.
        four.extend((start..end).find(|&i| !series.y[i].is_finite()));
        four.sort_unstable();
        four.dedup();
        kept.extend(four);
    }
    kept
}

fn rule(placed: &Placed, line: &RuleLine) -> String {
    let area = placed.area;
    let (path, at) = match line.on {
        Direction::X => (format!("M{} {}v{}", px(placed.px(line.at)), px(area.y), px(area.h)), placed.px(line.at)),
        Direction::Y => (format!("M{} {}h{}", px(area.x), px(placed.py(line.at)), px(area.w)), placed.py(line.at)),
    };
    if !at.is_finite() {
        return String::new();
    }
    stretchable(line.on, &element(&path, "rule", class(line.ink), None))
}

/// A rule or zone spans the whole panel at any zoom: the script stretches it along one axis only.
fn stretchable(on: Direction, element: &str) -> String {
    let axis = if on == Direction::X { "x" } else { "y" };
    element.replacen("<path", &format!(r#"<path data-only="{axis}""#), 1)
}

fn zone(placed: &Placed, region: &Region) -> String {
    let area = placed.area;
    // Beyond the view is far enough: ten views away, so that zooming out does not meet the edge.
    let bound = |share: f64, edge: f64| if share.is_nan() { edge } else { share.clamp(-10.0, 11.0) };
    let path = match region.on {
        Direction::X => {
            let from = area.x + bound(placed.x.share(region.from), -10.0) * area.w;
            let to = area.x + bound(placed.x.share(region.to), 11.0) * area.w;
            format!("M{} {}H{}v{}H{}z", px(from), px(area.y), px(to), px(area.h), px(from))
        }
        Direction::Y => {
            let from = area.y + (1.0 - bound(placed.y.share(region.from), -10.0)) * area.h;
            let to = area.y + (1.0 - bound(placed.y.share(region.to), 11.0)) * area.h;
            format!("M{} {}V{}h{}V{}z", px(area.x), px(from), px(to), px(area.w), px(from))
        }
    };
    stretchable(region.on, &element(&path, "zone", class(region.ink), None))
}

fn ring(placed: &Placed, circle: &Circle, key: Option<usize>) -> String {
    let (x, y) = (placed.px(circle.centre.0), placed.py(circle.centre.1));
    let rx = (placed.px(circle.centre.0 + circle.radius) - x).abs();
    let ry = (placed.py(circle.centre.1 + circle.radius) - y).abs();
    if ![x, y, rx, ry].iter().all(|v| v.is_finite()) {
        return String::new();
    }
    if circle.radius == 0.0 {
        return element(&format!("M{} {}h0", px(x), px(y)), "dots", class(circle.ink), key);
    }
    // From the top, half way down and back.
    let path = format!(
        "M{} {top}a{rx} {ry} 0 1 1 0 {down}a{rx} {ry} 0 1 1 0 -{down}z",
        px(x),
        top = px(y - ry),
        down = px(2.0 * ry),
        rx = px(rx),
        ry = px(ry),
    );
    element(&path, if circle.filled { "disc" } else { "ring" }, class(circle.ink), key)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::figure::Ink;

    #[test]
    fn thinning_keeps_a_lone_peak_and_a_lone_gap() {
        let n = 100_000;
        let x: Vec<f64> = (0..n).map(f64::from).collect();
        for at in [0usize, 1, 49_999, 77_777, 99_999] {
            let mut y = vec![0.0; n as usize];
            y[at] = 5.0;
            y[(at + 500) % n as usize] = f64::NAN;
            let series = Series::new("record", Ink::Data(0), Kind::Solid, &x, &y).unwrap();
            let kept = thin(&series, 1200);
            assert!(kept.contains(&at) && kept.contains(&((at + 500) % n as usize)));
            // Four points and at most one gap for each of 300 buckets.
            assert!(kept.len() <= 1500 && kept.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }

    #[test]
    fn relative_steps_add_up_to_the_place() {
        let mut path = String::new();
        let places: Vec<(f64, f64)> =
            (0..1000).map(|k| (f64::from(k) / 3.0, (f64::from(k) * 0.7).sin() * 40.0)).collect();
        polygon(&mut path, places.iter().copied());
        let numbers = path.replace(['M', 'l'], " ");
        let numbers: Vec<f64> = numbers.split_whitespace().map(|t| t.parse().unwrap()).collect();
        let end = numbers.chunks(2).fold((0.0, 0.0), |sum, step| (sum.0 + step[0], sum.1 + step[1]));
        // Half a hundredth of a pixel, however many steps; the rest is the rounding of this sum.
        let last = places[999];
        assert!((end.0 - last.0).abs() < 0.0051 && (end.1 - last.1).abs() < 0.0051, "{end:?} {last:?}");
    }
}
