//! Every key of every file, one by one, held against its reader: left out, at each end of its range and beyond, not finite, of a wrong type, beside
//! a key that is none.
#![allow(clippy::unwrap_used)]

use crate::key_samples::{FILES, judge, samples};
use servotune::document::{End, FileKey, KeyKind, Need, Range};
use toml::{Table, Value};

/// Keys whose range depends on other keys, so that a value within their own may be refused. What lies beyond is refused all the same.
const DEPENDS: [(&str, &str); 14] = [
    ("plant.toml [plant] natural_frequency_rad_s", "0 is another form"),
    ("plant.toml [[plant.residue]] frequency_rad_s", "0 is the rigid body, which has no damping"),
    ("plant.toml [[plant.residue]] frequency_hz", "0 is the rigid body, which has no damping"),
    ("plant.toml [[plant.residue]] damping_ratio", "without damping the sum has no zeros that f64 can tell"),
    ("controller.toml sample_time_s", "filters lie below half the sample rate"),
    ("controller.toml [[lowpass]] frequency_hz", "next to 0 Hz the filter does not decay"),
    ("controller.toml [[notch]] frequency_hz", "next to 0 Hz the filter does not decay"),
    ("controller.toml [[biquad]] a1", "the poles depend on a2 too"),
    ("spec.toml [objective] bands_hz", "a limited band holds a bin of the window"),
    ("spec.toml [limits.move] settling_s", "the record ends"),
    ("profile.toml [spiral] duration_s", "the window lies within the record"),
    ("profile.toml [pes] sample_rate_hz", "the window lies within the record"),
    ("profile.toml [pes] window", "it holds a sample at least"),
    ("FLEET.toml [tables] candidates", "at least `most`"),
];

/// What readers call a key, or its table, in their refusals.
fn names(key: &FileKey, heading: &str) -> Vec<String> {
    let bare = key.name.trim_end_matches("_rad_s").trim_end_matches("_hz").to_owned();
    let table = heading.trim_matches(['[', ']']).replace("lowpass", "low-pass");
    let mut all = vec![key.name.to_owned(), bare];
    // A filter is named by its own frequency.
    if ["frequency_hz", "a1", "a2", "hz", "db"].contains(&key.name) {
        all.push(table);
    }
    if let Need::Unless(others) = key.need {
        all.extend(others.iter().map(|o| (*o).to_owned()));
    }
    all
}

/// One key at its place in a sample.
struct Place {
    file: &'static str,
    heading: &'static str,
    key: &'static FileKey,
    sample: Table,
}

impl Place {
    /// The table that holds the key; of a list of tables the first.
    fn table<'a>(heading: &str, root: &'a mut Table) -> Option<&'a mut Table> {
        let mut at = root;
        for part in heading.trim_matches(['[', ']']).split('.').filter(|p| !p.is_empty()) {
            at = match at.get_mut(part)? {
                Value::Table(t) => t,
                Value::Array(all) => all.first_mut()?.as_table_mut()?,
                _ => return None,
            };
        }
        Some(at)
    }

    fn value(&self) -> Value {
        Place::table(self.heading, &mut self.sample.clone()).unwrap()[self.key.name].clone()
    }

    /// What the reader says with another value in the key's place, or without the key.
    fn with(&self, value: Option<Value>) -> Result<String, String> {
        let mut changed = self.sample.clone();
        let table = Place::table(self.heading, &mut changed).unwrap();
        match value {
            Some(v) => table.insert(self.key.name.into(), v),
            None => table.remove(self.key.name),
        };
        judge(self.file, &changed)
    }

    fn shown(&self) -> String {
        let parts = [self.file, self.heading, self.key.name];
        parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
    }

    /// Nothing where a value is refused by the key's name, else what is wrong.
    fn refused(&self, value: Value) -> Option<String> {
        let text = shortly(&value);
        match self.with(Some(value)) {
            Ok(_) => Some(format!("{} takes {text}", self.shown())),
            Err(said) => self.unnamed(&said).map(|said| format!("{said} ({text})")),
        }
    }

    /// A refusal that does not say which key is meant.
    fn unnamed(&self, said: &str) -> Option<String> {
        let named = names(self.key, self.heading).iter().any(|n| said.contains(n.as_str()));
        // The parser's own refusal has line and column.
        let placed = said.contains("invalid value: integer");
        (!named && !placed).then(|| format!("{} is not named: {said}", self.shown()))
    }

    fn taken(&self, value: Value) -> Option<String> {
        let text = shortly(&value);
        self.with(Some(value)).err().map(|said| format!("{} = {text}: {said}", self.shown()))
    }

    fn depends(&self) -> bool {
        DEPENDS.iter().any(|(place, _)| *place == self.shown())
    }

    /// Numbers of gains.toml are the program's own: the reader makes `section` from the gains once more and asks for the type of the rest, which
    /// is infinite where a loop passes through -1.
    fn made_by_the_program(&self) -> bool {
        self.file == "gains.toml"
    }
}

