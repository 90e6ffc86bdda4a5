//! One number as sweep files write it.
//!
//! In: a trimmed field. Out: its value. A decimal comma counts where the file's layout says so; thousands separators never.

/// How a field reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Field {
    /// A finite number.
    Finite(f64),
    /// NaN, an infinity, or a number too large.
    NonFinite,
    /// Nothing at all, or a dash for nothing.
    Empty,
    /// Something else.
    Text,
}

/// Reads one field; `comma` says that the decimal sign is a comma.
pub(crate) fn read(field: &str, comma: bool) -> Field {
    let field = field.trim();
    if field.is_empty() {
        return Field::Empty;
    }
    let bare = field.trim_start_matches(['+', '-']).to_ascii_lowercase();
    if ["nan", "inf", "infinity", "#n/a", "n/a", "na", "1.#inf", "1.#qnan", "1.#ind"].contains(&bare.as_str()) {
        return Field::NonFinite;
    }
    // Only digits, one sign, one decimal sign and an exponent: `1_000`, `0x10` and words stay text.
    let allowed = |c: char| c.is_ascii_digit() || "+-eEdD".contains(c) || (if comma { c == ',' } else { c == '.' });
    if !field.chars().all(allowed) || !field.contains(|c: char| c.is_ascii_digit()) {
        return Field::Text;
    }
    // A trailing decimal comma is a separator that went wrong.
    if comma && (field.ends_with(',') || field.starts_with(',')) {
        return Field::Text;
    }
    let plain: String = field
        .chars()
        .map(|c| match c {
            ',' => '.',
            'd' | 'D' => 'e', // Fortran's double exponent
            other => other,
        })
        .collect();
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() => Field::Finite(value),
        Ok(_) => Field::NonFinite,
        Err(_) => Field::Text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_written() {
        assert_eq!(read(" -1.5e3 ", false), Field::Finite(-1500.0));
        assert_eq!(read("1.5D-3", false), Field::Finite(1.5e-3));
        assert_eq!(read("12,5", true), Field::Finite(12.5));
        assert_eq!(read("-NaN", false), Field::NonFinite);
        assert_eq!(read("1e999", false), Field::NonFinite);
        assert_eq!(read("", false), Field::Empty);
        for text in ["4O", "1.234,5", "0x10", "1_000", "-", "e5", "1e", "12 5"] {
            assert_eq!(read(text, true), Field::Text, "{text}");
            assert_eq!(read(text, false), Field::Text, "{text}");
        }
    }
}
