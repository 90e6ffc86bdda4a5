//! The order of the rows: turned round, sorted, repeated, incomplete.
//!
//! In: frequencies as the file has them. Out: the order to take the rows in, and notes. Spec: `specs/frf.md`, "Order".

use super::error::FrfError;
use super::note::Note;
use super::settings::{Duplicates, ReadSettings, Unsorted};

/// Rows in ascending order, grouped by equal frequency.
pub(crate) fn groups(
    file: &str,
    line: &[u64],
    frequency: &[f64],
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Vec<Vec<usize>>, FrfError> {
    if let Some(i) = frequency.iter().position(|f| *f <= 0.0) {
        return Err(FrfError::Frequency { file: file.to_owned(), line: line[i], found: frequency[i] });
    }
    let mut order: Vec<usize> = (0..frequency.len()).collect();
    let falls = frequency.windows(2).position(|w| w[1] < w[0]);
    let rises = frequency.windows(2).position(|w| w[1] > w[0]);
    match (falls, rises) {
        (Some(_), None) => {
            order.reverse();
            notes.push(Note::Descending { points: order.len() });
        }
        (Some(fall), Some(rise)) => {
            // The odd one out is where the sweep's first direction breaks.
            let at = fall.max(rise) + 1;
            if settings.unsorted == Unsorted::Refuse {
                let (before, found) = (frequency[at - 1], frequency[at]);
                // One frequency in two places is a repeat before it is a disorder.
                if let Some(first) = frequency[..at].iter().position(|f| *f == found)
                    && settings.duplicates == Duplicates::Refuse
                {
                    return Err(duplicate(file, line, first, at, found));
                }
                return Err(FrfError::Unsorted { file: file.to_owned(), line: line[at], before, found });
            }
            order.sort_by(|a, b| frequency[*a].total_cmp(&frequency[*b]).then(a.cmp(b)));
            notes.push(Note::Sorted { first_line: line[at] });
        }
        _ => {}
    }
    let mut out: Vec<Vec<usize>> = Vec::with_capacity(order.len());
    for i in order {
        match out.last_mut() {
            Some(group) if frequency[group[0]] == frequency[i] => {
                if settings.duplicates == Duplicates::Refuse {
                    let (a, b) = (group[0].min(i), group[0].max(i));
                    return Err(duplicate(file, line, a, b, frequency[i]));
                }
                group.push(i);
            }
            _ => out.push(vec![i]),
        }
    }
    let repeated: Vec<usize> = out.iter().map(Vec::len).filter(|n| *n > 1).collect();
    if !repeated.is_empty() {
        notes.push(Note::Averaged { frequencies: repeated.len(), rows: repeated.iter().sum() });
    }
    Ok(out)
}

fn duplicate(file: &str, line: &[u64], first: usize, again: usize, found: f64) -> FrfError {
    FrfError::Duplicate { file: file.to_owned(), line: line[again], first_line: line[first], found }
}

/// A note for each step that is much longer than its neighbours, on a linear grid as on a logarithmic one.
pub(crate) fn gaps(hz: &[f64], notes: &mut Vec<Note>) {
    // Three steps and a half: two lost points in a row, however much the grid was rounded.
    const LONG: f64 = 2.5;
    let step = |i: usize| (hz[i + 1] - hz[i], (hz[i + 1] / hz[i]).ln());
    for i in 0..hz.len().saturating_sub(1) {
        let here = step(i);
        let near = [i.checked_sub(2), i.checked_sub(1), Some(i + 1), Some(i + 2)];
        let near: Vec<(f64, f64)> = near.into_iter().flatten().filter(|k| k + 1 < hz.len()).map(step).collect();
        let widest = near.iter().fold((0.0f64, 0.0f64), |m, s| (m.0.max(s.0), m.1.max(s.1)));
        if near.len() >= 2 && here.0 > LONG * widest.0 && here.1 > LONG * widest.1 {
            let missing = (here.1 / widest.1).min(here.0 / widest.0).round() as usize - 1;
            notes.push(Note::Gap { from_hz: hz[i], to_hz: hz[i + 1], missing });
        }
    }
}

/// Range (Hz) and number of rows that the lines above the rows declare.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Declared {
    pub low_hz: Option<f64>,
    pub high_hz: Option<f64>,
    pub rows: Option<usize>,
}

/// Looks for `start`, `stop` and `points` with a number behind them.
pub(crate) fn declared(preamble: &[String]) -> Declared {
    let mut out = Declared::default();
    for line in preamble {
        let lower = line.to_lowercase();
        let words: Vec<&str> = lower
            .split(|c: char| c.is_whitespace() || "=:,;()[]#%!\t_".contains(c))
            .filter(|w| !w.is_empty())
            .collect();
        for (i, word) in words.iter().enumerate() {
            let behind = || {
                let k =
                    (i + 1..words.len().min(i + 4)).find(|&k| words[k].starts_with(|c: char| c.is_ascii_digit()))?;
                let digits =
                    words[k].find(|c: char| !c.is_ascii_digit() && c != '.' && c != 'e').unwrap_or(words[k].len());
                let value = words[k][..digits].parse::<f64>().ok()?;
                let unit =
                    if digits < words[k].len() { &words[k][digits..] } else { words.get(k + 1).copied().unwrap_or("") };
                Some((value, unit.to_owned()))
            };
            let hertz = || {
                behind().and_then(|(value, unit)| match unit.as_str() {
                    "hz" => Some(value),
                    "khz" => Some(value * 1e3),
                    _ => None,
                })
            };
            match *word {
                "start" | "from" => out.low_hz = out.low_hz.or_else(hertz),
                "stop" | "end" | "to" => out.high_hz = out.high_hz.or_else(hertz),
                "points" | "rows" => {
                    let whole = behind().filter(|(v, _)| v.fract() == 0.0 && *v >= 1.0 && *v < 1e9);
                    out.rows = out.rows.or(whole.map(|(v, _)| v as usize));
                }
                _ => {}
            }
        }
    }
    out
}

/// Refuses a sweep that stops a step or more short of what was declared.
pub(crate) fn complete(
    file: &str,
    hz: &[f64],
    rows: usize,
    preamble: Declared,
    settings: &ReadSettings,
) -> Result<(), FrfError> {
    if let Some(declared) = preamble.rows
        && rows != declared
    {
        return Err(FrfError::RowsCut { file: file.to_owned(), found: rows, declared });
    }
    let (Some(&low), Some(&high)) = (hz.first(), hz.last()) else { return Ok(()) };
    let declared_low = settings.expected_hz.map(|r| r.0).or(preamble.low_hz);
    let declared_high = settings.expected_hz.map(|r| r.1).or(preamble.high_hz);
    // Half a step on the log axis is what rounding of the ends may take.
    let n = hz.len();
    let half = |i: usize| if n > 1 { (hz[i + 1] / hz[i]).sqrt() } else { 1.0 };
    let (first_half, last_half) = (half(0), half(n.saturating_sub(2)));
    let late = declared_low.is_some_and(|d| low > d * first_half.max(1.001));
    let early = declared_high.is_some_and(|d| high * last_half.max(1.001) < d);
    if late || early {
        return Err(FrfError::SweepCut {
            file: file.to_owned(),
            found_low_hz: low,
            found_high_hz: high,
            declared_low_hz: declared_low.unwrap_or(low),
            declared_high_hz: declared_high.unwrap_or(high),
        });
    }
    Ok(())
}