/// Every key in the first sample of its file that holds it.
fn every() -> Vec<Place> {
    let mut all = Vec::new();
    for file in FILES {
        let samples = samples(file.name);
        for sample in &samples {
            judge(file.name, sample).unwrap_or_else(|e| panic!("{}: {e}", file.name));
        }
        // The keys of a base are walked in their own file.
        for table in file.tables {
            for key in table.keys {
                let holds = |s: &&Table| {
                    Place::table(table.heading, &mut (*s).clone()).is_some_and(|t| t.contains_key(key.name))
                };
                let sample = samples.iter().find(holds);
                let sample =
                    sample.unwrap_or_else(|| panic!("no sample of {} has {} {}", file.name, table.heading, key.name));
                all.push(Place { file: file.name, heading: table.heading, key, sample: sample.clone() });
            }
        }
    }
    assert!(all.len() > 200, "{} keys", all.len());
    all
}

fn number(kind: KeyKind, x: f64) -> Value {
    if matches!(kind, KeyKind::Integer | KeyKind::Integers) { Value::Integer(x as i64) } else { Value::Float(x) }
}

/// Values of the key's type with `x` as one of their numbers.
fn holding(place: &Place, x: f64) -> Vec<Value> {
    let n = number(place.key.kind, x);
    let own = place.value();
    let pair = |low: &Value, high: &Value| Value::Array(vec![low.clone(), high.clone()]);
    let first = |own: &Value| {
        let mut all = own.as_array().unwrap().clone();
        all[0] = n.clone();
        Value::Array(all)
    };
    match place.key.kind {
        KeyKind::Number | KeyKind::Integer | KeyKind::NumberOrMatrix | KeyKind::NumberOrPair => vec![n],
        KeyKind::Numbers | KeyKind::Vector => vec![first(&own)],
        KeyKind::Pair | KeyKind::Integers => vec![pair(&n, &n)],
        KeyKind::Pairs => vec![Value::Array(vec![pair(&n, &n)])],
        KeyKind::Roots => vec![first(&own), Value::Array(vec![pair(&n, &Value::Float(1.0))])],
        KeyKind::Matrix => {
            let mut rows = own.as_array().unwrap().clone();
            rows[0] = first(&rows[0]);
            vec![Value::Array(rows)]
        }
        _ => vec![],
    }
}

/// Walks through every key; what is wrong anywhere is told at once.
fn walk(look: impl Fn(&Place) -> Vec<String>) {
    let wrong: Vec<String> = every().iter().flat_map(look).collect();
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

fn shortly(value: &Value) -> String {
    value.to_string().chars().take(80).collect()
}

#[test]
fn a_key_left_out_is_asked_for_by_name_or_is_its_default() {
    walk(|place| {
        let without = place.with(None);
        let same = |default: Value| {
            let set = place.with(Some(default));
            let same = without.is_ok() && without == set;
            (!same).then(|| format!("{}: left out {without:?}, set {set:?}", place.shown())).into_iter().collect()
        };
        match place.key.need {
            Need::Always | Need::Unless(_) | Need::Where(_) => match &without {
                Ok(_) => vec![format!("{} is not asked for", place.shown())],
                Err(said) => place.unnamed(said).into_iter().collect(),
            },
            Need::Or(x) => same(number(place.key.kind, x)),
            Need::OrToml(text) => same(format!("x = {text}").parse::<Table>().unwrap()["x"].clone()),
            Need::OrElse(_) => without.err().into_iter().collect(),
            Need::Reported => vec![format!("{}: no file has such a key", place.shown())],
        }
    });
}

/// The nearest numbers on this side of an end and beyond it.
fn beside(kind: KeyKind, x: f64, up: bool) -> f64 {
    let step = if kind == KeyKind::Integer { 1.0 } else { (1e-6 * x.abs()).max(1e-300) };
    if up { x + step } else { x - step }
}

/// Numbers that a range takes and numbers that it does not, next to its ends.
fn ends(key: &FileKey) -> [Vec<f64>; 2] {
    let (mut good, mut bad, kind) = (Vec::new(), Vec::new(), key.kind);
    match key.range {
        Range::Any => {}
        Range::NotZero => bad.push(0.0),
        Range::Size(least, most) => {
            good.extend([most, -most, least, -least]);
            bad.extend([beside(kind, most, true), beside(kind, -most, false)]);
            if least > 0.0 {
                bad.extend([0.0, beside(kind, least, false), beside(kind, -least, true)]);
            }
        }
        Range::Between(low, high) => {
            for (end, up) in [(low, false), (high, true)] {
                match end {
                    End::Open => {}
                    End::With(x) => {
                        good.push(x);
                        bad.push(beside(kind, x, up));
                    }
                    End::Without(x) => {
                        good.push(beside(kind, x, !up));
                        bad.push(x);
                    }
                }
            }
        }
    }
    [good, bad]
}

#[test]
fn the_ends_of_a_range_are_those_of_the_reader() {
    walk(|place| {
        if !place.key.kind.of_numbers() || place.made_by_the_program() {
            return vec![];
        }
        let [good, bad] = ends(place.key);
        let refused = bad.into_iter().flat_map(|x| holding(place, x)).filter_map(|v| place.refused(v));
        let good = good.into_iter().filter(|_| !place.depends());
        refused.chain(good.flat_map(|x| holding(place, x)).filter_map(|v| place.taken(v))).collect()
    });
}

/// Numbers far beyond, where the list names no end.
fn far(key: &FileKey) -> &'static [f64] {
    match key.range {
        _ if key.kind != KeyKind::Number => &[],
        Range::Any | Range::NotZero => &[1e200, -1e200],
        Range::Between(_, End::Open) => &[1e200],
        _ => &[],
    }
}

