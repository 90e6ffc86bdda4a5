//! plant.toml, exactly as the contract has it, and back.

use super::{Body, LtiError, Mode, PhysicsEntry, Plant};
use serde::{Deserialize, Serialize};

/// The document `plant.toml`. Unknown keys are refused by the reader.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantFile {
    position_unit: String,
    command_unit: String,
    plant: PlantTable,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlantTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    dc_gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    acceleration_gain: Option<f64>,
    natural_frequency_rad_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    damping_ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    viscous_rate_per_s: Option<f64>,
    delay_s: f64,
    #[serde(default = "one")]
    resonance_gain: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    modes: Vec<Mode>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    physics: Vec<PhysicsEntry>,
}

fn one() -> f64 {
    1.0
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
        let body = if t.natural_frequency_rad_s == 0.0 {
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
                natural_frequency_rad_s: t.natural_frequency_rad_s,
                damping_ratio: need("damping_ratio", t.damping_ratio, expected)?,
            }
        };
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

impl PlantFile {
    /// What a file should be that is read as one.
    pub const EXPECTED: &str = "a plant model, as `servotune identify SWEEP --out` writes it";
}

impl From<&Plant> for PlantFile {
    fn from(p: &Plant) -> PlantFile {
        let (dc_gain, damping_ratio, acceleration_gain, viscous_rate_per_s, natural_frequency_rad_s) = match p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
                (Some(dc_gain), Some(damping_ratio), None, None, natural_frequency_rad_s)
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                (None, None, Some(acceleration_gain), Some(viscous_rate_per_s), 0.0)
            }
        };
        PlantFile {
            position_unit: p.position_unit.clone(),
            command_unit: p.command_unit.clone(),
            plant: PlantTable {
                dc_gain,
                acceleration_gain,
                natural_frequency_rad_s,
                damping_ratio,
                viscous_rate_per_s,
                delay_s: p.delay_s,
                resonance_gain: p.resonance_gain,
                modes: p.modes.clone(),
                physics: p.physics.clone(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::document::parse_toml;
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
}
