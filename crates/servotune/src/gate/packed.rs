//! Numbers as text without loss: the bytes of each, lowest first, in base 64 (RFC 4648).
//!
//! In: slices of numbers. Out: text for a JSON field, a third longer than the bytes.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn encode(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let at = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let n = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = DIGITS[(n >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= three.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

fn decode(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for four in digits.chunks(4) {
        let mut n = 0u32;
        for i in 0..4 {
            let digit = four.get(i).map_or(Some(0), |d| DIGITS.iter().position(|x| x == d))?;
            n = n << 6 | digit as u32;
        }
        bytes.extend_from_slice(&n.to_be_bytes()[1..four.len().max(1)]);
    }
    Some(bytes)
}

/// Single-precision numbers in a JSON field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed32(pub Vec<f32>);

/// Double-precision numbers in a JSON field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed64(pub Vec<f64>);

macro_rules! packed {
    ($name:ident, $number:ty, $size:literal) => {
        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                let bytes: Vec<u8> = self.0.iter().flat_map(|x| x.to_le_bytes()).collect();
                to.serialize_str(&encode(&bytes))
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                let text = String::deserialize(from)?;
                let wrong = || de::Error::custom("not numbers in base 64");
                let bytes = decode(&text).filter(|b| b.len() % $size == 0).ok_or_else(wrong)?;
                let number = |b: &[u8]| {
                    let mut le = [0; $size];
                    le.copy_from_slice(b);
                    <$number>::from_le_bytes(le)
                };
                Ok($name(bytes.chunks_exact($size).map(number).collect()))
            }
        }
    };
}
packed!(Packed32, f32, 4);
packed!(Packed64, f64, 8);

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_standard_s_examples_and_back() {
        // RFC 4648, section 10.
        for (plain, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(encode(plain.as_bytes()), text);
            assert_eq!(decode(text).unwrap(), plain.as_bytes());
        }
        assert!(decode("Z*==").is_none());
        let numbers = Packed64(vec![0.1, -1e300, f64::MIN_POSITIVE]);
        let back: Packed64 = serde_json::from_str(&serde_json::to_string(&numbers).unwrap()).unwrap();
        assert_eq!(back, numbers);
    }
}
