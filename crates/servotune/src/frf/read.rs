//! From a sweep file to a checked response.
//!
//! In: a path or bytes. Out: [`Sweep`]. Convention: rad/s, response phase. Spec: `specs/frf.md`.

use super::bytes::{digest, load, text, unpack};
use super::causality::PhaseReading;
use super::columns::{Columns, Pair, columns};
use super::decide::{frequency, reading};
use super::error::FrfError;
use super::header::Unit;
use super::note::{Basis, Note};
use super::order::{Declared, complete, declared, gaps, groups};
use super::outlier;
use super::response::Frf;
use super::settings::{DeviationScale, MagnitudeScale, Outliers, ReadSettings};
use super::table::table;
use super::{mat, mat_columns, touchstone, uff};
use crate::document::size_limits::PHASE_DEG;
use nalgebra::Complex;
use std::f64::consts::{LN_10, PI, TAU};
use std::path::Path;

/// A sweep as read: the response and everything that was decided on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The response; its phase is the response's own, never the margin display.
    pub frf: Frf,
    /// Coherence at each point, 0 to 1, where the file carries it.
    pub coherence: Option<Vec<f64>>,
    /// What was decided, in the order in which it was decided.
    pub notes: Vec<Note>,
    /// Rows of numbers that were read, before averaging of repeats.
    pub rows_read: usize,
    /// SHA-256 of the file as it lies there, compressed or not, in hexadecimal.
    pub source_digest: String,
}

/// Reads a sweep from a file: `.bod`, CSV, TSV or text, gzip or not, a universal file
/// with dataset 58, a MATLAB file of version 5 to 7.2, or Touchstone with one or two ports.
pub fn read_file(path: &Path, settings: &ReadSettings) -> Result<Sweep, FrfError> {
    let bytes = load(path, settings)?;
    read_bytes(&path.display().to_string(), &bytes, settings)
}

/// Reads a sweep from bytes; `name` stands in messages where a file's name would.
///
/// ```
/// use servotune::frf::{PhaseConvention, ReadSettings, read_bytes};
/// let settings = ReadSettings { phase: PhaseConvention::Margin, ..Default::default() };
/// let sweep = read_bytes("here", b"10 20 90\n20 8 60\n", &settings)?;
/// // 20 dB is a ratio of 10; a margin of 90 deg is a phase of -90 deg.
/// assert!((sweep.frf.value()[0].im + 10.0).abs() < 1e-12);
/// # Ok::<(), servotune::frf::FrfError>(())
/// ```
pub fn read_bytes(name: &str, bytes: &[u8], settings: &ReadSettings) -> Result<Sweep, FrfError> {
    let source_digest = digest(bytes);
    let inside = unpack(name, bytes, settings)?;
    let mut notes = Vec::new();
    let (columns, declared) = if uff::is_universal(&inside) {
        (uff::columns(name, &inside, settings, &mut notes)?, Declared::default())
    } else if mat::is_mat(name, &inside)? {
        (mat_columns::columns(name, &inside, settings, &mut notes)?, Declared::default())
    } else {
        let text = text(name, &inside, &mut notes)?;
        if touchstone::is_touchstone(name, &text) {
            (touchstone::columns(name, &text, settings, &mut notes)?, Declared::default())
        } else {
            let table = table(name, &text)?;
            (columns(name, &table, settings, &mut notes)?, declared(&table.preamble))
        }
    };
    let (frf, coherence) = assemble(name, &columns, declared, settings, &mut notes)?;
    Ok(Sweep { frf, coherence, notes, rows_read: columns.line.len(), source_digest })
}

