//! The keys of spec.toml. Reader: [`super::Spec`].

use super::spec::{FILTERS, GUARD};
use crate::document::{End, FileKey as Key, KeyFile, KeyKind, KeyTable, Need, Range};

const TOP: &[Key] = &[
    Key::path("profile", "the move; needed by limits and objectives of a write").or_none(),
    Key::number("sample_time_s", "s", "clock of the controller to be found").or_else("the controller's").above(0.0),
    Key::number("guard", "", "relative room that every limit keeps")
        .or(GUARD)
        .takes(Range::Between(End::With(0.0), End::Without(0.5))),
    Key::table("objective", "what is made smallest").or_toml("{}"),
    Key::table("disturbance", "acts at the plant's input").or_none(),
    Key::table("margins", "limits on the loop").or_toml("{}"),
    Key::table("limits", "limits on curves, PES, step, command").or_toml("{}"),
    Key::table("structure", "form of the controller").or_toml("{}"),
    Key::table("search", "filters and ranges").or_toml("{}"),
];

const OBJECTIVE: &[Key] = &[
    Key::new(
        "minimise",
        KeyKind::Choice(&["pes_rms", "dft", "disturbance", "bandwidth", "integral", "room"]),
        "",
        "`specs/tuning.md`",
    )
    .or_else("`pes_rms` with a profile, `disturbance` without"),
    Key::new("bands_hz", KeyKind::Pairs, "Hz", "bands of `dft`; of `dft_low` the first, of `dft_high` the second")
        .or_toml("[[600, 1500], [1500, 3000]]")
        .above(0.0)
        .items(1, 8),
];

const DISTURBANCE: &[Key] = &[
    Key::number("rms", "cmd", "of first-order coloured noise").need(Need::Where("without `psd`")).above(0.0),
    Key::number("corner_hz", "Hz", "its corner").need(Need::Where("without `psd`")).above(0.0),
    Key::path("psd", "file with `frequency_hz` and a one-sided density, cmd²/Hz").need(Need::Where("without the two")),
];

const MARGINS: &[Key] = &[
    Key::number("phase_margin_deg", "deg", "at least")
        .or_none()
        .takes(Range::Between(End::Without(0.0), End::Without(180.0))),
    Key::number("gain_margin_db", "dB", "at least").or_none().above(0.0),
    Key::number("max_sensitivity", "", "at most").or_none().above(1.0),
    Key::new("gain_crossover_hz", KeyKind::Pair, "Hz", "every gain crossing lies inside").or_none().above(0.0),
    Key::number("bandwidth_hz", "Hz", "at least: -3 dB of T").or_none().above(0.0),
    Key::new("phase_stabilised_hz", KeyKind::Pairs, "Hz", "there too |L| may cross 1").or_toml("[]").above(0.0),
];

const LIMITS: &[Key] = &[
    Key::number("dft_low", "pos", "norm over the first band, at most").or_none().above(0.0),
    Key::number("dft_high", "pos", "norm over the second band, at most").or_none().above(0.0),
    Key::tables("harmonics", "single harmonics, at most").or_toml("[]"),
    Key::number("command_peak", "cmd", "over the whole write, at most").or_none().above(0.0),
    Key::number("command_rms", "cmd", "at most").or_none().above(0.0),
    Key::number("overshoot_percent", "%", "of a step of the reference, at most").or_none().above(0.0),
    Key::number("settling_s", "s", "to within 2 % of the step, at most").or_none().above(0.0),
    Key::table("move", "the position without noise at the end of the profile's move").or_toml("{}"),
    Key::tables("curve", "limits over frequency").or_toml("[]"),
];

const MOVE: &[Key] = &[
    Key::number("overshoot", "pos", "beyond the end of the move, at most").or_none().above(0.0),
    Key::number("settling_s", "s", "from the end of the reference's move until the error stays within `band`, at most")
        .need(Need::Where("beside `band`"))
        .above(0.0)
        .also("within the record"),
    Key::number("band", "pos", "the error within which it has settled")
        .need(Need::Where("beside `settling_s`"))
        .above(0.0),
];

