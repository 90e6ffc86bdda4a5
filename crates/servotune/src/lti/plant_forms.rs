//! The forms in which plant.toml may give a rational plant besides its body: roots, coefficients, state matrices, residues, lags.
//!
//! In: the keys of `[plant]`. Out: [`Rational`]. Units rad/s, or Hz where the key ends in `_hz`. Formulas: `specs/files.md`.

use super::plant_table::{PlantTable, ResidueTable, Root, Through};
use super::state_space::Residue;
use super::{LtiError, Rational};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// What the forms are called and made of.
const FORMS: &str = "the keys of one form: a body (natural_frequency_rad_s with dc_gain and damping_ratio, or natural_frequency_rad_s = 0 with \
acceleration_gain and viscous_rate_per_s); gain, poles_rad_s and zeros_rad_s; numerator and denominator; a, b and c; or [[plant.residue]]";

/// The one of two keys that is given, in rad/s.
fn either<T>(key: &str, rad_s: Option<T>, hz: Option<T>, by: impl Fn(T, f64) -> T) -> Result<Option<T>, LtiError> {
    match (rad_s, hz) {
        (Some(_), Some(_)) => {
            let found = format!("`{key}_rad_s` and `{key}_hz`");
            Err(LtiError::Keys { found, expected: "one of the two" })
        }
        (rad_s, hz) => Ok(rad_s.or(hz.map(|x| by(x, TAU)))),
    }
}

fn missing<T>(value: Option<T>, key: &str, beside: &str) -> Result<T, LtiError> {
    value.ok_or_else(|| LtiError::Keys { found: format!("`{beside}` without `{key}`"), expected: "both" })
}

impl PlantTable {
    /// The plant of these keys; none where no form but the body's is given.
    pub fn rational(&self) -> Result<Option<Rational>, LtiError> {
        let is = |given: bool, key: &'static str| given.then_some(key);
        let of_roots = is(self.gain.is_some(), "gain")
            .or(is(self.zeros_rad_s.is_some(), "zeros_rad_s"))
            .or(is(self.zeros_hz.is_some(), "zeros_hz"))
            .or(is(self.poles_rad_s.is_some(), "poles_rad_s"))
            .or(is(self.poles_hz.is_some(), "poles_hz"));
        let of_coefficients =
            is(self.numerator.is_some(), "numerator").or(is(self.denominator.is_some(), "denominator"));
        let of_states = is(self.a.is_some(), "a")
            .or(is(self.b.is_some(), "b"))
            .or(is(self.c.is_some(), "c"))
            .or(is(self.d.is_some(), "d"));
        let of_residues = is(self.residue.is_some(), "residue");
        let of_body = is(self.natural_frequency_rad_s.is_some(), "natural_frequency_rad_s")
            .or(is(self.dc_gain.is_some(), "dc_gain"))
            .or(is(self.acceleration_gain.is_some(), "acceleration_gain"))
            .or(is(self.damping_ratio.is_some(), "damping_ratio"))
            .or(is(self.viscous_rate_per_s.is_some(), "viscous_rate_per_s"));
        let given: Vec<&str> =
            [of_body, of_roots, of_coefficients, of_states, of_residues].into_iter().flatten().collect();
        match given[..] {
            [_] => {}
            [] => return Err(LtiError::Keys { found: "no key that makes a plant".into(), expected: FORMS }),
            _ => {
                let found = given.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(" beside ");
                return Err(LtiError::Keys { found, expected: FORMS });
            }
        }
        if of_roots.is_some() {
            return self.of_roots().map(Some);
        }
        if of_coefficients.is_some() {
            let up = missing(self.numerator.as_deref(), "numerator", "denominator")?;
            let down = missing(self.denominator.as_deref(), "denominator", "numerator")?;
            return Rational::of_coefficients(up, down).map(Some);
        }
        if let Some(key) = of_states {
            let a = missing(self.a.as_deref(), "a", key)?;
            let (b, c) = (missing(self.b.as_ref(), "b", key)?, missing(self.c.as_ref(), "c", key)?);
            let through = match &self.d {
                None => 0.0,
                Some(Through::Plain(d)) => *d,
                Some(Through::Brackets(v)) => v.flat().into_iter().find(|d| *d != 0.0).unwrap_or(0.0),
            };
            if through != 0.0 {
                let expected = "0, or absent: a plant answers no command at once";
                return Err(LtiError::Range { key: "plant.d".into(), found: through, expected });
            }
            return Rational::of_states(a, &b.flat(), &c.flat()).map(Some);
        }
        match &self.residue {
            Some(all) => {
                let modes: Result<Vec<Residue>, LtiError> = all.iter().enumerate().map(residue).collect();
                Rational::of_residues(&modes?).map(Some)
            }
            None => Ok(None),
        }
    }

