//! Colours, in light and in dark, that stay apart for colour-blind readers.
//!
//! In: the meaning of a colour ([`Ink`]). Out: class names and style rules. The first four data colours follow the
//! palette of Okabe and Ito, "Color Universal Design" (2008), darkened until they read as words on white; the dark set
//! is the same hues, lighter. Colour is never the only
//! sign: series differ in dash or shape too, limits carry words. Spec: `specs/report.md`.

use super::figure::Ink;
use std::fmt::Write;

/// A set of colours.
pub(super) struct Theme {
    /// Class name and colour of each ink.
    inks: [(&'static str, &'static str); 9],
    paper: &'static str,
    text: &'static str,
    faint: &'static str,
    grid: &'static str,
    frame: &'static str,
}

/// Dark on white.
pub(super) const LIGHT: Theme = Theme {
    inks: [
        ("i0", "#0072b2"),
        ("i1", "#c65200"),
        ("i2", "#007f5a"),
        ("i3", "#a6508a"),
        ("i4", "#6b5200"),
        ("i5", "#4b3fb0"),
        ("im", "#8a929c"),
        ("il", "#b3202c"),
        ("ip", "#3b434d"),
    ],
    paper: "#ffffff",
    text: "#1b2129",
    faint: "#59636f",
    grid: "#e6e9ed",
    frame: "#aab2bc",
};

/// Light on near black.
pub(super) const DARK: Theme = Theme {
    inks: [
        ("i0", "#58b4ea"),
        ("i1", "#ff9248"),
        ("i2", "#37c99b"),
        ("i3", "#e39cc6"),
        ("i4", "#f2e05c"),
        ("i5", "#8f8cff"),
        ("im", "#848d99"),
        ("il", "#ff7b80"),
        ("ip", "#c9d0d9"),
    ],
    paper: "#161b22",
    text: "#e4e8ee",
    faint: "#a0aab6",
    grid: "#2a313b",
    frame: "#4b5562",
};

/// The class that gives an element its colour.
pub(super) fn class(ink: Ink) -> &'static str {
    const DATA: [&str; 6] = ["i0", "i1", "i2", "i3", "i4", "i5"];
    match ink {
        Ink::Data(number) => DATA[usize::from(number) % DATA.len()],
        Ink::Muted => "im",
        Ink::Limit => "il",
        Ink::Plain => "ip",
    }
}

impl Theme {
    /// Style rules for every plot.
    pub fn rules(&self) -> String {
        let mut css = String::new();
        for (class, colour) in self.inks {
            // Writing to a String cannot fail.
            let _ = write!(css, ".plot .{class}{{color:{colour}}}");
        }
        let Theme { paper, text, faint, grid, frame, .. } = self;
        let _ = write!(
            css,
            ".plot .paper{{fill:{paper}}}.plot text{{fill:{text}}}.plot .tick text,.plot .far{{fill:{faint}}}\
             .plot .grid path{{stroke:{grid}}}.plot .frame{{stroke:{frame}}}.plot .halo{{stroke:{paper}}}.plot .word.im{{fill:{faint}}}"
        );
        css
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Relative luminance of sRGB, WCAG 2.2.
    fn luminance(colour: &str) -> f64 {
        let part = |k: usize| {
            let c = f64::from(u8::from_str_radix(&colour[k..k + 2], 16).unwrap()) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
    }

    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn words_reach_a_contrast_of_four_and_a_half_and_lines_of_three() {
        // The limits of WCAG 2.2, success criteria 1.4.3 and 1.4.11; grey data have grey words of their own.
        for theme in [&LIGHT, &DARK] {
            for (class, colour) in theme.inks {
                let wanted = if class == "im" { 3.0 } else { 4.5 };
                assert!(contrast(colour, theme.paper) >= wanted, "{class} {colour}");
            }
            assert!(contrast(theme.text, theme.paper) >= 4.5 && contrast(theme.faint, theme.paper) >= 4.5);
        }
        // Closed form: black on white is 21.
        assert!((contrast("#000000", "#ffffff") - 21.0).abs() < 1e-9);
    }
}
