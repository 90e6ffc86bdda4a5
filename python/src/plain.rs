//! One value of a document without taking the document apart: a call in a loop looks at one or two numbers of many.

use pyo3::prelude::*;
use pyo3::types::PyString;
use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// A value that needs no other one.
enum Plain {
    Null,
    Truth(bool),
    Whole(i64),
    Number(f64),
    Word(String),
    /// A list or an object, or a whole number that only Python holds.
    Other,
}

/// The value of a key on the top level of a JSON document, as Python's json reads it; none for a list, an object, a key that is not there.
pub fn plain_value<'py>(py: Python<'py>, json: &str, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    let mut found = None;
    // What follows the value is not read, which the reader calls an error.
    let _ = serde_json::Deserializer::from_str(json).deserialize_map(Seek { key, found: &mut found });
    Ok(Some(match found {
        Some(Plain::Null) => py.None().into_bound(py),
        Some(Plain::Truth(x)) => x.into_pyobject(py)?.to_owned().into_any(),
        Some(Plain::Whole(x)) => x.into_pyobject(py)?.into_any(),
        Some(Plain::Number(x)) => x.into_pyobject(py)?.into_any(),
        Some(Plain::Word(x)) => PyString::new(py, &x).into_any(),
        Some(Plain::Other) | None => return Ok(None),
    }))
}

/// Goes through a document's keys up to one of them.
struct Seek<'a> {
    key: &'a str,
    found: &'a mut Option<Plain>,
}

impl<'de> Visitor<'de> for Seek<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<&str>()? {
            if key == self.key {
                *self.found = Some(map.next_value()?);
                return Ok(());
            }
            map.next_value::<IgnoredAny>()?;
        }
        Ok(())
    }
}

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Plain, D::Error> {
        d.deserialize_any(Any)
    }
}

struct Any;

impl<'de> Visitor<'de> for Any {
    type Value = Plain;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_unit<E: Error>(self) -> Result<Plain, E> {
        Ok(Plain::Null)
    }

    fn visit_bool<E: Error>(self, x: bool) -> Result<Plain, E> {
        Ok(Plain::Truth(x))
    }

    fn visit_i64<E: Error>(self, x: i64) -> Result<Plain, E> {
        Ok(Plain::Whole(x))
    }

    fn visit_u64<E: Error>(self, x: u64) -> Result<Plain, E> {
        Ok(i64::try_from(x).map_or(Plain::Other, Plain::Whole))
    }

    fn visit_f64<E: Error>(self, x: f64) -> Result<Plain, E> {
        Ok(Plain::Number(x))
    }

    fn visit_str<E: Error>(self, x: &str) -> Result<Plain, E> {
        Ok(Plain::Word(x.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, _: A) -> Result<Plain, A::Error> {
        Ok(Plain::Other)
    }

    fn visit_map<A: MapAccess<'de>>(self, _: A) -> Result<Plain, A::Error> {
        Ok(Plain::Other)
    }
}
