//! Seeded changes of a file: what a hand, a bad disk, another program or an enemy does to it.
//!
//! In: bytes, a random stream. Out: changed bytes, and what was done. The same stream gives the same bytes.

use servotune::numeric::random::Random;

/// What was done to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mutated {
    /// The changed bytes.
    pub bytes: Vec<u8>,
    /// In words.
    pub what: &'static str,
    /// A channel of a sweep was killed where it moves: whoever accepts it now is wrong.
    pub dead: bool,
}

/// Numbers that readers trip over.
const ODD: [&str; 28] = [
    "nan",
    "inf",
    "-inf",
    "NaN",
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "1e400",
    "1e150",
    "1e30",
    "1e20",
    "1e9",
    "1e5",
    "1e-9",
    "1e-17",
    "1e-160",
    "9e15",
    "18446744073709551616",
    "-9223372036854775809",
    "0x10",
    "1_000",
    "1,5",
    "",
    "\u{221e}",
];

fn below(r: &mut Random, n: usize) -> usize {
    (r.bits() % n.max(1) as u64) as usize
}

/// Changes `bytes`; `table` allows changes of whole columns of numbers.
pub fn mutate(bytes: &[u8], table: bool, r: &mut Random) -> Mutated {
    let text = std::str::from_utf8(bytes).ok().filter(|t| !t.is_empty());
    let plain = |what, bytes| Mutated { bytes, what, dead: false };
    match (text, below(r, if table { 12 } else { 9 })) {
        (Some(t), 0..=2) => plain("a number", number(t, r).into_bytes()),
        (Some(t), 3) => plain("lines", lines(t, r).into_bytes()),
        (Some(t), 4) => plain("a word", word(t, r).into_bytes()),
        (_, 5) => plain("cut", bytes[..below(r, bytes.len())].to_vec()),
        (_, 6) => plain("blown up", blown(bytes, r)),
        (Some(t), 9) => column(t, r),
        (Some(t), 10 | 11) => dead(t, r),
        (None, 9..) | (_, 7) => plain("bytes", flipped(bytes, r)),
        _ => plain("spliced", spliced(bytes, r)),
    }
}

fn flipped(bytes: &[u8], r: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=below(r, 4) {
        let at = below(r, out.len());
        match below(r, 3) {
            0 if at < out.len() => out[at] ^= 1 << below(r, 8),
            1 if at < out.len() => drop(out.remove(at)),
            _ => out.insert(at.min(out.len()), r.bits() as u8),
        }
    }
    out
}

/// A piece of the file put into another place of it.
fn spliced(bytes: &[u8], r: &mut Random) -> Vec<u8> {
    let from = below(r, bytes.len());
    let piece = &bytes[from..(from + below(r, 64)).min(bytes.len())];
    let at = below(r, bytes.len() + 1);
    [&bytes[..at.min(bytes.len())], piece, &bytes[at.min(bytes.len())..]].concat()
}

/// A piece repeated some thousand times.
fn blown(bytes: &[u8], r: &mut Random) -> Vec<u8> {
    let at = below(r, bytes.len());
    let piece = bytes[at..(at + 1 + below(r, 12)).min(bytes.len())].to_vec();
    [&bytes[..at], &piece.repeat(1 << below(r, 15)), &bytes[at..]].concat()
}

/// Places of the numbers in a text.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let part = |b: u8| b.is_ascii_digit() || b".-+eE".contains(&b);
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let end = at + bytes[at..].iter().take_while(|b| part(**b)).count();
        if end > at && bytes[at..end].iter().any(u8::is_ascii_digit) {
            found.push(at..end);
        }
        at = end.max(at + 1);
    }
    found
}

fn number(text: &str, r: &mut Random) -> String {
    let all = numbers(text);
    if all.is_empty() {
        return text.to_owned();
    }
    let place = all[below(r, all.len())].clone();
    let new = match text[place.clone()].parse::<f64>() {
        Ok(x) if below(r, 3) == 0 => format!("{:e}", x * 10f64.powf(r.between(-12.0, 12.0))),
        Ok(x) if below(r, 4) == 0 => (-x).to_string(),
        Ok(x) if below(r, 4) == 0 => (x * (1.0 + 1e-9 * r.normal())).to_string(),
        _ => ODD[below(r, ODD.len())].to_owned(),
    };
    [&text[..place.start], &new, &text[place.end..]].concat()
}

