//! Coefficients as the firmware holds them: double, single, or fixed point of a given word.

use super::VerifyError;
use crate::lti::Section;
use serde::{Deserialize, Serialize};

/// What the firmware stores a coefficient in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// IEEE double: the table's own numbers.
    #[default]
    Double,
    /// IEEE single, rounded to nearest.
    Single,
    /// Two's complement of `bits` bits, the last `fraction` of them behind the point, rounded to nearest.
    Fixed {
        /// Bits in all.
        bits: u32,
        /// Bits behind the point.
        fraction: u32,
    },
}

impl Word {
    /// The sections as held in this word. Rounding inside the filter's arithmetic and its overflow are not in it.
    pub fn hold(self, sections: &[Section]) -> Result<Vec<Section>, VerifyError> {
        if let Word::Fixed { bits, fraction } = self
            && !((2..=53).contains(&bits) && fraction < bits)
        {
            return Err(VerifyError::Word { bits, fraction });
        }
        sections
            .iter()
            .enumerate()
            .map(|(section, s)| {
                let one = |key, x| self.one(section, key, x);
                Ok(Section {
                    b0: one("b0", s.b0)?,
                    b1: one("b1", s.b1)?,
                    b2: one("b2", s.b2)?,
                    a1: one("a1", s.a1)?,
                    a2: one("a2", s.a2)?,
                })
            })
            .collect()
    }

    fn one(self, section: usize, key: &'static str, x: f64) -> Result<f64, VerifyError> {
        match self {
            Word::Double => Ok(x),
            Word::Single => Ok(f64::from(x as f32)),
            Word::Fixed { bits, fraction } => {
                let unit = 2f64.powi(fraction as i32);
                let largest = 2f64.powi(bits as i32 - 1) - 1.0;
                let held = (x * unit).round();
                if held > largest || held < -largest - 1.0 {
                    let largest = largest / unit;
                    return Err(VerifyError::Overflow { section, key, found: x, bits, fraction, largest });
                }
                Ok(held / unit)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_word_rounds_to_its_last_bit_and_refuses_what_it_cannot_hold() {
        let s = [Section { b0: 0.1, b1: -1.9, b2: 0.0, a1: -1.75, a2: 0.8 }];
        let word = Word::Fixed { bits: 16, fraction: 14 };
        let held = word.hold(&s).unwrap()[0];
        // Half of the last bit, 2^-15.
        assert!((held.b0 - 0.1).abs() <= 2f64.powi(-15) && held.a1 == -1.75);
        let e = Word::Fixed { bits: 16, fraction: 15 }.hold(&s).unwrap_err();
        assert!(matches!(e, VerifyError::Overflow { key: "b1", .. }));
        assert!(matches!(Word::Fixed { bits: 8, fraction: 8 }.hold(&s), Err(VerifyError::Word { .. })));
    }
}
