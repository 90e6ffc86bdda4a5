//! The frequency response among the variables of a MATLAB file: frd and idfrd fields, or vectors of the workspace.
//!
//! In: [`Variable`](super::mat::Variable)s. Out: [`Columns`]; the line of a point is its number in the vectors. Spec: `specs/frf.md`, "MATLAB files".

use super::columns::{Columns, Pair};
use super::error::{FrfError, Question, SweepDoubt};
use super::header::{Meaning, Role, Unit, meaning};
use super::mat::{Numbers, Raw, Value, elements, variables};
use super::note::Note;
use super::settings::{BadPoints, ColumnChoice, FrequencyUnit, ReadSettings};

/// An array of numbers with its place in the file.
struct Array<'a> {
    /// `G.ResponseData`, as MATLAB writes it.
    path: String,
    /// All before the last full stop.
    scope: String,
    meaning: Meaning,
    numbers: Numbers<'a>,
}

/// One column: every so manyth number of an array.
#[derive(Clone, Copy)]
struct Strided<'a> {
    raw: Raw<'a>,
    start: usize,
    step: usize,
}

impl Strided<'_> {
    fn at(&self, i: usize) -> f64 {
        self.raw.at(self.start + self.step * i)
    }
}

/// A response that the file may mean.
struct Candidate<'a> {
    title: String,
    scope: String,
    pair: Pair,
    points: usize,
    frequency: (Strided<'a>, Option<Meaning>, f64),
    first: (Strided<'a>, Option<Meaning>),
    /// None where the response is real.
    second: (Option<Strided<'a>>, Option<Meaning>),
    used: Vec<String>,
}

/// The chosen response of the file.
pub(super) fn columns(
    file: &str,
    bytes: &[u8],
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Columns, FrfError> {
    let elements = elements(file, bytes, settings)?;
    let variables = variables(file, &elements)?;
    let mut found = Found::default();
    for (name, value) in variables {
        found.sort_in("", name, value);
    }
    let candidates = match &settings.columns {
        Some(choice) => vec![found.chosen(file, choice, settings)?],
        None => found.candidates(file, settings)?,
    };
    let titles = || candidates.iter().enumerate().map(|(i, c)| format!("{}: {}", i + 1, c.title)).collect::<Vec<_>>();
    let at = match (settings.dataset, candidates.len()) {
        (_, 0) => return Err(FrfError::MatNoResponse { file: file.to_owned(), found: found.listed() }),
        (Some(wanted), of) => wanted.checked_sub(1).filter(|i| *i < of).ok_or_else(|| FrfError::ResponseChoice {
            file: file.to_owned(),
            wanted: Some(wanted),
            responses: titles(),
        })?,
        (None, 1) => 0,
        (None, _) => return Err(FrfError::ResponseChoice { file: file.to_owned(), wanted: None, responses: titles() }),
    };
    let chosen = &candidates[at];
    notes.push(Note::Dataset { number: at + 1, of: candidates.len(), title: chosen.title.clone() });
    found.read(file, chosen, candidates.len() == 1, settings, notes)
}

/// What the file holds, sorted.
#[derive(Default)]
struct Found<'a> {
    arrays: Vec<Array<'a>>,
    texts: Vec<(String, String)>,
    other: Vec<String>,
}

impl<'a> Found<'a> {
    fn sort_in(&mut self, scope: &str, name: String, value: Value<'a>) {
        let path = if scope.is_empty() { name.clone() } else { format!("{scope}.{name}") };
        match value {
            Value::Numbers(numbers) => {
                let meaning = meaning(&name);
                self.arrays.push(Array { path, scope: scope.to_owned(), meaning, numbers });
            }
            Value::Text(text) => self.texts.push((path, text)),
            Value::Fields(fields) => fields.into_iter().for_each(|(name, value)| self.sort_in(&path, name, value)),
            Value::Other(what) => self.other.push(format!("{path} ({what})")),
        }
    }

    /// Every name with its sizes, for a message.
    fn listed(&self) -> Vec<String> {
        let arrays = self.arrays.iter().map(|a| format!("{} ({})", a.path, a.numbers.shape()));
        self.other.iter().cloned().chain(arrays).collect()
    }

    fn candidates(&self, file: &str, settings: &ReadSettings) -> Result<Vec<Candidate<'a>>, FrfError> {
        let mut out = Vec::new();
        for grid in self.arrays.iter().filter(|a| a.meaning.role == Role::Frequency && a.numbers.im.is_none()) {
            let n = grid.numbers.len();
            if !grid.numbers.is_vector() || n < 2 {
                continue;
            }
            let beside = || self.arrays.iter().filter(|a| a.scope == grid.scope && a.path != grid.path);
            let before = out.len();
            let frequency = |settings| self.frequency(file, grid, settings);
            for array in beside().filter(|a| a.numbers.im.is_some() || a.meaning.name == "ResponseData") {
                let Some(channels) = channels(&array.numbers, n) else { continue };
                for (title, start, step) in channels {
                    out.push(Candidate {
                        title: format!("{}{title} over {}", array.path, grid.path),
                        scope: grid.scope.clone(),
                        pair: Pair::Cartesian,
                        points: n,
                        frequency: frequency(settings)?,
                        first: (Strided { raw: array.numbers.re, start, step }, None),
                        second: (array.numbers.im.map(|raw| Strided { raw, start, step }), None),
                        used: vec![grid.path.clone(), array.path.clone()],
                    });
                }
            }
            if out.len() > before {
                continue;
            }
            let one = |role: Role| {
                let mut all = beside().filter(|a| {
                    a.meaning.role == role && a.numbers.im.is_none() && a.numbers.is_vector() && a.numbers.len() == n
                });
                all.next().filter(|_| all.next().is_none())
            };
            for (pair, a, b) in
                [(Pair::Polar, Role::Magnitude, Role::Phase), (Pair::Cartesian, Role::Real, Role::Imaginary)]
            {
                let (Some(a), Some(b)) = (one(a), one(b)) else { continue };
                out.push(Candidate {
                    title: format!("{} and {} over {}", a.path, b.path, grid.path),
                    scope: grid.scope.clone(),
                    pair,
                    points: n,
                    frequency: frequency(settings)?,
                    first: (whole(a), Some(a.meaning.clone())),
                    second: (Some(whole(b)), Some(b.meaning.clone())),
                    used: vec![grid.path.clone(), a.path.clone(), b.path.clone()],
                });
            }
        }
        if out.is_empty() {
            out.extend(self.arrays.iter().filter_map(three_columns));
        }
        Ok(out)
    }

    /// The frequency column, what is said of its unit, and the factor to that unit.
    fn frequency(
        &self,
        file: &str,
        grid: &Array<'a>,
        settings: &ReadSettings,
    ) -> Result<(Strided<'a>, Option<Meaning>, f64), FrfError> {
        let column = whole(grid);
        let text = |names: &[&str]| {
            let mut all = self.texts.iter().filter(|(path, _)| path.rsplit_once('.').map_or("", |p| p.0) == grid.scope);
            all.find(|(path, _)| names.contains(&path.rsplit('.').next().unwrap_or_default()))
        };
        // The caller's word stands for the numbers as they are.
        if settings.frequency != FrequencyUnit::Auto {
            return Ok((column, Some(grid.meaning.clone()), 1.0));
        }
        let said = |unit: Unit, name: String| Meaning { name, role: Role::Frequency, unit: Some(unit), margin: false };
        if let Some((path, unit)) = text(&["FrequencyUnit", "FrequencyUnits", "Units", "frequency_unit", "FreqUnit"]) {
            let time = text(&["TimeUnit"]).map_or("seconds", |(_, unit)| unit.as_str());
            let (kind, factor) = frequency_unit(unit, time).ok_or_else(|| FrfError::MatUnit {
                file: file.to_owned(),
                name: path.clone(),
                found: unit.clone(),
            })?;
            return Ok((column, Some(said(kind, format!("{path} = {unit}"))), factor));
        }
        // A bare `w`, and frd's own field without the unit beside it, stand for either unit.
        let either = grid.meaning.name == "w"
            || self.arrays.iter().any(|a| a.scope == grid.scope && a.meaning.name == "ResponseData");
        if grid.meaning.unit.is_none() && either {
            let (question, doubt) = (Question::Frequency, SweepDoubt::NoUnit);
            return Err(FrfError::Ambiguous { file: file.to_owned(), question, doubt });
        }
        Ok((column, Some(grid.meaning.clone()), 1.0))
    }

    /// The arrays that the caller names, by path or by a last name that only one has; a complex one gives its parts to `real` and `imaginary`.
    fn chosen(&self, file: &str, choice: &ColumnChoice, settings: &ReadSettings) -> Result<Candidate<'a>, FrfError> {
        let find = |wanted: &String| -> Result<&Array<'a>, FrfError> {
            let by = |last: bool| {
                let name = |a: &&Array<'a>| if last { a.meaning.name == *wanted } else { a.path == *wanted };
                self.arrays.iter().filter(name).collect::<Vec<_>>()
            };
            match (by(false)[..].first(), by(true)[..].len()) {
                (Some(one), _) => Ok(one),
                (None, 1) => Ok(by(true)[0]),
                _ => Err(FrfError::ColumnName { file: file.to_owned(), found: wanted.clone(), header: self.listed() }),
            }
        };
        let absent = |wanted| FrfError::ColumnAbsent { file: file.to_owned(), wanted, header: self.listed() };
        let (pair, a, b) = match (&choice.magnitude, &choice.phase, &choice.real, &choice.imaginary) {
            (Some(m), Some(p), None, None) => (Pair::Polar, find(m)?, find(p)?),
            (None, None, Some(r), Some(i)) => (Pair::Cartesian, find(r)?, find(i)?),
            _ => return Err(absent("either magnitude and phase or real and imaginary part, chosen together")),
        };
        let grid = find(&choice.frequency)?;
        let points = grid.numbers.len();
        for array in [grid, a, b] {
            if !array.numbers.is_vector() || array.numbers.len() != points {
                let (name, found) = (array.path.clone(), array.numbers.shape());
                return Err(FrfError::MatLength { file: file.to_owned(), name, found, expected: points });
            }
        }
        let second = b.numbers.im.filter(|_| pair == Pair::Cartesian).unwrap_or(b.numbers.re);
        Ok(Candidate {
            title: format!("{} and {} over {}", a.path, b.path, grid.path),
            scope: grid.scope.clone(),
            pair,
            points,
            frequency: self.frequency(file, grid, settings)?,
            first: (whole(a), Some(a.meaning.clone())),
            second: (Some(Strided { raw: second, start: 0, step: 1 }), Some(b.meaning.clone())),
            used: vec![grid.path.clone(), a.path.clone(), b.path.clone()],
        })
    }

    /// The numbers of a candidate; deviations and coherence beside it count where it is the only one.
    fn read(
        &self,
        file: &str,
        c: &Candidate<'a>,
        only: bool,
        settings: &ReadSettings,
        notes: &mut Vec<Note>,
    ) -> Result<Columns, FrfError> {
        let beside = |role: Role| {
            let fits = |a: &&Array<'a>| a.scope == c.scope && a.meaning.role == role && a.numbers.im.is_none();
            let mut all =
                self.arrays.iter().filter(fits).filter(|a| a.numbers.is_vector() && a.numbers.len() == c.points);
            all.next().filter(|_| only && all.next().is_none())
        };
        let (std, coherence) = (beside(Role::Std), beside(Role::Coherence));
        let used = |a: &&Array<'a>| {
            !c.used.contains(&a.path) && [std, coherence].iter().flatten().all(|other| other.path != a.path)
        };
        let names: Vec<String> = self.arrays.iter().filter(used).map(|a| a.path.clone()).collect();
        if !names.is_empty() {
            notes.push(Note::ColumnsIgnored { names });
        }
        let mut out = Columns {
            pair: c.pair,
            line: Vec::new(),
            frequency: Vec::new(),
            first: Vec::new(),
            second: Vec::new(),
            std: std.map(|_| Vec::new()),
            coherence: coherence.map(|_| Vec::new()),
            said: [c.frequency.1.clone(), c.first.1.clone(), c.second.1.clone(), std.map(|a| a.meaning.clone())],
        };
        let mut dropped: Option<(usize, u64)> = None;
        for i in 0..c.points {
            let line = i as u64 + 1;
            let row = [
                c.frequency.0.at(i) * c.frequency.2,
                c.first.0.at(i),
                c.second.0.map_or(0.0, |column| column.at(i)),
                std.map_or(0.0, |a| a.numbers.re.at(i)),
                coherence.map_or(0.0, |a| a.numbers.re.at(i)),
            ];
            if let Some(column) = row.iter().position(|x| !x.is_finite()) {
                if settings.bad_points == BadPoints::Drop {
                    dropped = Some(dropped.map_or((1, line), |(rows, first)| (rows + 1, first)));
                    continue;
                }
                let found = row[column].to_string();
                return Err(FrfError::NonFinite { file: file.to_owned(), line, column: column + 1, found });
            }
            if row[0] == 0.0 && i == 0 && c.points > 1 {
                notes.push(Note::ZeroHertz);
                continue;
            }
            out.line.push(line);
            out.frequency.push(row[0]);
            out.first.push(row[1]);
            out.second.push(row[2]);
            out.std.iter_mut().for_each(|all| all.push(row[3]));
            out.coherence.iter_mut().for_each(|all| all.push(row[4]));
        }
        if let Some((rows, first_line)) = dropped {
            notes.push(Note::Dropped { rows, first_line });
        }
        if out.line.is_empty() {
            return Err(FrfError::NoRows { file: file.to_owned(), lines: c.points as u64 });
        }
        Ok(out)
    }
}