fn lines(text: &str, r: &mut Random) -> String {
    let mut all: Vec<&str> = text.lines().collect();
    let (a, b) = (below(r, all.len()), below(r, all.len()));
    match below(r, 5) {
        0 => drop(all.remove(a)),
        1 => all.insert(a, all[b]),
        2 => all.swap(a, b),
        3 => all.truncate(a.max(1)),
        // A few rows of many are left.
        _ => all = all.iter().copied().step_by(1 + all.len() / (3 + below(r, 9))).collect(),
    }
    let end = if below(r, 5) == 0 { "\r\n" } else { "\n" };
    all.join(end) + end
}

fn word(text: &str, r: &mut Random) -> String {
    let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty()).collect();
    if words.is_empty() {
        return text.to_owned();
    }
    let (a, b) = (words[below(r, words.len())], words[below(r, words.len())]);
    let new = match below(r, 4) {
        0 => b.to_owned(),
        1 => format!("{a}{b}"),
        2 => "\u{feff}\u{202e}\"'<script>=cmd|".to_owned(),
        _ => a.chars().rev().collect(),
    };
    text.replacen(a, &new, 1 + below(r, 3))
}

/// The rows of a table with their fields: the first line of which every field is a number, and on.
fn rows(text: &str) -> Option<(usize, char, Vec<Vec<String>>)> {
    let lines: Vec<&str> = text.lines().collect();
    let separator = ['\t', ';', ','].into_iter().find(|s| lines.last().is_some_and(|l| l.contains(*s)))?;
    let is_row =
        |l: &&str| l.split(separator).count() > 1 && l.split(separator).all(|f| f.trim().parse::<f64>().is_ok());
    let first = lines.iter().position(is_row)?;
    let all = lines[first..].iter().map(|l| l.split(separator).map(|f| f.trim().to_owned()).collect()).collect();
    Some((first, separator, all))
}

fn joined(text: &str, first: usize, separator: char, rows: &[Vec<String>]) -> Vec<u8> {
    let mut out: Vec<String> = text.lines().take(first).map(str::to_owned).collect();
    out.extend(rows.iter().map(|r| r.join(&separator.to_string())));
    (out.join("\n") + "\n").into_bytes()
}

/// A whole column: scaled, turned, two of them exchanged.
fn column(text: &str, r: &mut Random) -> Mutated {
    let Some((first, separator, mut all)) = rows(text) else {
        return Mutated { bytes: flipped(text.as_bytes(), r), what: "bytes", dead: false };
    };
    let width = all[0].len();
    let (a, b) = (below(r, width), below(r, width));
    let scale = if below(r, 2) == 0 { 10f64.powf(r.between(-150.0, 150.0)) } else { -1.0 };
    let exchange = below(r, 3) == 0;
    for row in all.iter_mut().filter(|row| row.len() == width) {
        if exchange {
            row.swap(a, b);
        } else if let Ok(x) = row[a].parse::<f64>() {
            row[a] = (x * scale).to_string();
        }
    }
    Mutated { bytes: joined(text, first, separator, &all), what: "a column", dead: false }
}

/// The second or third column of a sweep stops moving: everywhere, from a row on, or over a third of the rows.
fn dead(text: &str, r: &mut Random) -> Mutated {
    let Some((first, separator, mut all)) = rows(text).filter(|t| t.2.len() >= 24 && t.2[0].len() == 3) else {
        return Mutated { bytes: spliced(text.as_bytes(), r), what: "spliced", dead: false };
    };
    let (which, n) = (1 + below(r, 2), all.len());
    let (from, end) = match below(r, 3) {
        0 => (0, n),
        1 => (n / 4 + below(r, n / 4), n),
        _ => {
            let from = n / 4 + below(r, n / 4);
            (from, from + n / 3)
        }
    };
    let value =
        if from == 0 { ["0", "1", "45", "-180", "9e15"][below(r, 5)].to_owned() } else { all[from][which].clone() };
    all[from..end].iter_mut().for_each(|row| row[which].clone_from(&value));
    Mutated { bytes: joined(text, first, separator, &all), what: "a dead channel", dead: true }
}
