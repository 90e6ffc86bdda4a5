//! Numbers as a person says them.

/// A number to so many digits, with a power of ten only where zeros would have to be counted.
pub fn said(v: f64, digits: usize) -> String {
    if v == 0.0 || !v.is_finite() {
        return v.to_string();
    }
    let rounded: f64 = format!("{v:.*e}", digits - 1).parse().unwrap_or(v);
    let exponent = rounded.abs().log10().floor() as i32;
    match exponent {
        -4..6 => format!("{v:.*}", usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0)),
        _ => format!("{v:.*e}", digits - 1),
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
            (3.1e-9, "3.10e-9"),
        ];
        for (v, text) in cases {
            assert_eq!(said(v, 3), text);
        }
        assert_eq!(said(0.5, 4), "0.5000");
        assert_eq!(said(f64::INFINITY, 3), "inf");
    }
}
