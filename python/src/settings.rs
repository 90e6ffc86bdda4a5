//! Keywords of Python into the library's settings. An unknown keyword is a `TypeError` that lists the known ones.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::frf::{ColumnChoice, Measured, ReadSettings, UnknownWord};
use servotune::identify::{BodyChoice, IdentifySettings, OrderChoice, ZeroSide};
use servotune::verify::Uncertainty;
use std::path::Path;
use std::str::FromStr;

/// A name for `repr`.
pub fn named(file: &Path) -> String {
    format!("'{}'", file.display())
}

/// A word of a choice, or a `ValueError` that lists the known ones.
fn word<T: FromStr<Err = UnknownWord>>(key: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    let text: String = value.extract()?;
    text.parse().map_err(|e| PyValueError::new_err(format!("{key}: {e}")))
}

/// A count, or an error that names it: no number below 0 wraps or overflows.
pub fn count(key: &str, value: &Bound<'_, PyAny>) -> PyResult<usize> {
    let refuse = || format!("{key}: found {}; expected a whole number of at least 0", shown(value));
    let found: i64 = value.extract().map_err(|_| PyTypeError::new_err(refuse()))?;
    usize::try_from(found).map_err(|_| PyValueError::new_err(refuse()))
}

/// The same where None stands for a choice of the program.
fn given(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    if value.is_none() { Ok(None) } else { count(key, value).map(Some) }
}

/// A value as Python writes it.
fn shown(value: &Bound<'_, PyAny>) -> String {
    value.repr().map_or_else(|_| "what cannot be shown".to_owned(), |r| r.to_string())
}

/// Refuses a keyword that nobody takes.
fn unknown(key: &str, known: &[&str]) -> PyErr {
    PyTypeError::new_err(format!("found the keyword `{key}`; expected one of: {}", known.join(", ")))
}

/// How a sweep is read, and what was swept.
pub struct Reading {
    /// How its file is read.
    pub settings: ReadSettings,
    /// What was swept.
    pub measured: Measured,
    /// Poles of the plant in the right half-plane.
    pub unstable_poles: usize,
}

/// Keywords of `read_frf`.
pub fn reading(keywords: &Bound<'_, PyDict>) -> PyResult<Reading> {
    const KNOWN: [&str; 15] = [
        "phase",
        "magnitude",
        "angle",
        "frequency",
        "conjugate",
        "duplicates",
        "unsorted",
        "bad_points",
        "outliers",
        "deviation",
        "columns",
        "dataset",
        "expect_hz",
        "measured",
        "unstable_poles",
    ];
    let mut r = Reading { settings: ReadSettings::default(), measured: Measured::default(), unstable_poles: 0 };
    let s = &mut r.settings;
    for (key, value) in keywords {
        let key: String = key.extract()?;
        match key.as_str() {
            "phase" => s.phase = word(&key, &value)?,
            "magnitude" => s.magnitude = word(&key, &value)?,
            "angle" => s.angle = word(&key, &value)?,
            "frequency" => s.frequency = word(&key, &value)?,
            "conjugate" => s.conjugate = word(&key, &value)?,
            "duplicates" => s.duplicates = word(&key, &value)?,
            "unsorted" => s.unsorted = word(&key, &value)?,
            "bad_points" => s.bad_points = word(&key, &value)?,
            "outliers" => s.outliers = word(&key, &value)?,
            "deviation" => s.deviation = word(&key, &value)?,
            "columns" => s.columns = Some(columns(value.cast::<PyDict>()?)?),
            "dataset" => s.dataset = value.extract()?,
            "expect_hz" => s.expected_hz = value.extract()?,
            "measured" => r.measured = word(&key, &value)?,
            "unstable_poles" => r.unstable_poles = count(&key, &value)?,
            _ => return Err(unknown(&key, &KNOWN)),
        }
    }
    Ok(r)
}

