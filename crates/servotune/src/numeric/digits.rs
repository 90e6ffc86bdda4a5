//! Numbers as a person says them.

/// A number to so many digits, with a power of ten only where zeros would have to be counted: outside 1e-4 to 1e6.
pub fn said(v: f64, digits: usize) -> String {
    if v == 0.0 {
        return "0".to_owned();
    }
    // The exponent after rounding: 9.996 with three digits is 10.0, not 10.00.
    let digits = digits.max(1);
    let scientific = format!("{v:.*e}", digits - 1);
    let power = scientific.split_once('e').and_then(|(_, p)| p.parse::<i32>().ok());
    match power {
        Some(power @ -4..=6) => format!("{v:.*}", usize::try_from(digits as i32 - 1 - power).unwrap_or(0)),
        _ => scientific,
    }
}

#[cfg(test)]
mod tests {
    use super::said;

    #[test]
    fn digits_are_those_of_the_number() {
        let cases = [
            (0.0, "0"),
            (2.345, "2.35"),
            (-0.00012345, "-0.000123"),
            (12345.0, "12345"),
            (9.996, "10.0"),
            (1234567.0, "1234567"),
            (2.5e7, "2.50e7"),
            (3.1e-9, "3.10e-9"),
        ];
        for (v, text) in cases {
            assert_eq!(said(v, 3), text);
        }
        assert_eq!(said(0.5, 4), "0.5000");
        assert_eq!(said(f64::INFINITY, 3), "inf");
    }
}
