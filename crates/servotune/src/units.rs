//! Newtypes for the doors of the program. Inside, everything is rad/s, s, radians and plain ratios.
//!
//! In: numbers as people and files write them (hertz, decibels, degrees).
//! Out: the same quantity in the inner unit. Convention: `specs/conventions.md`.

use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::fmt;

/// A frequency in hertz.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Hertz(pub f64);

/// An angular frequency in rad/s.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RadPerSec(pub f64);

/// A magnitude ratio in decibels, 20 log10 of the ratio.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Decibels(pub f64);

/// An angle in degrees.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Degrees(pub f64);

/// A time in seconds.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Seconds(pub f64);

impl Hertz {
    /// The angular frequency 2 pi f.
    ///
    /// ```
    /// use servotune::units::Hertz;
    /// assert_eq!(Hertz(1.0).rad_per_sec().0, std::f64::consts::TAU);
    /// ```
    pub fn rad_per_sec(self) -> RadPerSec {
        RadPerSec(self.0 * TAU)
    }
}

impl RadPerSec {
    /// The frequency w / (2 pi).
    pub fn hertz(self) -> Hertz {
        Hertz(self.0 / TAU)
    }
}

impl Decibels {
    /// The decibels of a positive ratio; minus infinity for 0.
    pub fn from_ratio(ratio: f64) -> Self {
        Decibels(20.0 * ratio.log10())
    }

    /// The ratio, 10^(dB/20).
    ///
    /// ```
    /// use servotune::units::Decibels;
    /// assert!((Decibels(20.0).ratio() - 10.0).abs() < 1e-14);
    /// ```
    pub fn ratio(self) -> f64 {
        10f64.powf(self.0 / 20.0)
    }
}

impl Degrees {
    /// The degrees of an angle in radians.
    pub fn from_radians(radians: f64) -> Self {
        Degrees(radians * 180.0 / PI)
    }

    /// The angle in radians.
    pub fn radians(self) -> f64 {
        self.0 * PI / 180.0
    }
}

macro_rules! show_with_unit {
    ($($name:ident => $unit:literal),*) => {$(
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    )*};
}
show_with_unit!(Hertz => "Hz", RadPerSec => "rad/s", Decibels => "dB", Degrees => "deg", Seconds => "s");
