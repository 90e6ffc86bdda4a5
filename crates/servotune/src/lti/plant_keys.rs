//! The keys of plant.toml. Readers: [`super::PlantFile`], [`super::Plant::check`].

use super::rational::MOST;
use crate::document::size_limits::{DAMPING, PLANT_MODES, PLANT_RAD_S, VALUE};
use crate::document::{End, FileKey as Key, KeyFile, KeyKind, KeyTable, Need, Range};

const TOP: &[Key] = &[
    Key::of_text("position_unit", "unit of position"),
    Key::of_text("command_unit", "unit of the command"),
    Key::table("plant", "the model"),
];

const FREE: Need = Need::Where("free inertia");
const SECOND_ORDER: Need = Need::Where("body of second order");
const ROOTS: Need = Need::Where("poles and zeros");
const COEFFICIENTS: Need = Need::Where("coefficients");
const STATES: Need = Need::Where("state space");
const SIZE: Range = Range::Size(VALUE[0], VALUE[1]);
const DAMPED: Range = Range::Between(End::Without(0.0), End::With(DAMPING));

const PLANT: &[Key] = &[
    Key::number("dc_gain", "pos/cmd", "position at rest per command, of the body alone").need(SECOND_ORDER).takes(SIZE),
    Key::number("acceleration_gain", "pos/s²/cmd", "acceleration per command").need(FREE).takes(SIZE),
    Key::number("natural_frequency_rad_s", "rad/s", "of the body")
        .need(Need::Where("either body"))
        .within(0.0, PLANT_RAD_S[1])
        .also("0 is a free inertia, and above 0 it is from 1e-4"),
    Key::number("damping_ratio", "", "of the body").need(SECOND_ORDER).takes(DAMPED),
    Key::number("viscous_rate_per_s", "1/s", "viscous friction over inertia").need(FREE).within(0.0, PLANT_RAD_S[1]),
    Key::number("gain", "pos/s^r/cmd", "P s^r far above every root, r poles more than zeros")
        .need(ROOTS)
        .takes(Range::NotZero),
    Key::new("zeros_rad_s", KeyKind::Roots, "rad/s", "zeros").or_toml("[]").also("fewer than poles"),
    Key::new("zeros_hz", KeyKind::Roots, "Hz", "the same in Hz").or_toml("[]").also("fewer than poles"),
    Key::new("poles_rad_s", KeyKind::Roots, "rad/s", "poles").need(ROOTS).items(1, MOST),
    Key::new("poles_hz", KeyKind::Roots, "Hz", "the same in Hz").need(ROOTS).items(1, MOST),
    Key::new("numerator", KeyKind::Numbers, "", "highest power of s first").need(COEFFICIENTS).also("not all 0"),
    Key::new("denominator", KeyKind::Numbers, "", "highest power of s first").need(COEFFICIENTS).also("not all 0"),
    Key::new("a", KeyKind::Matrix, "1/s", "rows of A").need(STATES),
    Key::new("b", KeyKind::Vector, "", "B").need(STATES),
    Key::new("c", KeyKind::Vector, "", "C").need(STATES),
    Key::new("d", KeyKind::NumberOrMatrix, "", "D: a plant answers no command at once").or(0.0).within(0.0, 0.0),
    Key::new("lag_rad_s", KeyKind::Numbers, "rad/s", "factors 1/(1 + s/w) beside any form").or_toml("[]").above(0.0),
    Key::new("lag_hz", KeyKind::Numbers, "Hz", "the same in Hz").or_toml("[]").above(0.0),
    Key::new("lead_rad_s", KeyKind::Numbers, "rad/s", "factors 1 + s/w; below 0: a zero right of the axis")
        .or_toml("[]")
        .takes(Range::NotZero),
    Key::new("lead_hz", KeyKind::Numbers, "Hz", "the same in Hz").or_toml("[]").takes(Range::NotZero),
    Key::number("delay_s", "s", "dead time, computation included").at_least(0.0),
    Key::number("resonance_gain", "", "factor of the whole").or(1.0).takes(SIZE),
    Key::tables("residue", "form of residues").need(Need::Where("residues")).items(1, usize::MAX),
    Key::tables("modes", "resonance pairs beside a body").or_toml("[]").items(0, PLANT_MODES),
    Key::tables("physics", "effects beyond linear: `effect` and its parameters, `specs/effects.md`").or_toml("[]"),
];

const MODES: &[Key] = &[
    Key::number("zero_rad_s", "rad/s", "anti-resonance ωz").within(PLANT_RAD_S[0], PLANT_RAD_S[1]),
    Key::number("zero_damping_ratio", "", "ζz; below 0: right of the axis").takes(Range::Size(0.0, DAMPING)),
    Key::number("pole_rad_s", "rad/s", "resonance ωp").within(PLANT_RAD_S[0], PLANT_RAD_S[1]),
    Key::number("pole_damping_ratio", "", "ζp").takes(DAMPED),
];

const RESIDUE: &[Key] = &[
    Key::number("gain", "pos/s²/cmd", "of either sign").takes(Range::NotZero),
    Key::number("frequency_rad_s", "rad/s", "ω; 0: the rigid body").need(Need::Unless(&["frequency_hz"])).at_least(0.0),
    Key::number("frequency_hz", "Hz", "the same in Hz").need(Need::Unless(&["frequency_rad_s"])).at_least(0.0),
    Key::number("damping_ratio", "", "ζ")
        .need(Need::Where("frequency above 0"))
        .above(0.0)
        .also("0 or absent beside a frequency of 0"),
];

/// The keys of plant.toml.
pub const PLANT_KEYS: KeyFile = KeyFile {
    name: "plant.toml",
    about: "P(s) = `resonance_gain` e^(-`delay_s` s) R(s) M(s) Π(1 + s/lead)/Π(1 + s/lag), position over command.

- R(s) is the rational part. It is given by the keys of one form; keys of two forms are refused by name.
- M(s) = Π (s² + 2 ζz ωz s + ωz²)/(s² + 2 ζp ωp s + ωp²) over `[[plant.modes]]`, each with a gain of 1 far above its frequencies.
- Frequencies are rad/s, or Hz where the key ends in `_hz`; both of one key are refused. s is rad/s always.
- The model is continuous and holds no hold. Loops with a controller sample it exactly behind a zero-order hold, at `sample_time_s` of the controller, with the whole dead time.
- A root is a number, or `[real part, imaginary part]`. Lists of roots and what is refused of them: `specs/files.md`, \"plant.toml\".

| form | keys of `[plant]` | R(s) |
|---|---|---|
| body of second order | `dc_gain`, `natural_frequency_rad_s` = ω0 above 0, `damping_ratio` = ζ0 | dc_gain ω0²/(s² + 2 ζ0 ω0 s + ω0²) |
| free inertia | `acceleration_gain`, `natural_frequency_rad_s = 0`, `viscous_rate_per_s` | acceleration_gain/(s² + viscous_rate s) |
| poles and zeros | `gain`, `poles_rad_s`, `zeros_rad_s` (or `poles_hz`, `zeros_hz`) | gain Π(s - z)/Π(s - p), s in rad/s in either unit |
| coefficients | `numerator`, `denominator` | numerator(s)/denominator(s) |
| state space | `a`, `b`, `c`; `d` absent or 0 | c (s - a)⁻¹ b |
| residues | `[[plant.residue]]` with ω in rad/s | Σ gain/(s² + 2 ζ ω s + ω²) |
",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[plant]", keys: PLANT },
        KeyTable { heading: "[[plant.modes]]", keys: MODES },
        KeyTable { heading: "[[plant.residue]]", keys: RESIDUE },
    ],
};
