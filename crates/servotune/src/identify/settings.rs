//! What identification may assume, in units.

use serde::{Deserialize, Serialize};

/// Form of the rigid body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyChoice {
    /// The form that the data support: a second-order body where its natural frequency can be seen, else a free inertia.
    #[default]
    Auto,
    /// Eq. (1).
    SecondOrder,
    /// acceleration_gain / (s² + viscous_rate s).
    FreeInertia,
}

/// Number of resonance pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OrderChoice {
    /// The number that predicts frequencies left out of the fit, at most `max` pairs.
    Auto {
        /// Most pairs tried.
        max: usize,
    },
    /// Exactly this many pairs, fewer only where no further pair can be placed.
    Fixed(usize),
}

/// Where zeros may lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ZeroSide {
    /// In either half-plane, as the data say. A machine whose sensor sits away from its motor has right-half-plane zeros,
    /// and a model that is denied them answers with a wrong phase.
    #[default]
    Either,
    /// In the left half-plane only, the paper's condition.
    Left,
}

/// Settings of [`identify`](super::identify). The defaults are the paper's where it states a number.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifySettings {
    /// Unit of position written into the plant.
    pub position_unit: String,
    /// Unit of the command written into the plant.
    pub command_unit: String,
    /// Lowest frequency used (Hz).
    pub low_hz: f64,
    /// Highest frequency used (Hz).
    pub high_hz: f64,
    /// Form of the rigid body.
    pub body: BodyChoice,
    /// Highest frequency of the rigid body's own fit (Hz), section 2.4; shortened by the phase condition, lengthened
    /// where too few points lie below it.
    pub body_high_hz: f64,
    /// First interval of the dead time (s), section 2.4; widened when the answer lies on an end of it.
    pub delay_s: (f64, f64),
    /// Longest dead time allowed (s).
    pub delay_limit_s: f64,
    /// First interval of the resonance gain (dB), section 2.6; widened when the answer lies on an end of it.
    pub resonance_gain_db: (f64, f64),
    /// Least prominence of a peak (dB), section 2.5.
    pub prominence_db: f64,
    /// Peaks closer than this frequency ratio share a group, section 2.5.
    pub group_ratio: f64,
    /// Number of resonance pairs.
    pub order: OrderChoice,
    /// Number of parts into which frequencies are dealt, in turn, for the held-out score.
    pub folds: usize,
    /// Where zeros may lie.
    pub zeros: ZeroSide,
    /// Largest local relative error inside the trusted band (ratio).
    pub trust_limit: f64,
    /// Rounds of re-weighting in each linear fit, eqs. (17)-(18).
    pub weight_rounds: usize,
}

impl Default for IdentifySettings {
    fn default() -> Self {
        IdentifySettings {
            position_unit: "track".into(),
            command_unit: "V".into(),
            low_hz: 0.0,
            high_hz: f64::MAX,
            body: BodyChoice::Auto,
            body_high_hz: 500.0,
            delay_s: (39.6e-6, 79.4e-6),
            delay_limit_s: 2e-3,
            resonance_gain_db: (0.1, 2.0),
            prominence_db: 1.0,
            group_ratio: 1.12,
            order: OrderChoice::Auto { max: 14 },
            folds: 5,
            zeros: ZeroSide::Either,
            trust_limit: 0.1,
            weight_rounds: 20,
        }
    }
}
