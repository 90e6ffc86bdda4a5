//! Every key of every file, one by one, held against its reader: left out, at each end of its range and beyond, not finite, of a wrong type, beside
//! a key that is none.
#![allow(clippy::unwrap_used)]

use crate::key_samples::{FILES, judge, samples};
use servotune::document::{End, FileKey, Kind, Need, Range};
use toml::{Table, Value};

/// Keys whose range depends on other keys: a value at one of its own limits may be refused for that. What lies beyond is refused all the same.
const DEPENDS: [(&str, &str, &str); 7] = [
    ("plant.toml", "natural_frequency_rad_s", "0 is another form"),
    ("controller.toml", "frequency_hz", "no decay is left just above 0 Hz"),
    ("controller.toml", "a1", "the poles depend on a2 too"),
    ("spec.toml", "bands_hz", "a band must hold a bin of the window"),
    ("spec.toml", "hz", "the points rise"),
    ("profile.toml", "duration_s", "the window lies within the record"),
    ("profile.toml", "sample_rate_hz", "the window lies within the record"),
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
        format!("{} {} {}", self.file, self.heading, self.key.name)
    }

    fn refused(&self, value: Value) {
        let text = value.to_string();
        let text = text.chars().take(80).collect::<String>();
        let said = self.with(Some(value)).err().unwrap_or_else(|| panic!("{} takes {text}", self.shown()));
        let named = names(self.key, self.heading).iter().any(|n| said.contains(n.as_str()));
        assert!(named, "{} = {text}: not named: {said}", self.shown());
    }

    fn taken(&self, value: Value) {
        let text = value.to_string().chars().take(80).collect::<String>();
        let said = self.with(Some(value));
        assert!(said.is_ok(), "{} = {text}: {}", self.shown(), said.unwrap_err());
    }

    fn depends(&self) -> bool {
        DEPENDS.iter().any(|(file, key, _)| *file == self.file && *key == self.key.name)
    }

    /// Numbers of gains.toml are the program's own: the reader makes `section` from the gains once more and asks for the type of the rest, which
    /// may be infinite where a loop is unstable.
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

fn number(kind: Kind, x: f64) -> Value {
    if matches!(kind, Kind::Integer | Kind::Integers) { Value::Integer(x as i64) } else { Value::Float(x) }
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
        Kind::Number | Kind::Integer | Kind::NumberOrMatrix | Kind::NumberOrPair => vec![n],
        Kind::Numbers | Kind::Vector => vec![first(&own)],
        Kind::Pair | Kind::Integers => vec![pair(&n, &n)],
        Kind::Pairs => vec![Value::Array(vec![pair(&n, &n)])],
        Kind::Roots => vec![first(&own), Value::Array(vec![pair(&n, &Value::Float(1.0))])],
        Kind::Matrix => {
            let mut rows = own.as_array().unwrap().clone();
            rows[0] = first(&rows[0]);
            vec![Value::Array(rows)]
        }
        _ => vec![],
    }
}

#[test]
fn a_key_left_out_is_asked_for_by_name_or_is_its_default() {
    for place in every() {
        let without = place.with(None);
        match place.key.need {
            Need::Always | Need::Unless(_) | Need::Where(_) => {
                let said = without.err().unwrap_or_else(|| panic!("{} is not asked for", place.shown()));
                let named = names(place.key, place.heading).iter().any(|n| said.contains(n.as_str()));
                assert!(named, "{}: not named: {said}", place.shown());
            }
            Need::Or(x) => assert_eq!(without, place.with(Some(number(place.key.kind, x))), "{}", place.shown()),
            Need::OrToml(text) => {
                let default = format!("x = {text}").parse::<Table>().unwrap()["x"].clone();
                assert!(without.is_ok(), "{}: {without:?}", place.shown());
                assert_eq!(without, place.with(Some(default)), "{}", place.shown());
            }
            Need::OrElse(_) => assert!(without.is_ok(), "{}: {without:?}", place.shown()),
            Need::Reported => panic!("{}: no file has such a key", place.shown()),
        }
    }
}

/// The nearest numbers on this side of an end and beyond it.
fn beside(kind: Kind, x: f64, up: bool) -> f64 {
    let step = if kind == Kind::Integer { 1.0 } else { (1e-6 * x.abs()).max(1e-300) };
    if up { x + step } else { x - step }
}

