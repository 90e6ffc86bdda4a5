//! The keys of profile.toml. Reader: [`super::Profile`].

use crate::document::{FileKey as Key, KeyFile, KeyKind, KeyTable, Range};

const TOP: &[Key] = &[
    Key::table("spiral", "the move"),
    Key::table("pes", "servo clock and window"),
    Key::table("noise", "disturbances").or_toml("{}"),
];

const SPIRAL: &[Key] = &[
    Key::number("velocity", "pos/s", "its sign is the direction").takes(Range::NotZero),
    Key::number("distance", "pos", "length of the move").above(0.0),
    Key::number("acceleration_time_s", "s", "to that speed, and the same to stop").above(0.0),
    Key::number("start_s", "s", "the reference is 0 until then").or(0.0).at_least(0.0).also("before `duration_s`"),
    Key::number("duration_s", "s", "length of the record")
        .above(0.0)
        .also("beyond `start_s`, with at most 2 million servo samples"),
];

const PES: &[Key] = &[
    Key::number("sample_rate_hz", "Hz", "servo clock").above(0.0),
    Key::new("window", KeyKind::Integers, "samples", "first included, last not, counted from `start_s`")
        .also("first below last, within the record"),
];

const NOISE: &[Key] = &[
    Key::number("encoder_rms", "pos", "white, per controller sample").or(0.0).at_least(0.0),
    Key::number("windage_rms", "cmd", "at the plant's input, first-order coloured").or(0.0).at_least(0.0),
    Key::number("windage_corner_hz", "Hz", "its corner").or(0.0).at_least(0.0).also("above 0 beside windage"),
    Key::number("spindle_hz", "Hz", "spindle speed").or(0.0).at_least(0.0).also("above 0 beside run-out"),
    Key::tables("runout", "added to the PES at the head").or_toml("[]"),
    Key::integer("seed", "", "fixes every draw").or(0.0),
];

const RUNOUT: &[Key] = &[
    Key::integer("order", "", "of the spindle speed").within(1.0, u32::MAX as f64),
    Key::number("amplitude", "pos", "of its cosine"),
    Key::number("phase_deg", "deg", "of its cosine").or(0.0),
];

/// The keys of profile.toml.
pub const PROFILE_KEYS: KeyFile = KeyFile {
    name: "profile.toml",
    about: "",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[spiral]", keys: SPIRAL },
        KeyTable { heading: "[pes]", keys: PES },
        KeyTable { heading: "[noise]", keys: NOISE },
        KeyTable { heading: "[[noise.runout]]", keys: RUNOUT },
    ],
};
