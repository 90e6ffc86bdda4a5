//! A parameter of a law under the name that reports and plant files use, with its unit in the machine's own units.

/// Unit of a parameter, in the machine's own units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// position_unit.
    Position,
    /// command_unit.
    Command,
    /// Seconds.
    Second,
    /// Hertz.
    Hertz,
    /// A plain number.
    Ratio,
    /// Degrees.
    Degree,
    /// command_unit per position_unit.
    CommandPerPosition,
    /// command_unit per position_unit³.
    CommandPerPositionCubed,
    /// command_unit s per position_unit.
    CommandSecondPerPosition,
    /// command_unit per second.
    CommandPerSecond,
    /// position_unit per second.
    PositionPerSecond,
    /// 1/position_unit.
    PerPosition,
    /// 1/position_unit².
    PerPositionSquared,
    /// 1/s.
    PerSecond,
    /// position_unit per command_unit.
    PositionPerCommand,
    /// command_unit per position_unit².
    CommandPerPositionSquared,
    /// command_unit s² per position_unit².
    CommandSecondSquaredPerPositionSquared,
    /// command_unit per s².
    CommandPerSecondSquared,
    /// 1/°C.
    PerDegreeCelsius,
    /// Samples.
    Sample,
    /// Anything else that the name of the parameter says.
    Named(&'static str),
}

impl Unit {
    /// The unit as text for a machine with these units.
    pub fn text(self, position: &str, command: &str) -> String {
        match self {
            Unit::Position => position.into(),
            Unit::Command => command.into(),
            Unit::Second => "s".into(),
            Unit::Hertz => "Hz".into(),
            Unit::Ratio => "1".into(),
            Unit::Degree => "deg".into(),
            Unit::CommandPerPosition => format!("{command}/{position}"),
            Unit::CommandPerPositionCubed => format!("{command}/{position}^3"),
            Unit::CommandSecondPerPosition => format!("{command} s/{position}"),
            Unit::CommandPerSecond => format!("{command}/s"),
            Unit::PositionPerSecond => format!("{position}/s"),
            Unit::PerPosition => format!("1/{position}"),
            Unit::PerPositionSquared => format!("1/{position}^2"),
            Unit::PerSecond => "1/s".into(),
            Unit::PositionPerCommand => format!("{position}/{command}"),
            Unit::CommandPerPositionSquared => format!("{command}/{position}^2"),
            Unit::CommandSecondSquaredPerPositionSquared => format!("{command} s^2/{position}^2"),
            Unit::CommandPerSecondSquared => format!("{command}/s^2"),
            Unit::PerDegreeCelsius => "1/K".into(),
            Unit::Sample => "samples".into(),
            Unit::Named(text) => text.into(),
        }
    }
}

/// A parameter under the name that reports and plant files use.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: Unit,
}

impl Parameter {
    /// A named value.
    pub fn new(name: &'static str, value: f64, unit: Unit) -> Parameter {
        Parameter { name, value, unit }
    }

    /// By how much it exceeds another; phases by half a turn at most, either way.
    pub fn beyond(&self, other: &Parameter) -> f64 {
        let by = self.value - other.value;
        if self.unit == Unit::Degree { (by + 180.0).rem_euclid(360.0) - 180.0 } else { by }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_on_either_side_of_half_a_turn_are_near_each_other() {
        let of = |value, unit| Parameter::new("phase_deg", value, unit);
        assert_eq!(of(179.0, Unit::Degree).beyond(&of(-178.0, Unit::Degree)), -3.0);
        assert_eq!(of(-178.0, Unit::Degree).beyond(&of(179.0, Unit::Degree)), 3.0);
        assert_eq!(of(400.0, Unit::Hertz).beyond(&of(20.0, Unit::Hertz)), 380.0);
    }
}
