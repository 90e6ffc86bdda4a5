//! plant.toml, exactly as the contract has it, and back; beside the body's keys the forms of [`super::plant_forms`].

use super::plant_table::{PlantTable, Root};
use super::{Body, LtiError, Plant};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// The document `plant.toml`. Unknown keys are refused by the reader.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantFile {
    position_unit: String,
    command_unit: String,
    plant: PlantTable,
}

fn need(key: &str, value: Option<f64>, expected: &'static str) -> Result<f64, LtiError> {
    value.ok_or(LtiError::Range { key: format!("plant.{key}"), found: f64::NAN, expected })
}

fn refuse(key: &str, value: Option<f64>, expected: &'static str) -> Result<(), LtiError> {
    value.map_or(Ok(()), |found| Err(LtiError::Range { key: format!("plant.{key}"), found, expected }))
}

impl TryFrom<PlantFile> for Plant {
    type Error = LtiError;

    fn try_from(file: PlantFile) -> Result<Plant, LtiError> {
        let t = file.plant;
        let rational = t.rational()?;
        let body = if let Some(r) = rational {
            Body::Rational(r)
        } else if need("natural_frequency_rad_s", t.natural_frequency_rad_s, "this key, 0 for a free inertia")? == 0.0 {
            let free = "no such key beside natural_frequency_rad_s = 0 (a free inertia)";
            refuse("dc_gain", t.dc_gain, free)?;
            refuse("damping_ratio", t.damping_ratio, free)?;
            let expected = "this key beside natural_frequency_rad_s = 0 (a free inertia)";
            Body::FreeInertia {
                acceleration_gain: need("acceleration_gain", t.acceleration_gain, expected)?,
                viscous_rate_per_s: need("viscous_rate_per_s", t.viscous_rate_per_s, expected)?,
            }
        } else {
            let second = "no such key beside natural_frequency_rad_s above 0 (a second-order body)";
            refuse("acceleration_gain", t.acceleration_gain, second)?;
            refuse("viscous_rate_per_s", t.viscous_rate_per_s, second)?;
            let expected = "this key beside natural_frequency_rad_s above 0 (a second-order body)";
            Body::SecondOrder {
                dc_gain: need("dc_gain", t.dc_gain, expected)?,
                natural_frequency_rad_s: t.natural_frequency_rad_s.unwrap_or_default(),
                damping_ratio: need("damping_ratio", t.damping_ratio, expected)?,
            }
        };
        let [leads, lags] = t.beside()?;
        // By its own keys, before lags and leads make roots of it.
        body.check(t.modes.len())?;
        let body = if leads.is_empty() && lags.is_empty() { body } else { filtered(&body, &leads, &lags) };
        let plant = Plant {
            position_unit: file.position_unit,
            command_unit: file.command_unit,
            body,
            delay_s: t.delay_s,
            resonance_gain: t.resonance_gain,
            modes: t.modes,
            physics: t.physics,
        };
        plant.check()?;
        Ok(plant)
    }
}

/// The body times 1 + s/lead and 1/(1 + s/lag) of every corner (rad/s).
fn filtered(body: &Body, leads: &[f64], lags: &[f64]) -> Body {
    let mut r = body.rational();
    for w in leads {
        r.gain /= w;
        r.zeros.push(Complex::new(-w, 0.0));
    }
    for w in lags {
        r.gain *= w;
        r.poles.push(Complex::new(-w, 0.0));
    }
    Body::Rational(r)
}

impl PlantFile {
    /// What a file should be that is read as one.
    pub const EXPECTED: &str = "a plant model, as `servotune identify SWEEP --out` writes it";
}