fn whole<'a>(array: &Array<'a>) -> Strided<'a> {
    Strided { raw: array.numbers.re, start: 0, step: 1 }
}

/// Most responses that one array is cut into.
const CHANNELS: usize = 64;

/// The responses of `points` in an array: a vector, columns or rows of a matrix, or frd's outputs by inputs by points; with title, start and step.
fn channels(numbers: &Numbers<'_>, points: usize) -> Option<Vec<(String, usize, usize)>> {
    if numbers.is_vector() {
        return (numbers.len() == points).then(|| vec![(String::new(), 0, 1)]);
    }
    let found: Vec<(String, usize, usize)> = match numbers.sizes[..] {
        [rows, columns] if rows == points && columns <= CHANNELS => {
            (0..columns).map(|k| (format!("(:,{})", k + 1), k * rows, 1)).collect()
        }
        [rows, columns] if columns == points && rows <= CHANNELS => {
            (0..rows).map(|k| (format!("({},:)", k + 1), k, rows)).collect()
        }
        [outputs, inputs, n] if n == points && outputs.checked_mul(inputs).is_some_and(|k| k <= CHANNELS) => (0
            ..inputs)
            .flat_map(|j| (0..outputs).map(move |i| (i, j)))
            .map(|(i, j)| (format!("({},{},:)", i + 1, j + 1), i + outputs * j, outputs * inputs))
            .collect(),
        _ => return None,
    };
    Some(found)
}