#[test]
fn the_ends_of_a_range_are_those_of_the_reader() {
    for place in every() {
        if place.made_by_the_program() {
            continue;
        }
        let kind = place.key.kind;
        let (mut good, mut bad) = (Vec::new(), Vec::new());
        match place.key.range {
            _ if !kind.of_numbers() => {}
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
        for x in bad {
            holding(&place, x).into_iter().for_each(|v| place.refused(v));
        }
        for x in good.into_iter().filter(|_| !place.depends()) {
            holding(&place, x).into_iter().for_each(|v| place.taken(v));
        }
    }
}

/// Where the list names no end, a number of any size is not refused by the key's own name.
#[test]
fn a_range_without_an_end_has_none() {
    for place in every().iter().filter(|p| matches!(p.key.kind, Kind::Number) && !p.made_by_the_program()) {
        let far: &[f64] = match place.key.range {
            Range::Any | Range::NotZero => &[1e200, -1e200],
            Range::Between(_, End::Open) => &[1e200],
            _ => &[],
        };
        for x in far {
            if let Err(said) = place.with(Some(Value::Float(*x))) {
                let own = format!("{} = {x}", place.key.name);
                assert!(!said.contains(&own) && place.key.also != "", "{}: {said}", place.shown());
            }
        }
    }
}

#[test]
fn what_is_no_finite_number_is_refused_by_name() {
    for place in every().iter().filter(|p| p.key.kind.of_numbers() && !p.made_by_the_program()) {
        if matches!(place.key.kind, Kind::Integer | Kind::Integers) {
            continue;
        }
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            holding(place, x).into_iter().for_each(|v| place.refused(v));
        }
    }
}

#[test]
fn a_value_of_another_type_is_refused() {
    for place in every() {
        let wrong = match place.key.kind {
            kind if kind.of_text() || matches!(kind, Kind::Table | Kind::Texts | Kind::Bool) => Value::Integer(1),
            _ => Value::String("text".into()),
        };
        assert!(place.with(Some(wrong)).is_err(), "{} takes another type", place.shown());
        if place.key.kind == Kind::Integer {
            assert!(place.with(Some(Value::Float(1.5))).is_err(), "{} takes a half", place.shown());
        }
        if let Kind::Choice(words) = place.key.kind {
            words.iter().for_each(|w| place.taken(Value::String((*w).into())));
            assert!(place.with(Some(Value::String("no_such_word".into()))).is_err(), "{}", place.shown());
        }
    }
}

#[test]
fn a_list_has_as_many_as_it_may() {
    for place in every() {
        let many = |n: usize| match place.key.kind {
            // Names differ; all else may repeat.
            Kind::Texts => (1..=n).map(|i| Value::String(format!("x{i}"))).collect(),
            Kind::Roots => (1..=n).map(|i| Value::Float(-(i as f64))).collect(),
            Kind::Numbers => (1..=n).map(|i| Value::Float(i as f64)).collect(),
            _ => vec![place.value().as_array().unwrap()[0].clone(); n],
        };
        let [least, most] = place.key.items;
        if least > 0 {
            place.refused(Value::Array(many(least - 1)));
        }
        if most < usize::MAX {
            place.taken(Value::Array(many(most)));
            place.refused(Value::Array(many(most + 1)));
        }
    }
}

/// A range does not fall.
#[test]
fn a_range_that_falls_is_refused() {
    for place in every() {
        let falling = Value::Array(vec![number(place.key.kind, 20.0), number(place.key.kind, 10.0)]);
        match place.key.kind {
            Kind::Pair | Kind::Integers | Kind::NumberOrPair => place.refused(falling),
            Kind::Pairs => place.refused(Value::Array(vec![falling])),
            _ => {}
        }
    }
}

#[test]
fn an_unknown_key_is_refused_by_its_name() {
    for place in every() {
        let mut changed = place.sample.clone();
        Place::table(place.heading, &mut changed).unwrap().insert("no_such_key".into(), Value::Integer(1));
        let said = judge(place.file, &changed).err().unwrap_or_else(|| panic!("{} takes any key", place.shown()));
        assert!(said.contains("no_such_key"), "{}: {said}", place.shown());
    }
}
