//! Studies: every table and picture in `results/`, made again by `lab NAME --out results`.
//!
//! In: built-in machines, seeds, and where a study needs them measured records. Out: a [`Study`], pages and pictures as text.
//! Nothing is written here but by the studies that run the program as other processes; `main` does it for the rest.

mod abroad;
mod abroad_records;
mod certificate;
mod certificate_loops;
mod certificate_mutations;
mod certificate_sweeps;
mod certificate_write;
mod classes;
mod error;
mod false_alarms;
mod false_alarms_page;
mod false_alarms_said;
mod fleet_kills;
mod fleet_reliability;
mod fleet_study;
mod foreign;
mod foreign_case;
mod foreign_scale;
mod foreign_stage;
mod foreign_trial;
mod free_form;
mod gate;
mod gate_seeds;
mod hdd;
mod ladder;
mod line;
mod measured;
mod mirror;
mod mirror_inputs;
mod mismatch;
mod motor;
pub mod mutation;
mod plants;
mod prediction;
mod reached;
mod reader_mutations;
mod readers;
mod recordings;
mod recordings_page;
mod reliability_readers;
mod sealed;
mod sealed_draw;
mod sealed_folder;
mod sealed_page;
mod sealed_row;
pub mod study_identify;

pub use abroad::abroad;
pub use certificate::certificate;
pub use certificate_write::certificate_write;
pub use classes::classes;
pub use error::StudyError;
pub use false_alarms::{false_alarm_line, false_alarms, false_alarms_of_lines};
pub use fleet_kills::kills;
pub use fleet_reliability::reliability;
pub use fleet_study::{floor, scale, shared};
pub use free_form::free_form;
pub use gate::gate;
pub use gate_seeds::gate_seeds;
pub use hdd::hdd;
pub use ladder::ladder;
pub use line::line_study;
pub use mirror::mirror;
pub use mirror_inputs::mirror_inputs;
pub use mismatch::mismatch;
pub use motor::motor;
pub use plants::plants;
pub use prediction::prediction;
pub use reached::Reached;
pub use reader_mutations::{Tally, reader_mutations};
pub use recordings_page::recordings;
pub use reliability_readers::readers;
pub use sealed::{SealedCase, digests, sealed, sealed_cases, sealed_of_lines, sealed_set};
pub use sealed_row::{Outcome, Row, outcome};

/// What a study hands over: files by name, relative to the results' folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// Name and content of each file.
    pub files: Vec<(String, String)>,
}

/// Size of the pictures.
const PICTURE: servotune_report::svg::Size = servotune_report::svg::Size::WIDE;

impl Study {
    fn page(&mut self, name: &str, text: String) {
        self.files.push((name.to_owned(), text));
    }

    fn picture(&mut self, name: &str, figure: &servotune_report::Figure) {
        self.files.push((format!("figures/{name}.svg"), servotune_report::svg::standalone(figure, PICTURE)));
    }
}