    fn of_roots(&self) -> Result<Rational, LtiError> {
        let by = |all: Vec<Root>, x: f64| {
            let each = |r: Root| match r {
                Root::Real(re) => Root::Real(re * x),
                Root::Complex([re, im]) => Root::Complex([re * x, im * x]),
            };
            all.into_iter().map(each).collect::<Vec<Root>>()
        };
        let poles = either("poles", self.poles_rad_s.clone(), self.poles_hz.clone(), by)?;
        let zeros = either("zeros", self.zeros_rad_s.clone(), self.zeros_hz.clone(), by)?;
        let found = Rational {
            gain: missing(self.gain, "gain", "poles_rad_s")?,
            zeros: complete("plant.zeros", &zeros.unwrap_or_default())?,
            poles: complete("plant.poles", &missing(poles, "poles_rad_s", "gain")?)?,
        };
        found.check(0)?;
        Ok(found)
    }

    /// Real roots (rad/s) of the factors 1 + s/lead and 1/(1 + s/lag): first the leads, then the lags.
    pub fn beside(&self) -> Result<[Vec<f64>; 2], LtiError> {
        let by = |all: Vec<f64>, x: f64| all.into_iter().map(|w| w * x).collect();
        let leads = either("lead", self.lead_rad_s.clone(), self.lead_hz.clone(), by)?.unwrap_or_default();
        let lags = either("lag", self.lag_rad_s.clone(), self.lag_hz.clone(), by)?.unwrap_or_default();
        let range = |key: &str, found: f64, expected| LtiError::Range { key: key.into(), found, expected };
        if let Some(&found) = lags.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
            return Err(range("plant.lag", found, "corner frequencies above 0"));
        }
        if let Some(&found) = leads.iter().find(|w| !(w.is_finite() && **w != 0.0)) {
            return Err(range(
                "plant.lead",
                found,
                "finite corner frequencies, not 0 (below 0: a zero right of the axis)",
            ));
        }
        Ok([leads, lags])
    }
}

fn residue((i, m): (usize, &ResidueTable)) -> Result<Residue, LtiError> {
    let key = format!("residue[{i}].frequency");
    let frequency = either(&key, m.frequency_rad_s, m.frequency_hz, |w, x| w * x)?;
    let frequency_rad_s = missing(frequency, &format!("{key}_rad_s"), &format!("residue[{i}].gain"))?;
    Ok(Residue { gain: m.gain, frequency_rad_s, damping_ratio: m.damping_ratio })
}

/// Two roots are conjugates within this share: a file rounds its digits.
const CONJUGATES: f64 = 1e-9;

/// The full list of roots. Where no root has a negative imaginary part each complex one stands for itself and its conjugate; else every
/// complex root must have its conjugate in the list.
fn complete(key: &str, given: &[Root]) -> Result<Vec<Complex<f64>>, LtiError> {
    let all: Vec<Complex<f64>> = given
        .iter()
        .map(|r| match *r {
            Root::Real(re) => Complex::new(re, 0.0),
            Root::Complex([re, im]) => Complex::new(re, im),
        })
        .collect();
    let (below, above): (Vec<_>, Vec<_>) = all.iter().filter(|r| r.im != 0.0).partition(|r| r.im < 0.0);
    let mut full: Vec<Complex<f64>> = all.iter().copied().filter(|r| r.im == 0.0).collect();
    if below.is_empty() {
        full.extend(above.into_iter().flat_map(|r: Complex<f64>| [r, r.conj()]));
        return Ok(full);
    }
    let mut below: Vec<Complex<f64>> = below;
    let alone = |r: Complex<f64>| LtiError::Conjugate { key: key.into(), re: r.re, im: r.im };
    for r in above {
        let at = below.iter().position(|b| (b.conj() - r).norm() <= CONJUGATES * r.norm()).ok_or_else(|| alone(r))?;
        below.swap_remove(at);
        full.extend([r, r.conj()]);
    }
    match below.first() {
        Some(r) => Err(alone(*r)),
        None => Ok(full),
    }
}