impl From<&Plant> for PlantFile {
    fn from(p: &Plant) -> PlantFile {
        let mut table = PlantTable {
            dc_gain: None,
            acceleration_gain: None,
            natural_frequency_rad_s: None,
            damping_ratio: None,
            viscous_rate_per_s: None,
            gain: None,
            zeros_rad_s: None,
            zeros_hz: None,
            poles_rad_s: None,
            poles_hz: None,
            numerator: None,
            denominator: None,
            a: None,
            b: None,
            c: None,
            d: None,
            lag_rad_s: None,
            lag_hz: None,
            lead_rad_s: None,
            lead_hz: None,
            delay_s: p.delay_s,
            resonance_gain: p.resonance_gain,
            residue: None,
            modes: p.modes.clone(),
            physics: p.physics.clone(),
        };
        match p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
                table.dc_gain = Some(dc_gain);
                table.natural_frequency_rad_s = Some(natural_frequency_rad_s);
                table.damping_ratio = Some(damping_ratio);
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                table.acceleration_gain = Some(acceleration_gain);
                table.natural_frequency_rad_s = Some(0.0);
                table.viscous_rate_per_s = Some(viscous_rate_per_s);
            }
            Body::Rational(ref r) => {
                let roots = |all: &[Complex<f64>]| all.iter().map(Root::from).collect::<Vec<Root>>();
                table.gain = Some(r.gain);
                table.zeros_rad_s = Some(roots(&r.zeros)).filter(|z| !z.is_empty());
                table.poles_rad_s = Some(roots(&r.poles));
            }
        }
        PlantFile { position_unit: p.position_unit.clone(), command_unit: p.command_unit.clone(), plant: table }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::document::parse_toml;
    use crate::lti::FrequencyResponse;
    use std::path::Path;

    const FREE: &str = "position_unit='m'\ncommand_unit='V'\n[plant]\nnatural_frequency_rad_s=0\nacceleration_gain=2.0\nviscous_rate_per_s=1.0\ndelay_s=0.0\n";

    #[test]
    fn a_plant_survives_the_way_to_the_file_and_back() {
        let read: PlantFile = parse_toml(Path::new("p"), FREE).unwrap();
        let plant = Plant::try_from(read).unwrap();
        let text = toml::to_string(&PlantFile::from(&plant)).unwrap();
        let again = Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &text).unwrap()).unwrap();
        assert_eq!(plant, again);
    }

    #[test]
    fn a_key_of_the_other_kind_of_body_is_refused_by_name() {
        let text = FREE.replace("viscous", "dc_gain=1.0\nviscous");
        let e = Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &text).unwrap()).unwrap_err();
        assert!(matches!(e, LtiError::Range { key, .. } if key == "plant.dc_gain"));
    }

    fn plant(body: &str) -> Result<Plant, LtiError> {
        let dead = if body.contains("delay_s") { "" } else { "delay_s=0\n" };
        let text = format!("position_unit='um'\ncommand_unit='A'\n[plant]\n{dead}{body}\n");
        Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &text).unwrap())
    }

    /// The same machine in every form: 3e9 (s + 900)/(s (s + 40) (s² + 2·0.02·5000 s + 5000²)) with a delay.
    #[test]
    fn every_form_gives_the_same_response() {
        let closed = |w: f64| {
            let s = Complex::new(0.0, w);
            3e9 * (s + 900.0) / (s * (s + 40.0) * (s * s + 200.0 * s + 25e6)) * (s * -1e-4).exp()
        };
        let im = (25e6f64 - 1e4).sqrt();
        let tau = std::f64::consts::TAU;
        let forms = [
            format!("gain=3e9\nzeros_rad_s=[-900]\npoles_rad_s=[0, -40, [-100, {im}]]"),
            format!("gain=3e9\nzeros_rad_s=[-900.0]\npoles_rad_s=[[-100.0, -{im}], 0.0, -40.0, [-100.0, {im}]]"),
            format!("gain=3e9\nzeros_hz=[{}]\npoles_hz=[0, {}, [{}, {}]]", -900.0 / tau, -40.0 / tau, -100.0 / tau, im / tau),
            "numerator=[0, 3e9, 2.7e12]\ndenominator=[1, 240, 25008e3, 1e9, 0]".into(),
            "a=[[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,-1e9,-25008e3,-240]]\nb=[[0],[0],[0],[1]]\nc=[[2.7e12,3e9,0,0]]\nd=[[0]]".into(),
            // A body with its real zero beside it, the resonance from its own pole: here as a lead and a mode without a zero pair would
            // be of another form, so the lag of the body is given instead.
            "natural_frequency_rad_s=5000\ndamping_ratio=0.02\ndc_gain=120\nlead_rad_s=[900]\nlag_rad_s=[40]".into(),
        ];
        for (i, form) in forms.iter().enumerate() {
            let p = plant(&format!("{form}\ndelay_s=1e-4")).unwrap();
            let again = toml::to_string(&PlantFile::from(&p)).unwrap();
            let again = Plant::try_from(parse_toml::<PlantFile>(Path::new("p"), &again).unwrap()).unwrap();
            for w in [0.5, 30.0, 800.0, 4990.0, 5e4] {
                let truth = match i {
                    // 120 (1 + s/900)/(1 + s/40)/(s²/25e6 + ...), without the integrator.
                    5 => {
                        let s = Complex::new(0.0, w);
                        120.0 * (1.0 + s / 900.0) / (1.0 + s / 40.0) / (1.0 + s * 8e-6 + s * s / 25e6)
                            * (s * -1e-4).exp()
                    }
                    _ => closed(w),
                };
                assert!((p.at(w) / truth - 1.0).norm() < 1e-11, "{i} {w} {}", p.at(w) / truth);
            }
            // The list may come back in another order.
            assert!((again.at(777.0) / p.at(777.0) - 1.0).norm() < 1e-14);
        }
    }

    #[test]
    fn residues_add_up() {
        let tau = std::f64::consts::TAU;
        let text = "[[plant.residue]]\ngain=1.3e7\nfrequency_rad_s=0\n[[plant.residue]]\ngain=-4e6\nfrequency_hz=2200\ndamping_ratio=0.03";
        let p = plant(text).unwrap();
        for w in [10.0, 1e4, 2200.0 * tau, 1e5] {
            let (s, w0) = (Complex::new(0.0, w), 2200.0 * tau);
            let truth = 1.3e7 / (s * s) - 4e6 / (s * s + s * (0.06 * w0) + w0 * w0);
            assert!((p.at(w) / truth - 1.0).norm() < 1e-11);
        }
    }

    #[test]
    fn forms_that_do_not_go_together_are_refused_by_their_keys() {
        let words = |body: &str| plant(body).unwrap_err().to_string();
        assert!(words("gain=1\npoles_rad_s=[-1]\nnumerator=[1]").contains("`gain` beside `numerator`"));
        assert!(words("delay_s=0").contains("no key that makes a plant"));
        assert!(words("gain=1.0").contains("`gain` without `poles_rad_s`"));
        assert!(words("gain=1\npoles_rad_s=[-1]\npoles_hz=[-1]").contains("`poles_hz`"));
        assert!(words("gain=1\npoles_rad_s=[[-1, 2],[-3, -2]]").contains("no conjugate"));
        assert!(words("a=[[-1]]\nb=[1]\nc=[1]\nd=0.1").contains("plant.d = 0.1"));
        assert!(words("a=[[-1]]\nb=[1]").contains("`c`"));
        assert!(words("gain=1\npoles_rad_s=[-1]\nlag_rad_s=[-3]").contains("plant.lag"));
        assert!(words("gain=1\npoles_rad_s=[-1]\nzeros_rad_s=[-2]").contains("fewer zeros"));
        assert!(words("dc_gain=1").contains("natural_frequency_rad_s"));
    }
}