fn assemble(
    file: &str,
    columns: &Columns,
    declared: Declared,
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<(Frf, Option<Vec<f64>>), FrfError> {
    let groups = groups(file, &columns.line, &columns.frequency, settings, notes)?;
    let factor = frequency(file, columns, settings, notes)?;
    let pick = |column: &[f64]| groups.iter().map(|g| column[g[0]]).collect::<Vec<f64>>();
    let w: Vec<f64> = pick(&columns.frequency).iter().map(|f| f * factor).collect();
    let hz: Vec<f64> = w.iter().map(|w| w / TAU).collect();
    complete(file, &hz, columns.line.len(), declared, settings)?;
    gaps(&hz, notes);
    let (first, second) = (pick(&columns.first), pick(&columns.second));
    varies(file, columns, &first, &second)?;
    super::dead::constant(file, columns.pair, &first, &second)?;
    positive(file, columns, settings)?;
    if let Some(i) = columns.second.iter().position(|p| columns.pair == Pair::Polar && p.abs() > PHASE_DEG) {
        return Err(FrfError::PhaseSize { file: file.to_owned(), line: columns.line[i], found: columns.second[i] });
    }
    let line: Vec<u64> = groups.iter().map(|g| columns.line[g[0]]).collect();
    super::dead::stuck(file, columns, (&hz, &line), (&first, &second))?;
    let reading = reading(file, columns, (&w, &first, &second), settings, notes)?;
    let rows = rows(file, columns, reading)?;
    let mean = |f: &dyn Fn(usize) -> f64, g: &[usize]| g.iter().map(|&i| f(i)).sum::<f64>() / g.len() as f64;
    let value: Vec<Complex<f64>> =
        groups.iter().map(|g| g.iter().map(|&i| rows[i]).sum::<Complex<f64>>() / g.len() as f64).collect();
    let relative = deviations(file, columns, &rows, reading, settings, notes)?;
    // Rows of one frequency count as independent: the mean of n is sqrt(n) surer.
    let relative = relative.map(|r| {
        groups.iter().map(|g| mean(&|i| r[i] * r[i], g).sqrt() / (g.len() as f64).sqrt()).collect::<Vec<f64>>()
    });
    if let Some(c) = &columns.coherence
        && let Some(i) = c.iter().position(|c| !(0.0..=1.0 + 1e-9).contains(c))
    {
        return Err(FrfError::Coherence { file: file.to_owned(), line: columns.line[i], found: c[i] });
    }
    let coherence = columns.coherence.as_ref().map(|c| groups.iter().map(|g| mean(&|i| c[i].min(1.0), g)).collect());
    let shape = |source| FrfError::Shape { file: file.to_owned(), source };
    let frf = Frf::new(w, value, relative).map_err(shape)?;
    without_single_points(file, frf, coherence, &line, settings, notes)
}

/// Most points that may stand alone: these, or one in so many.
const ALONE: usize = 3;
const ONE_IN: usize = 100;

/// The response without the points that stand alone, each with a note; as it is where the caller keeps them.
fn without_single_points(
    file: &str,
    frf: Frf,
    coherence: Option<Vec<f64>>,
    line: &[u64],
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<(Frf, Option<Vec<f64>>), FrfError> {
    let alone = match settings.outliers {
        Outliers::Keep => Vec::new(),
        Outliers::Drop | Outliers::Refuse => outlier::alone(frf.w_rad_s(), frf.value()),
    };
    let Some(&(first, off)) = alone.first() else { return Ok((frf, coherence)) };
    let hz = |i: usize| frf.w_rad_s()[i] / TAU;
    if settings.outliers == Outliers::Refuse {
        let (line, at_hz, factor) = (line[first], hz(first), off.exp());
        return Err(FrfError::Outlier { file: file.to_owned(), line, at_hz, factor });
    }
    if alone.len() > ALONE.max(frf.len() / ONE_IN) {
        let (found, points, line, first_hz) = (alone.len(), frf.len(), line[first], hz(first));
        return Err(FrfError::Outliers { file: file.to_owned(), found, points, line, first_hz });
    }
    notes.extend(alone.iter().map(|&(i, off)| Note::Outlier { line: line[i], at_hz: hz(i), factor: off.exp() }));
    let kept: Vec<usize> = (0..frf.len()).filter(|i| !alone.iter().any(|(a, _)| a == i)).collect();
    let pick = |all: &[f64]| kept.iter().map(|&i| all[i]).collect::<Vec<f64>>();
    let value = kept.iter().map(|&i| frf.value()[i]).collect();
    let coherence = coherence.map(|c| pick(&c));
    let frf = frf
        .alike(pick(frf.w_rad_s()), value, frf.relative_std().map(pick))
        .map_err(|source| FrfError::Shape { file: file.to_owned(), source })?;
    Ok((frf, coherence))
}

/// Refuses a magnitude column in which nothing changes.
fn varies(file: &str, columns: &Columns, first: &[f64], second: &[f64]) -> Result<(), FrfError> {
    let same = |c: &[f64]| c.windows(2).all(|w| w[0] == w[1]);
    let constant = same(first) && (columns.pair == Pair::Polar || same(second));
    if first.len() >= 4 && constant {
        return Err(FrfError::ConstantMagnitude { file: file.to_owned(), rows: first.len(), found: first[0] });
    }
    Ok(())
}

/// Refuses magnitudes that cannot be linear where they are said to be.
fn positive(file: &str, columns: &Columns, settings: &ReadSettings) -> Result<(), FrfError> {
    let said = match settings.magnitude {
        MagnitudeScale::Auto => columns.unit(1).is_some_and(|(unit, _)| unit == Unit::Linear),
        scale => scale == MagnitudeScale::Linear,
    };
    match columns.first.iter().position(|m| *m <= 0.0) {
        Some(i) if said && columns.pair == Pair::Polar => {
            Err(FrfError::Magnitude { file: file.to_owned(), line: columns.line[i], found: columns.first[i] })
        }
        _ => Ok(()),
    }
}

/// The complex value of each row.
fn rows(file: &str, columns: &Columns, reading: PhaseReading) -> Result<Vec<Complex<f64>>, FrfError> {
    let mut out = Vec::with_capacity(columns.line.len());
    for ((&a, &b), &line) in columns.first.iter().zip(&columns.second).zip(&columns.line) {
        out.push(match columns.pair {
            Pair::Cartesian => Complex::new(a, if reading.conjugated { -b } else { b }),
            Pair::Polar => {
                let size = reading.ratio(a);
                if !size.is_finite() || size <= 0.0 {
                    return Err(FrfError::Magnitude { file: file.to_owned(), line, found: a });
                }
                polar(size, b, reading)
            }
        });
    }
    Ok(out)
}

/// The value from its magnitude and the phase as written. Whole quarters in degrees give exact zeros.
fn polar(size: f64, written: f64, reading: PhaseReading) -> Complex<f64> {
    if !reading.degrees {
        return Complex::from_polar(size, reading.response_phase(written));
    }
    let turned = if reading.conjugated { -written } else { written };
    let degrees = if reading.margin { turned - 180.0 } else { turned };
    let wrapped = degrees % 360.0;
    match wrapped.abs() {
        0.0 => Complex::new(size, 0.0),
        180.0 => Complex::new(-size, 0.0),
        90.0 => Complex::new(0.0, size.copysign(wrapped)),
        270.0 => Complex::new(0.0, -size.copysign(wrapped)),
        _ => Complex::from_polar(size, wrapped * PI / 180.0),
    }
}

/// Relative standard deviations of the rows.
fn deviations(
    file: &str,
    columns: &Columns,
    rows: &[Complex<f64>],
    reading: PhaseReading,
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Option<Vec<f64>>, FrfError> {
    let Some(std) = &columns.std else { return Ok(None) };
    if let Some(i) = std.iter().position(|s| *s < 0.0) {
        return Err(FrfError::Deviation { file: file.to_owned(), line: columns.line[i], found: std[i] });
    }
    let relative = |factor: f64| std.iter().map(|s| s * factor).collect::<Vec<f64>>();
    let absolute = || std.iter().zip(rows).map(|(s, v)| s / v.norm()).collect::<Vec<f64>>();
    let header = |words: &str| Basis::Header(words.to_owned());
    let (values, is_relative, ground) = match (settings.deviation, columns.unit(3)) {
        (DeviationScale::Absolute, _) => return Ok(Some(absolute())),
        (DeviationScale::Relative, _) => return Ok(Some(relative(1.0))),
        (_, Some((Unit::Relative, words))) => (relative(1.0), true, header(words)),
        (_, Some((Unit::Percent, words))) => (relative(0.01), true, header(words)),
        (_, Some((Unit::Decibels, words))) => (relative(LN_10 / 20.0), true, header(words)),
        // Beside decibels a bare number is in decibels, beside a linear magnitude in its unit.
        _ if columns.pair == Pair::Polar && reading.decibels => (relative(LN_10 / 20.0), true, Basis::Contract),
        _ => (absolute(), false, Basis::Contract),
    };
    notes.push(Note::Deviation { relative: is_relative, ground });
    Ok(Some(values))
}
