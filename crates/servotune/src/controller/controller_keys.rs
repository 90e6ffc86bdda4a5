//! The keys of controller.toml. Reader: [`super::Controller`].

use super::Feedforward;
use crate::document::size_limits::{DAMPING, FILTER_DAMPING, VALUE};
use crate::document::{End, FileKey as Key, KeyFile, KeyTable, Range};

const TOP: &[Key] = &[
    Key::number("sample_time_s", "s", "the controller's clock T").above(0.0),
    Key::number("output_limit", "cmd", "the command is clipped to this size").or_none().above(0.0),
    Key::table("pid", "gains"),
    Key::tables("lowpass", "low-passes, in the order they run").or_toml("[]"),
    Key::tables("notch", "notches, behind the low-passes").or_toml("[]"),
    Key::tables("biquad", "the user's own sections, behind the notches; no search changes them").or_toml("[]"),
    Key::table("feedforward", "from the reference").or_none(),
];

const PID: &[Key] = &[
    Key::number("kp", "cmd/pos", "proportional gain").takes(Range::Size(0.0, VALUE[1])),
    Key::number("ki_per_s", "cmd/pos/s", "integral gain").or(0.0).within(0.0, VALUE[1]),
    Key::number("kd_s", "cmd s/pos", "derivative gain").or(0.0).within(0.0, VALUE[1]),
    Key::number("derivative_filter_s", "s", "time constant of the derivative's filter").or(0.0).at_least(0.0),
];

const NYQUIST: &str = "below half the sample rate";

const LOWPASS: &[Key] = &[
    Key::number("frequency_hz", "Hz", "corner").above(0.0).also(NYQUIST),
    Key::number("damping_ratio", "", "of its poles").within(FILTER_DAMPING, DAMPING),
];

const NOTCH: &[Key] = &[
    Key::number("frequency_hz", "Hz", "centre").above(0.0).also(NYQUIST),
    Key::number("zero_damping_ratio", "", "depth is this over the next").within(0.0, DAMPING),
    Key::number("pole_damping_ratio", "", "width").within(FILTER_DAMPING, DAMPING),
];

const COEFFICIENT: Range = Range::Size(0.0, VALUE[1]);
const STABLE: &str = "poles within the unit circle";

const BIQUAD: &[Key] = &[
    Key::number("b0", "", "(b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²)").takes(COEFFICIENT),
    Key::number("b1", "", "").takes(COEFFICIENT),
    Key::number("b2", "", "").takes(COEFFICIENT).also("not all three 0"),
    Key::number("a1", "", "").takes(Range::Between(End::Without(-2.0), End::Without(2.0))).also(STABLE),
    Key::number("a2", "", "").takes(Range::Between(End::Without(-1.0), End::Without(1.0))).also(STABLE),
];

const FEEDFORWARD: &[Key] = &[
    Key::number("factor", "", "scales both terms").or(0.0),
    Key::number("velocity_s", "cmd s/pos", "command per speed of the reference").or(0.0),
    Key::number("acceleration_s2", "cmd s²/pos", "command per acceleration of the reference").or(0.0),
    Key::integer("ahead_samples", "", "both are those of the reference so many samples later")
        .or(0.0)
        .within(0.0, Feedforward::MOST_AHEAD as f64),
];

/// The keys of controller.toml.
pub const CONTROLLER_KEYS: KeyFile = KeyFile {
    name: "controller.toml",
    about: "What the firmware runs, as formulas: `specs/conventions.md`.\n",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[pid]", keys: PID },
        KeyTable { heading: "[[lowpass]]", keys: LOWPASS },
        KeyTable { heading: "[[notch]]", keys: NOTCH },
        KeyTable { heading: "[[biquad]]", keys: BIQUAD },
        KeyTable { heading: "[feedforward]", keys: FEEDFORWARD },
    ],
};