const HARMONICS: &[Key] = &[
    Key::integer("k", "", "harmonic of the window")
        .at_least(1.0)
        .also("at most half the samples of the window, each once"),
    Key::number("amplitude", "pos", "at most").above(0.0),
];

const CURVE: &[Key] = &[
    Key::new("of", KeyKind::Choice(&["L", "S", "T", "PS", "CS"]), "", "magnitude that is limited"),
    Key::new("side", KeyKind::Choice(&["at_most", "at_least"]), "", "which side is good"),
    Key::new("hz", KeyKind::Numbers, "Hz", "points").above(0.0).items(2, usize::MAX).also("rising"),
    Key::new("db", KeyKind::Numbers, "dB", "level at each, straight between").also("as many"),
];

const FOUND: f64 = FILTERS as f64;

const STRUCTURE: &[Key] = &[
    Key::new("controller", KeyKind::Choice(&["pid", "pi", "p_pi", "lead"]), "", "form").or_toml("\"pid\""),
    Key::new("derivative_filter_s", KeyKind::NumberOrPair, "s", "a number is fixed, [from, to] is searched")
        .or_else("the start's, else 0.3 sample times, searched where no table with that meets the limits")
        .at_least(0.0)
        .also("[from, to] above 0"),
    Key::integer("peaks", "", "peak filters at run-out orders").or(0.0).within(0.0, FOUND),
    Key::new("feedforward", KeyKind::Bool, "", "set to the profile's move").or_toml("false"),
];

const SEARCH: &[Key] = &[
    Key::integer("seed", "", "fixes every start").or(0.0),
    Key::integer("notches", "", "notches that are set").or(0.0).within(0.0, FOUND),
    Key::integer("lowpasses", "", "low-passes that are set").or(0.0).within(0.0, FOUND),
    Key::table("bounds", "ranges; from = to fixes a number").or_toml("{}"),
];

const OFF: &str = "from above 0, or [0, 0]: none";
const SCALED: &str = "scaled from the plant";
const RATE: &str = "up to 0.45 of the sample rate";

const BOUNDS: &[Key] = &[
    Key::new("kp", KeyKind::Pair, "cmd/pos", "proportional gain").or_else(SCALED).above(0.0),
    Key::new("ki_per_s", KeyKind::Pair, "cmd/pos/s", "integral gain").or_else(SCALED).at_least(0.0).also(OFF),
    Key::new("kd_s", KeyKind::Pair, "cmd s/pos", "derivative gain").or_else(SCALED).at_least(0.0).also(OFF),
    Key::new("lowpass_hz", KeyKind::Pair, "Hz", "corners").or_else(RATE).above(0.0),
    Key::new("notch_hz", KeyKind::Pair, "Hz", "centres").or_else(RATE).above(0.0),
];

/// The keys of spec.toml.
pub const SPEC_KEYS: KeyFile = KeyFile {
    name: "spec.toml",
    about: "What each limit is judged on: `specs/tuning.md`.\n",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[objective]", keys: OBJECTIVE },
        KeyTable { heading: "[disturbance]", keys: DISTURBANCE },
        KeyTable { heading: "[margins]", keys: MARGINS },
        KeyTable { heading: "[limits]", keys: LIMITS },
        KeyTable { heading: "[limits.move]", keys: MOVE },
        KeyTable { heading: "[[limits.harmonics]]", keys: HARMONICS },
        KeyTable { heading: "[[limits.curve]]", keys: CURVE },
        KeyTable { heading: "[structure]", keys: STRUCTURE },
        KeyTable { heading: "[search]", keys: SEARCH },
        KeyTable { heading: "[search.bounds]", keys: BOUNDS },
    ],
};