#[test]
fn a_range_without_an_end_has_none() {
    walk(|place| {
        if place.depends() || place.made_by_the_program() {
            return vec![];
        }
        let said = far(place.key).iter().filter_map(|x| place.with(Some(Value::Float(*x))).err());
        // What else is asked may refuse it, in other words than those of a range.
        let of_others = |said: &String| !place.key.also.is_empty() && !said.contains(&format!("{} = ", place.key.name));
        said.filter(|s| !of_others(s)).map(|s| format!("{}: {s}", place.shown())).collect()
    });
}

#[test]
fn every_exception_is_a_key_and_is_needed() {
    let all = every();
    for (name, _) in DEPENDS {
        let place = all.iter().find(|p| p.shown() == name).unwrap_or_else(|| panic!("{name} is no key"));
        let [good, _] = ends(place.key);
        let mut tried = good.iter().chain(far(place.key)).flat_map(|x| holding(place, *x));
        assert!(tried.any(|v| place.taken(v).is_some()), "{name} takes its whole range");
    }
}

#[test]
fn what_is_no_finite_number_is_refused_by_name() {
    walk(|place| {
        let whole = matches!(place.key.kind, KeyKind::Integer | KeyKind::Integers);
        if !place.key.kind.of_numbers() || whole || place.made_by_the_program() {
            return vec![];
        }
        let wrong = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].into_iter().flat_map(|x| holding(place, x));
        wrong.filter_map(|v| place.refused(v)).collect()
    });
}

#[test]
fn a_value_of_another_type_is_refused() {
    walk(|place| {
        let text = |t: &str| Value::String(t.into());
        let other = match place.key.kind {
            kind if kind.of_text() || matches!(kind, KeyKind::Table | KeyKind::Texts | KeyKind::Bool) => {
                Value::Integer(1)
            }
            _ => text("text"),
        };
        let mut wrong = vec![other];
        if matches!(place.key.kind, KeyKind::Integer | KeyKind::Integers) {
            wrong.extend(holding(place, 0.0).into_iter().map(|_| Value::Float(1.5)));
        }
        let mut found = Vec::new();
        if let KeyKind::Choice(words) = place.key.kind {
            wrong.push(text("no_such_word"));
            found.extend(words.iter().filter_map(|w| place.taken(text(w))));
        }
        let taken = wrong.into_iter().filter(|v| place.with(Some(v.clone())).is_ok());
        found.extend(taken.map(|v| format!("{} takes {}", place.shown(), shortly(&v))));
        found
    });
}

#[test]
fn a_list_has_as_many_as_it_may() {
    walk(|place| {
        let many = |n: usize| {
            Value::Array(match place.key.kind {
                // Names and points differ; all else may repeat.
                KeyKind::Texts => (1..=n).map(|i| Value::String(format!("x{i}"))).collect(),
                KeyKind::Roots => (1..=n).map(|i| Value::Float(-(i as f64))).collect(),
                KeyKind::Numbers => (1..=n).map(|i| Value::Float(i as f64)).collect(),
                _ => vec![place.value().as_array().unwrap()[0].clone(); n],
            })
        };
        let [least, most] = place.key.items;
        let mut found = Vec::new();
        if least > 0 {
            found.extend(place.refused(many(least - 1)));
        }
        if most < usize::MAX {
            found.extend(place.taken(many(most)));
            found.extend(place.refused(many(most + 1)));
        }
        found
    });
}

#[test]
fn a_range_that_falls_is_refused() {
    walk(|place| {
        let falling = Value::Array(vec![number(place.key.kind, 20.0), number(place.key.kind, 10.0)]);
        let refused = match place.key.kind {
            KeyKind::Pair | KeyKind::Integers | KeyKind::NumberOrPair => place.refused(falling),
            KeyKind::Pairs => place.refused(Value::Array(vec![falling])),
            _ => None,
        };
        refused.into_iter().collect()
    });
}

#[test]
fn an_unknown_key_is_refused_by_its_name() {
    walk(|place| {
        let mut changed = place.sample.clone();
        Place::table(place.heading, &mut changed).unwrap().insert("no_such_key".into(), Value::Integer(1));
        let named = judge(place.file, &changed).is_err_and(|said| said.contains("no_such_key"));
        (!named).then(|| format!("{} takes any key", place.shown())).into_iter().collect()
    });
}
