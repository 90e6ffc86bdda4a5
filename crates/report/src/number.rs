//! Numbers as text: the same digits on every machine.
//!
//! In: a number and how many digits are worth reading. Out: text with an ASCII minus, for a terminal, or with the
//! typographic minus, for a page. Spec: `specs/report.md`.

use servotune::numeric::digits::said;

/// What stands where a number is missing or not finite.
pub const MISSING: &str = "—";

/// How a number is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberFormat {
    /// So many significant digits; powers of ten outside 1e-4 to 1e6.
    Significant(u8),
    /// So many digits behind the point.
    Decimals(u8),
}

impl NumberFormat {
    /// The number as text, ASCII only except for [`MISSING`].
    ///
    /// ```
    /// use servotune_report::number::NumberFormat;
    /// assert_eq!(NumberFormat::Significant(3).text(1234.4), "1234");
    /// assert_eq!(NumberFormat::Significant(3).text(0.0123449), "0.0123");
    /// assert_eq!(NumberFormat::Decimals(1).text(-0.04), "0.0");
    /// ```
    pub fn text(self, value: f64) -> String {
        match self {
            NumberFormat::Significant(digits) => significant(value, digits),
            NumberFormat::Decimals(digits) => decimals(value, usize::from(digits)),
        }
    }

    /// The number for a page: the minus sign is as wide as a digit.
    pub fn page(self, value: f64) -> String {
        typographic(&self.text(value))
    }
}

/// The text with each ASCII minus replaced by the minus sign.
pub fn typographic(number: &str) -> String {
    number.replace('-', "\u{2212}")
}

fn decimals(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return not_finite(value);
    }
    let text = format!("{value:.digits$}");
    // "-0.0" says that the sign is known; it is not.
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    }
}

fn not_finite(value: f64) -> String {
    if value.is_nan() {
        MISSING.to_owned()
    } else if value > 0.0 {
        "inf".to_owned()
    } else {
        "-inf".to_owned()
    }
}

fn significant(value: f64, digits: u8) -> String {
    if value.is_finite() { said(value, usize::from(digits)) } else { not_finite(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_survive_rounding_up_and_both_ends_of_the_range() {
        let three = NumberFormat::Significant(3);
        for (value, text) in [
            (9.996, "10.0"),
            (0.00099996, "0.00100"),
            (0.0, "0"),
            (-0.0, "0"),
            (1e-9, "1.00e-9"),
            (2.5e7, "2.50e7"),
            (-75.0, "-75.0"),
            (123456.0, "123456"),
            (f64::NAN, "—"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(three.text(value), text, "{value}");
        }
    }

    #[test]
    fn a_page_shows_the_minus_sign_and_never_minus_zero() {
        assert_eq!(NumberFormat::Decimals(2).page(-1.5), "\u{2212}1.50");
        assert_eq!(NumberFormat::Decimals(2).page(-0.001), "0.00");
    }
}
