//! Colours, in light and in dark, that stay apart for colour-blind readers.
//!
//! In: the meaning of a colour ([`Ink`]). Out: class names and style rules. The six data colours follow the palette of
//! Okabe and Ito, "Color Universal Design" (2008); the dark set is the same hues, lighter. Colour is never the only
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
        ("i1", "#d55e00"),
        ("i2", "#00875f"),
        ("i3", "#a6508a"),
        ("i4", "#9a7200"),
        ("i5", "#3d8fc4"),
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
        ("i4", "#e6b93d"),
        ("i5", "#9ad2f5"),
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
             .plot .grid path{{stroke:{grid}}}.plot .frame{{stroke:{frame}}}.plot .halo{{stroke:{paper}}}"
        );
        css
    }
}
