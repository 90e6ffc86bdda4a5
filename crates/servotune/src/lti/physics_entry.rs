//! One effect beyond linear as it stands in the plant file; its meaning belongs to the physics room.

use super::{CurveEntry, CurveKnot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One `[[plant.physics]]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PhysicsTable", into = "PhysicsTable")]
pub struct PhysicsEntry {
    /// The effect's name from the contract's list.
    pub effect: String,
    /// Its parameters by name, in the units of the plant file.
    pub parameters: BTreeMap<String, f64>,
    /// The curve of an effect that is one.
    pub curve: Option<CurveEntry>,
}

/// The keys as they stand in the file. A curve's keys go all together or not at all.
#[derive(Serialize, Deserialize)]
struct PhysicsTable {
    effect: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    port: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    argument: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unit: Option<String>,
    #[serde(flatten)]
    parameters: BTreeMap<String, f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    knots: Option<Vec<CurveKnot>>,
}

impl TryFrom<PhysicsTable> for PhysicsEntry {
    type Error = String;

    fn try_from(t: PhysicsTable) -> Result<PhysicsEntry, String> {
        let curve = match (t.port, t.argument, t.unit, t.knots) {
            (None, None, None, None) => None,
            (Some(port), Some(argument), Some(unit), Some(knots)) => Some(CurveEntry { port, argument, unit, knots }),
            (port, argument, unit, knots) => {
                let keys = [
                    ("port", port.is_some()),
                    ("argument", argument.is_some()),
                    ("unit", unit.is_some()),
                    ("knots", knots.is_some()),
                ];
                let missing = keys.iter().find(|k| !k.1).map_or("", |k| k.0);
                return Err(format!(
                    "effect `{}`: key `{missing}` is missing; a curve has port, argument, unit and knots",
                    t.effect
                ));
            }
        };
        Ok(PhysicsEntry { effect: t.effect, parameters: t.parameters, curve })
    }
}

impl From<PhysicsEntry> for PhysicsTable {
    fn from(e: PhysicsEntry) -> PhysicsTable {
        let (port, argument, unit, knots) = match e.curve {
            Some(c) => (Some(c.port), Some(c.argument), Some(c.unit), Some(c.knots)),
            None => (None, None, None, None),
        };
        PhysicsTable { effect: e.effect, port, argument, unit, parameters: e.parameters, knots }
    }
}
