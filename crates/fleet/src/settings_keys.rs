//! The keys of FLEET.toml. Reader: [`super::FleetFile`].

use super::MOST_CANDIDATES;
use servotune::document::{End, FileKey as Key, KeyFile, KeyKind, KeyTable, Need, Range};

const TOP: &[Key] = &[
    Key::table("input", "where the slots are"),
    Key::path("gate", "gate.json; without one every slot is judged by its loop").or_none(),
    Key::path("spec", "what every slot must reach"),
    Key::path("controller", "gains of slots that name none"),
    Key::path("store", "the store").or_else("beside the results"),
    Key::table("robust", "how sure a slot must be").or_toml("{}"),
    Key::table("temperature", "temperatures that a table must stand").or_toml("{}"),
    Key::table("tables", "shared tables").or_toml("{}"),
    Key::table("untunable", "explanation of slots that no table serves").or_toml("{}"),
];

const INPUT: &[Key] = &[
    Key::path("tree", "folders T001/slots/S01").need(Need::Unless(&["table", "twin"])),
    Key::path("table", "CSV or Parquet").need(Need::Unless(&["tree", "twin"])),
    Key::table("twin", "made-up slots").need(Need::Unless(&["tree", "table"])),
    Key::new("hold_included", KeyKind::Bool, "", "whether the sweeps contain the hold").or_toml("false"),
];

const TWIN: &[Key] = &[
    Key::integer("slots", "", "sixteen to a tester").within(1.0, 16_777_215.0),
    Key::integer("seed", "", "fixes every draw").or(1.0),
    Key::integer("run", "", "which measurement of the floor").or(0.0).within(0.0, 65_535.0),
];

const ROBUST: &[Key] = &[
    Key::integer("draws", "", "plants of the model's covariance that must pass").or(2.0).within(0.0, 64.0),
    Key::integer("seed", "", "of those draws").or(1.0),
    Key::number("guard", "", "share of each limit kept clear of")
        .or(0.01)
        .takes(Range::Between(End::With(0.0), End::Without(0.5))),
];

const RELATIVE: Range = Range::Size(0.0, 0.02);

const TEMPERATURE: &[Key] = &[
    Key::new("cases_c", KeyKind::Numbers, "deg C", "temperatures of the base").or_toml("[]").within(-100.0, 200.0),
    Key::number("measured_c", "deg C", "where a slot names none").or(24.0).within(-100.0, 200.0),
    Key::number("gain_per_c", "1/K", "relative change of the gain").or(0.0).takes(RELATIVE),
    Key::number("frequency_per_c", "1/K", "relative change of every natural frequency").or(0.0).takes(RELATIVE),
    Key::number("delay_per_c", "s/K", "change of the dead time").or(0.0).takes(Range::Size(0.0, 1e-5)),
];

const TABLES: &[Key] = &[
    Key::integer("pilots", "", "slots tuned in full first").or(32.0).at_least(1.0),
    Key::integer("scouts", "", "slots on which shared tables are grown").or(192.0).within(0.0, 4096.0),
    Key::integer("candidates", "", "candidates for shared tables")
        .or(20.0)
        .within(1.0, MOST_CANDIDATES as f64)
        .also("at least `most`"),
    Key::integer("most", "", "shared tables at most").or(12.0).at_least(1.0).also("at most `candidates`"),
    Key::number("coverage", "", "share of slots at which fewer tables are enough")
        .or(0.99)
        .takes(Range::Between(End::Without(0.0), End::With(1.0))),
];

const UNTUNABLE: &[Key] = &[
    Key::integer("explained", "", "slots explained in full").or(200.0),
    Key::number("largest_change", "", "largest factor looked at").or(4.0).within(1.01, 100.0),
];

/// The keys of FLEET.toml.
pub const FLEET_KEYS: KeyFile = KeyFile {
    name: "FLEET.toml",
    about: "What they do: `specs/fleet.md`.\n",
    base: None,
    tables: &[
        KeyTable { heading: "", keys: TOP },
        KeyTable { heading: "[input]", keys: INPUT },
        KeyTable { heading: "[input.twin]", keys: TWIN },
        KeyTable { heading: "[robust]", keys: ROBUST },
        KeyTable { heading: "[temperature]", keys: TEMPERATURE },
        KeyTable { heading: "[tables]", keys: TABLES },
        KeyTable { heading: "[untunable]", keys: UNTUNABLE },
    ],
};
