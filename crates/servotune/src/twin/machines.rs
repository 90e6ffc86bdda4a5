//! The paper's four machine classes, from the files in `specs/` that are built into the program.

use crate::controller::{Controller, ControllerError};
use crate::document::{DocumentError, parse_toml};
use crate::frf::{FrfError, FrfShapeError};
use crate::lti::{LtiError, Plant, PlantFile};
use crate::pes::{Profile, ProfileError};
use std::path::Path;
use thiserror::Error;

/// The classes of the paper's section 2.7.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MachineClass {
    /// Class 0.
    Healthy,
    /// Class 1.
    SensorFault,
    /// Class 2.
    LoosePushpin,
    /// Class 3.
    Tunable,
}

/// Why a made-up machine could not be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum TwinError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error(transparent)]
    Lti(#[from] LtiError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Profile(#[from] ProfileError),
    #[error(transparent)]
    Sweep(#[from] FrfShapeError),
    #[error(transparent)]
    Frf(#[from] FrfError),
    #[error("the gains of a slot cannot be written as TOML: {0}")]
    Toml(#[from] toml::ser::Error),
}

impl MachineClass {
    /// All classes, in the paper's order.
    pub const ALL: [MachineClass; 4] =
        [MachineClass::Healthy, MachineClass::SensorFault, MachineClass::LoosePushpin, MachineClass::Tunable];

    /// The class in words.
    pub fn name(self) -> &'static str {
        match self {
            MachineClass::Healthy => "healthy",
            MachineClass::SensorFault => "sensor fault",
            MachineClass::LoosePushpin => "loose pushpin",
            MachineClass::Tunable => "tunable",
        }
    }

    /// The name of its file, without the ending.
    pub fn file_name(self) -> &'static str {
        match self {
            MachineClass::Healthy => "healthy",
            MachineClass::SensorFault => "sensor_fault",
            MachineClass::LoosePushpin => "loose_pushpin",
            MachineClass::Tunable => "tunable",
        }
    }
}

/// The plant of a class, `specs/machines/`.
pub fn paper_machine(class: MachineClass) -> Result<Plant, TwinError> {
    let text = match class {
        MachineClass::Healthy => include_str!("../../../../specs/machines/healthy.toml"),
        MachineClass::SensorFault => include_str!("../../../../specs/machines/sensor_fault.toml"),
        MachineClass::LoosePushpin => include_str!("../../../../specs/machines/loose_pushpin.toml"),
        MachineClass::Tunable => include_str!("../../../../specs/machines/tunable.toml"),
    };
    let name = format!("specs/machines/{}.toml", class.file_name());
    Ok(Plant::try_from(parse_toml::<PlantFile>(Path::new(&name), text)?)?)
}

/// The spiral write of a class, `specs/profiles/`: a sensor fault has three times the encoder noise.
pub fn paper_profile(class: MachineClass) -> Result<Profile, TwinError> {
    let (name, text) = match class {
        MachineClass::SensorFault => {
            ("specs/profiles/sensor_fault.toml", include_str!("../../../../specs/profiles/sensor_fault.toml"))
        }
        _ => ("specs/profiles/spiral.toml", include_str!("../../../../specs/profiles/spiral.toml")),
    };
    Ok(parse_toml(Path::new(name), text)?)
}

/// The controller that every slot runs before tuning, `specs/controllers/nominal.toml`.
pub fn nominal_controller() -> Result<Controller, TwinError> {
    let text = include_str!("../../../../specs/controllers/nominal.toml");
    Ok(parse_toml(Path::new("specs/controllers/nominal.toml"), text)?)
}