/// A matrix of three columns is read as a table without a header: frequency, magnitude, phase.
fn three_columns<'a>(array: &Array<'a>) -> Option<Candidate<'a>> {
    let [points, 3] = array.numbers.sizes[..] else { return None };
    let column = |k: usize| Strided { raw: array.numbers.re, start: k * points, step: 1 };
    // Any matrix may have three columns: the first must rise all the way to be a frequency.
    let rises = (1..points).all(|i| column(0).at(i) > column(0).at(i - 1));
    if points < 4 || array.numbers.im.is_some() || !rises {
        return None;
    }
    Some(Candidate {
        title: format!("{} as frequency, magnitude, phase", array.path),
        scope: array.scope.clone(),
        pair: Pair::Polar,
        points,
        frequency: (column(0), None, 1.0),
        first: (column(1), None),
        second: (Some(column(2)), None),
        used: vec![array.path.clone()],
    })
}

/// The unit that MATLAB's word means, as hertz or rad/s, and the factor to it.
fn frequency_unit(word: &str, time: &str) -> Option<(Unit, f64)> {
    let seconds = match time.trim() {
        "seconds" | "second" | "s" => 1.0,
        "milliseconds" => 1e-3,
        "microseconds" => 1e-6,
        "nanoseconds" => 1e-9,
        "minutes" => 60.0,
        "hours" => 3600.0,
        _ => return None,
    };
    Some(match word.trim().to_lowercase().as_str() {
        "hz" | "hertz" | "cycles/s" | "cycles/second" => (Unit::Hertz, 1.0),
        "khz" => (Unit::Hertz, 1e3),
        "mhz" => (Unit::Hertz, 1e6),
        "ghz" => (Unit::Hertz, 1e9),
        "rpm" => (Unit::Hertz, 1.0 / 60.0),
        "rad/s" | "rad/sec" | "rad/second" | "radians/second" => (Unit::RadPerSec, 1.0),
        "rad/minute" => (Unit::RadPerSec, 1.0 / 60.0),
        "krad/s" => (Unit::RadPerSec, 1e3),
        "rad/timeunit" => (Unit::RadPerSec, 1.0 / seconds),
        "cycles/timeunit" => (Unit::Hertz, 1.0 / seconds),
        _ => return None,
    })
}
