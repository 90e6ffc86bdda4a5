//! The keys of case.toml. Reader: [`super::Case`].

use super::case::MOST_INPUTS;
use crate::document::{FileKey as Key, KeyFile, KeyKind, KeyTable};

const TOP: &[Key] = &[
    Key::of_text("id", "name of the case").also("a name (`specs/files.md`, \"Names\")"),
    Key::path("plant", "plant.toml"),
    Key::path("controller", "without one the command is taken as given").or_none(),
    Key::number("spindle_hz", "Hz", "spindle speed").or_none().above(0.0),
    Key::table("noise", "levels of a sound machine").or_toml("{}"),
    Key::new("further_inputs", KeyKind::Texts, "", "further columns of every record that act on its position")
        .or_toml("[]")
        .items(0, MOST_INPUTS)
        .also("each once"),
    Key::tables("records", "the records").items(1, usize::MAX).also("one of them to fit"),
];

const NOISE: &[Key] = &[
    Key::number("encoder_rms", "pos", "white noise of the sensor").or_none().at_least(0.0),
    Key::number("windage_rms", "cmd", "torque noise at the plant's input").or_none().at_least(0.0),
];

const RECORDS: &[Key] = &[
    Key::path("file", "record, CSV, gzip or not"),
    Key::new("role", KeyKind::Choice(&["fit", "holdout"]), "", "holdout is never used for fitting or selection"),
    Key::of_text("repeat_group", "same reference and excitation, other noise").or_none(),
];

/// The keys of case.toml.
pub const CASE_KEYS: KeyFile = KeyFile {
    name: "case.toml",
    about: "",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[noise]", keys: NOISE },
        KeyTable { heading: "[[records]]", keys: RECORDS },
    ],
};