/// Columns by role.
fn columns(roles: &Bound<'_, PyDict>) -> PyResult<ColumnChoice> {
    const KNOWN: [&str; 7] = ["frequency", "magnitude", "phase", "real", "imaginary", "std", "coherence"];
    let mut choice = ColumnChoice::default();
    for (role, name) in roles {
        let (role, name): (String, String) = (role.extract()?, name.extract()?);
        match role.as_str() {
            "frequency" => choice.frequency = name,
            "magnitude" => choice.magnitude = Some(name),
            "phase" => choice.phase = Some(name),
            "real" => choice.real = Some(name),
            "imaginary" => choice.imaginary = Some(name),
            "std" => choice.std = Some(name),
            "coherence" => choice.coherence = Some(name),
            _ => return Err(unknown(&role, &KNOWN)),
        }
    }
    if choice.frequency.is_empty() {
        return Err(PyValueError::new_err("columns: expected `frequency` among the roles"));
    }
    Ok(choice)
}

/// Keywords of `identify`, beside the units of the sweep; and the sample time of a hold that is stated to be in it (s).
pub fn model(keywords: &Bound<'_, PyDict>, units: (&str, &str)) -> PyResult<(IdentifySettings, Option<f64>)> {
    const KNOWN: [&str; 6] = ["order", "max_order", "body", "minimum_phase", "hold_s", "band_hz"];
    let mut s = IdentifySettings {
        position_unit: units.0.to_owned(),
        command_unit: units.1.to_owned(),
        ..IdentifySettings::default()
    };
    let mut hold_s = None;
    let (mut order, mut most): (Option<usize>, Option<usize>) = (None, None);
    for (key, value) in keywords {
        let key: String = key.extract()?;
        match key.as_str() {
            "order" => order = given(&key, &value)?,
            "max_order" => most = given(&key, &value)?,
            "body" => {
                s.body = match value.extract::<String>()?.as_str() {
                    "auto" => BodyChoice::Auto,
                    "second_order" => BodyChoice::SecondOrder,
                    "free_inertia" => BodyChoice::FreeInertia,
                    found => {
                        let known = "auto, second_order, free_inertia";
                        return Err(PyValueError::new_err(format!("body: found `{found}`; expected one of: {known}")));
                    }
                }
            }
            "minimum_phase" if value.extract()? => s.zeros = ZeroSide::Left,
            "minimum_phase" => s.zeros = ZeroSide::Either,
            "hold_s" => hold_s = value.extract()?,
            "band_hz" => {
                if let Some((low, high)) = value.extract::<Option<(f64, f64)>>()? {
                    (s.low_hz, s.high_hz) = (low, high);
                }
            }
            _ => return Err(unknown(&key, &KNOWN)),
        }
    }
    for n in [order, most].into_iter().flatten() {
        if n < 2 || n % 2 == 1 || n > 80 {
            let expected = "an even number from 2 to 80: 2 for the body and 2 for each resonance";
            return Err(PyValueError::new_err(format!("order: found {n}; expected {expected}")));
        }
    }
    if let Some(n) = most {
        s.order = OrderChoice::Auto { max: n / 2 - 1 };
    }
    if let Some(n) = order {
        s.order = OrderChoice::Fixed(n / 2 - 1);
    }
    Ok((s, hold_s))
}

/// A box around a plant: shares by name.
pub fn uncertainty(shares: Option<&Bound<'_, PyDict>>) -> PyResult<Option<Uncertainty>> {
    let Some(shares) = shares else { return Ok(None) };
    let mut u = Uncertainty::default();
    for (key, share) in shares {
        let (key, share): (String, f64) = (key.extract()?, share.extract()?);
        if !(0.0..1.0).contains(&share) {
            let words = format!("uncertainty: {key} = {share}; expected a share of at least 0 and below 1");
            return Err(PyValueError::new_err(words));
        }
        match key.as_str() {
            "gain" => u.gain = share,
            "frequency" => u.frequency = share,
            "damping" => u.damping = share,
            "delay" => u.delay = share,
            _ => return Err(unknown(&key, &["gain", "frequency", "damping", "delay"])),
        }
    }
    Ok(Some(u))
}
