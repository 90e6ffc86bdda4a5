//! Units and convention of the columns: from the caller, the header, the data, in that order.
//!
//! In: ascending columns and what the header says. Out: the [`PhaseReading`] and the notes. Spec: `specs/frf.md`, "Deciding".

use super::causality::{Misfit, PhaseEvidence, PhaseReading, evidence, misfits};
use super::columns::{Columns, Pair};
use super::error::{FrfError, Question, SweepDoubt};
use super::header::Unit;
use super::note::{Basis, Note};
use super::settings::{AngleUnit, Conjugate, FrequencyUnit, MagnitudeScale, PhaseConvention, ReadSettings};
use std::f64::consts::{PI, TAU};

/// How to read the frequency column: the factor to rad/s.
pub(crate) fn frequency(
    file: &str,
    columns: &Columns,
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<f64, FrfError> {
    let factor = |unit| if unit == FrequencyUnit::RadPerSec { 1.0 } else { TAU };
    if settings.frequency != FrequencyUnit::Auto {
        return Ok(factor(settings.frequency));
    }
    let low = columns.frequency.iter().copied().fold(f64::INFINITY, f64::min);
    let high = columns.frequency.iter().copied().fold(0.0, f64::max);
    // The ends of a sweep are set by a person, in round numbers of some unit.
    let as_written = round(low) || round(high);
    let as_hertz = high > low && round(low / TAU) && round(high / TAU);
    let turned = as_hertz && !as_written;
    match columns.unit(0) {
        Some((Unit::RadPerSec, words)) => {
            notes.push(Note::Frequency { unit: FrequencyUnit::RadPerSec, ground: Basis::Header(words.to_owned()) });
            Ok(1.0)
        }
        Some((unit, words)) => {
            if turned {
                return Err(FrfError::Contradiction {
                    file: file.to_owned(),
                    question: Question::Frequency,
                    says: words.to_owned(),
                    doubt: SweepDoubt::RoundEnds { low: low / TAU, high: high / TAU },
                });
            }
            notes.push(Note::Frequency { unit: FrequencyUnit::Hertz, ground: Basis::Header(words.to_owned()) });
            Ok(if unit == Unit::Kilohertz { 1e3 * TAU } else { TAU })
        }
        None if turned => {
            let ground = Basis::RoundEnds(tidy(low / TAU), tidy(high / TAU));
            notes.push(Note::Frequency { unit: FrequencyUnit::RadPerSec, ground });
            Ok(1.0)
        }
        None => {
            notes.push(Note::Frequency { unit: FrequencyUnit::Hertz, ground: Basis::Contract });
            Ok(TAU)
        }
    }
}

/// Two significant digits tell the number to 2 parts in 100 000: one number in 250 is that by chance, two in 60 000.
fn round(value: f64) -> bool {
    (tidy(value) - value).abs() <= 2e-5 * value
}

/// The nearest number of two significant digits.
fn tidy(value: f64) -> f64 {
    if value <= 0.0 {
        return 0.0;
    }
    let exponent = value.log10().floor() as i32 - 1;
    let scaled = (value / 10f64.powi(exponent)).round();
    // Multiply or divide by a whole power, whichever is exact.
    if exponent >= 0 { scaled * 10f64.powi(exponent) } else { scaled / 10f64.powi(-exponent) }
}

/// What the header settles, per question; `None` leaves it open.
struct Said {
    decibels: Option<bool>,
    degrees: Option<bool>,
    margin: Option<bool>,
}

/// How to read magnitude and phase. `w` (rad/s), `first` and `second` are ascending and without repeats.
pub(crate) fn reading(
    file: &str,
    columns: &Columns,
    (w, first, second): (&[f64], &[f64], &[f64]),
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<PhaseReading, FrfError> {
    let decider = Decider { file, settings };
    if columns.pair == Pair::Cartesian {
        let magnitude: Vec<f64> = first.iter().zip(second).map(|(re, im)| re.hypot(*im)).collect();
        let phase: Vec<f64> = first.iter().zip(second).map(|(re, im)| im.atan2(*re)).collect();
        let polar = PhaseReading { decibels: false, degrees: false, margin: false, conjugated: false };
        let conjugated = decider.conjugate((w, &magnitude, &phase), polar, notes)?;
        return Ok(PhaseReading { conjugated, ..polar });
    }
    let said = Said {
        decibels: columns.unit(1).map(|(u, _)| u == Unit::Decibels),
        degrees: columns.unit(2).map(|(u, _)| u == Unit::Degrees),
        margin: columns.said[2].as_ref().and_then(|m| m.margin.then_some(true)),
    };
    let all = decider.candidates((w, first, second));
    let decibels = decider.magnitude(&all, said.decibels, columns, first, notes)?;
    let all: Vec<Misfit> = all.into_iter().filter(|m| m.reading.decibels == decibels).collect();
    let degrees = decider.angle(&all, said.degrees, columns, (first, second, decibels), notes)?;
    let all: Vec<Misfit> = all.into_iter().filter(|m| m.reading.degrees == degrees).collect();
    let polar = PhaseReading { decibels, degrees, margin: false, conjugated: false };
    let conjugated = decider.conjugate((w, first, second), polar, notes).map_err(|error| {
        // Radians under a header of degrees hardly turn at all, and what little they do looks conjugated.
        match (degrees, narrow_phase(first, second, decibels), columns.unit(2)) {
            (true, Some((low, high)), Some((_, words))) => FrfError::Contradiction {
                file: file.to_owned(),
                question: Question::Angle,
                says: words.to_owned(),
                doubt: SweepDoubt::PhaseRange { low, high },
            },
            _ => error,
        }
    })?;
    let all: Vec<Misfit> = all.into_iter().filter(|m| m.reading.conjugated == conjugated).collect();
    let margin = decider.margin(&all, said.margin, columns, notes)?;
    Ok(PhaseReading { decibels, degrees, margin, conjugated })
}

struct Decider<'a> {
    file: &'a str,
    settings: &'a ReadSettings,
}

impl Decider<'_> {
    /// The misfit of every reading that the caller's words allow.
    fn candidates(&self, (w, first, second): (&[f64], &[f64], &[f64])) -> Vec<Misfit> {
        let s = self.settings;
        let mut readings = Vec::with_capacity(16);
        for decibels in both(s.magnitude == MagnitudeScale::Linear, s.magnitude == MagnitudeScale::Decibels) {
            for degrees in both(s.angle == AngleUnit::Radians, s.angle == AngleUnit::Degrees) {
                for margin in both(s.phase == PhaseConvention::Response, s.phase == PhaseConvention::Margin) {
                    for conjugated in both(s.conjugate == Conjugate::No, s.conjugate == Conjugate::Yes) {
                        readings.push(PhaseReading { decibels, degrees, margin, conjugated });
                    }
                }
            }
        }
        misfits(w, first, second, &readings)
    }

    fn magnitude(
        &self,
        all: &[Misfit],
        said: Option<bool>,
        columns: &Columns,
        first: &[f64],
        notes: &mut Vec<Note>,
    ) -> Result<bool, FrfError> {
        match self.settings.magnitude {
            MagnitudeScale::Decibels => return Ok(true),
            MagnitudeScale::Linear => return Ok(false),
            MagnitudeScale::Auto => {}
        }
        let words = columns.unit(1).map_or("", |(_, words)| words);
        let sure = if said == Some(false) {
            None
        } else {
            first.iter().copied().find(|m| *m <= 0.0).map(|m| (true, Basis::Value(m)))
        };
        let (decibels, ground) = self.settle(all, (said, words), sure, Question::Magnitude, |r| r.decibels)?;
        let scale = if decibels { MagnitudeScale::Decibels } else { MagnitudeScale::Linear };
        notes.push(Note::Magnitude { scale, ground });
        Ok(decibels)
    }

    fn angle(
        &self,
        all: &[Misfit],
        said: Option<bool>,
        columns: &Columns,
        (first, second, decibels): (&[f64], &[f64], bool),
        notes: &mut Vec<Note>,
    ) -> Result<bool, FrfError> {
        match self.settings.angle {
            AngleUnit::Degrees => return Ok(true),
            AngleUnit::Radians => return Ok(false),
            AngleUnit::Auto => {}
        }
        let words = columns.unit(2).map_or("", |(_, words)| words);
        // Nobody unwraps beyond 16 turns; 100 rad is more than that.
        let large = second.iter().copied().find(|p| p.abs() > 32.0 * PI).map(|p| (true, Basis::Value(p)));
        let narrow = narrow_phase(first, second, decibels);
        // A free inertia in the margin display stays near 0 deg; its noise does not fill two thirds of a circle's 6.28.
        let fills = |(low, high): &(f64, f64)| high - low > 4.2;
        let sure = large.or_else(|| narrow.filter(fills).map(|(low, high)| (false, Basis::PhaseRange(low, high))));
        let (degrees, ground) = self.settle(all, (said, words), sure, Question::Angle, |r| r.degrees)?;
        // Less than that may be either: degrees would have to be said.
        if let (true, None, Some((low, high))) = (degrees, said, narrow) {
            let doubt = SweepDoubt::PhaseRange { low, high };
            return Err(FrfError::Ambiguous { file: self.file.to_owned(), question: Question::Angle, doubt });
        }
        let unit = if degrees { AngleUnit::Degrees } else { AngleUnit::Radians };
        notes.push(Note::Angle { unit, ground });
        Ok(degrees)
    }

    /// A question that the contract answers with yes where neither header nor data do.
    fn settle(
        &self,
        all: &[Misfit],
        (said, words): (Option<bool>, &str),
        sure: Option<(bool, Basis)>,
        question: Question,
        answer: impl Fn(&PhaseReading) -> bool,
    ) -> Result<(bool, Basis), FrfError> {
        let evidence = evidence(all, &answer);
        let clear = evidence.filter(PhaseEvidence::is_clear);
        if let Some(said) = said {
            let contradicts = clear.filter(|e| answer(&e.best.reading) != said && !e.rival.is_plausible());
            let impossible = sure.filter(|(is, _)| *is != said).map(|(_, ground)| ground);
            if contradicts.is_some() || impossible.is_some() {
                return Err(FrfError::Contradiction {
                    file: self.file.to_owned(),
                    question,
                    says: words.to_owned(),
                    doubt: match impossible {
                        Some(Basis::Value(value)) => SweepDoubt::Value { value },
                        Some(Basis::PhaseRange(low, high)) => SweepDoubt::PhaseRange { low, high },
                        _ => SweepDoubt::of(evidence),
                    },
                });
            }
            return Ok((said, Basis::Header(words.to_owned())));
        }
        if let Some((is, ground)) = sure {
            return Ok((is, ground));
        }
        match (clear, evidence) {
            (Some(e), _) => Ok((answer(&e.best.reading), Basis::GainPhase(e))),
            // The data lean against the contract, but not clearly.
            (None, Some(e)) if !answer(&e.best.reading) => {
                Err(FrfError::Ambiguous { file: self.file.to_owned(), question, doubt: SweepDoubt::of(Some(e)) })
            }
            _ => Ok((true, Basis::Contract)),
        }
    }

    /// Whether to turn the sign of the phase. The offset of half a turn stays free, so that an inverted sensor does not
    /// pass for a conjugate.
    fn conjugate(
        &self,
        (w, first, second): (&[f64], &[f64], &[f64]),
        polar: PhaseReading,
        notes: &mut Vec<Note>,
    ) -> Result<bool, FrfError> {
        match self.settings.conjugate {
            Conjugate::No => return Ok(false),
            Conjugate::Yes => {
                notes.push(Note::ConjugateUndone);
                return Ok(true);
            }
            Conjugate::Auto => {}
        }
        let mut readings = Vec::with_capacity(4);
        for margin in [false, true] {
            for conjugated in [false, true] {
                readings.push(PhaseReading { margin, conjugated, ..polar });
            }
        }
        let all = misfits(w, first, second, &readings);
        match evidence(&all, |r| r.conjugated) {
            None => notes.push(Note::ConjugateUntested),
            // Leaning is enough to refuse: a causal file leans the other way. No reading explained is no evidence.
            Some(e) if e.best.reading.conjugated && e.best.is_plausible() => {
                return Err(FrfError::Conjugated { file: self.file.to_owned(), evidence: e });
            }
            Some(e) if !e.is_clear() => notes.push(Note::ConjugateUnclear { evidence: e }),
            Some(_) => {}
        }
        Ok(false)
    }

    fn margin(
        &self,
        all: &[Misfit],
        said: Option<bool>,
        columns: &Columns,
        notes: &mut Vec<Note>,
    ) -> Result<bool, FrfError> {
        match self.settings.phase {
            PhaseConvention::Margin => return Ok(true),
            PhaseConvention::Response => return Ok(false),
            PhaseConvention::Auto => {}
        }
        let evidence = evidence(all, |r| r.margin);
        let clear = evidence.filter(PhaseEvidence::is_clear);
        let words = columns.said[2].as_ref().map_or("", |m| m.name.as_str());
        let note = |margin, ground| if margin { Note::PhaseMargin { ground } } else { Note::PhaseResponse { ground } };
        let (margin, ground) = match (said, clear) {
            (Some(said), Some(e)) if e.best.reading.margin != said && !e.rival.is_plausible() => {
                return Err(FrfError::Contradiction {
                    file: self.file.to_owned(),
                    question: Question::Phase,
                    says: words.to_owned(),
                    doubt: SweepDoubt::of(evidence),
                });
            }
            (Some(said), _) => (said, Basis::Header(words.to_owned())),
            (None, Some(e)) => (e.best.reading.margin, Basis::GainPhase(e)),
            (None, None) => {
                let doubt = SweepDoubt::of(evidence);
                return Err(FrfError::Ambiguous { file: self.file.to_owned(), question: Question::Phase, doubt });
            }
        };
        notes.push(note(margin, ground));
        Ok(margin)
    }
}

/// Least and largest phase where they would suit radians, within half a turn either way and spread over more than 1.5, while the gain changes
/// tenfold: in degrees such a gain comes with far more.
fn narrow_phase(first: &[f64], second: &[f64], decibels: bool) -> Option<(f64, f64)> {
    let range = |c: &[f64]| c.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let (low, high) = range(second);
    let (least, most) = range(first);
    let tenfold = if decibels { most - least > 20.0 } else { most > 10.0 * least };
    (tenfold && low >= -PI - 1e-3 && high <= PI + 1e-3 && high - low > 1.5).then_some((low, high))
}

/// The answers left once `never` and `always` are taken into account, yes first.
fn both(never: bool, always: bool) -> Vec<bool> {
    match (never, always) {
        (true, _) => vec![false],
        (_, true) => vec![true],
        _ => vec![true, false],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_are_recognised() {
        for value in [40.0, 5000.0, 0.12, 10.0 * (1.0 + 1e-6)] {
            assert!(round(value), "{value}");
        }
        for value in [251.327, 31415.9, 40.651, 62.8319] {
            assert!(!round(value), "{value}");
        }
        assert_eq!(tidy(5000.01), 5000.0);
    }
}
