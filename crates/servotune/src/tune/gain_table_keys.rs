//! The keys of gains.toml beside those of controller.toml. Reader: [`super::GainTable`].

use crate::controller::CONTROLLER_KEYS;
use crate::document::{FileKey as Key, KeyFile, KeyKind, KeyTable};

const TOP: &[Key] = &[
    Key::of_text("position_unit", "unit of position").or_none(),
    Key::of_text("command_unit", "unit of the command").or_none(),
    Key::tables("section", "what the firmware runs: PID, low-passes, notches, own sections"),
    Key::table("before", "figures of the start controller").or_none(),
    Key::table("after", "figures of this controller"),
    Key::table("provenance", "where it came from"),
];

/// The reader makes every section from the gains once more.
const OF_GAINS: &str = "that of the gains, to 1e-12";

const SECTION: &[Key] = &[
    Key::number("b0", "", "(b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²)").also(OF_GAINS),
    Key::number("b1", "", "").also(OF_GAINS),
    Key::number("b2", "", "").also(OF_GAINS),
    Key::number("a1", "", "").also(OF_GAINS),
    Key::number("a2", "", "").also(OF_GAINS),
];

const SUMMARY: &[Key] = &[
    Key::new("stable", KeyKind::Bool, "", "whether the loop is stable"),
    Key::number("phase_margin_deg", "deg", "smallest").or_none(),
    Key::number("gain_crossover_hz", "Hz", "where that is").or_none(),
    Key::number("gain_margin_db", "dB", "smallest").or_none(),
    Key::number("phase_crossover_hz", "Hz", "where that is").or_none(),
    Key::number("max_sensitivity", "", "largest |S|"),
    Key::number("max_sensitivity_hz", "Hz", "where that is"),
    Key::number("modulus_margin", "", "its inverse"),
    Key::number("delay_margin_s", "s", "smallest").or_none(),
    Key::number("disk_margin", "", "of S - T"),
    Key::number("dft_low", "pos", "norm over the first band").or_none(),
    Key::number("dft_high", "pos", "norm over the second band").or_none(),
    Key::number("command_peak", "cmd", "over the whole write").or_none(),
    Key::tables("gain_crossings", "every one").or_toml("[]"),
    Key::tables("phase_crossings", "every one").or_toml("[]"),
];

const CROSSING: &[Key] =
    &[Key::number("hz", "Hz", "where"), Key::number("value", "deg or dB", "phase margin, or gain margin")];

const PROVENANCE: &[Key] = &[
    Key::of_text("program", "version of the program"),
    Key::new("route", KeyKind::Choice(&["model", "response", "physics"]), "", "what it was tuned on"),
    Key::new("feasible", KeyKind::Bool, "", "whether every limit is met"),
    Key::integer("seed", "", "of the search"),
    Key::integer("evaluations", "", "candidates scored"),
    Key::of_text("spec_sha256", "digest of spec.toml"),
    Key::of_text("gate_class", "class that the gate gave the machine").or_none(),
    Key::of_text("gate_action", "what the gate said to do").or_none(),
    Key::number("gate_probability", "", "of that class").or_none(),
    Key::of_text("gate_override", "why it was tuned all the same").or_none(),
    Key::new("physics", KeyKind::Texts, "", "effects beyond linear that it was tuned with").or_toml("[]"),
    Key::tables("inputs", "every other input"),
];

const INPUT: &[Key] = &[Key::of_text("role", "what it was used as"), Key::of_text("sha256", "digest of its bytes")];

/// The keys of gains.toml.
pub const GAIN_TABLE_KEYS: KeyFile = KeyFile {
    name: "gains.toml",
    about: "All keys of controller.toml, and these; `tune` writes them all. A person who sets gains keeps what stands above `[[section]]`: a controller.\n",
    base: Some(&CONTROLLER_KEYS),
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[[section]]", keys: SECTION },
        KeyTable { heading: "[before]", keys: SUMMARY },
        KeyTable { heading: "[[before.gain_crossings]]", keys: CROSSING },
        KeyTable { heading: "[[before.phase_crossings]]", keys: CROSSING },
        KeyTable { heading: "[after]", keys: SUMMARY },
        KeyTable { heading: "[[after.gain_crossings]]", keys: CROSSING },
        KeyTable { heading: "[[after.phase_crossings]]", keys: CROSSING },
        KeyTable { heading: "[provenance]", keys: PROVENANCE },
        KeyTable { heading: "[[provenance.inputs]]", keys: INPUT },
    ],
};
