//! The only place where numbers become text or pictures: tables, plots, pages.
//!
//! In: plain columns and words. Out: [`table::Table`] as HTML or aligned text, [`figure::Figure`] as SVG or as part of
//! a page, [`page::Page`] as one HTML file that needs nothing else. Convention: every number has its unit beside it;
//! every text from outside is escaped. Spec: `specs/report.md`.

mod diagnosis_chance;
pub mod diagnosis_curve;
mod diagnosis_error;
mod diagnosis_law;
mod diagnosis_place;
mod diagnosis_rules;
mod diagnosis_shown;
mod diagnosis_tables;
mod error;
mod escape;
mod extent;
mod html;
mod layout;
mod limit_cards;
mod marks;
mod palette;
mod proven_limit;
mod proven_room;
mod text_width;
mod ticks;
mod view;
mod words;

pub mod bode;
pub mod boxplot;
pub mod budget;
pub mod budget_page;
pub mod certificate;
pub mod certificate_page;
pub mod classified;
pub mod confusion;
pub mod cumulative;
pub mod curve;
pub mod diagnosis;
pub mod disturbed;
pub mod figure;
pub mod fleet;
pub mod histogram;
pub mod identified;
pub mod loop_view;
pub mod margins;
pub mod move_end;
pub mod number;
pub mod nyquist;
pub mod overlay;
pub mod page;
pub mod pareto;
pub mod pes;
pub mod physical;
pub mod routes;
pub mod sampled;
pub mod sensitivity;
pub mod simulated;
pub mod slot;
pub mod spectrum_bars;
pub mod steps;
pub mod svg;
pub mod table;
pub mod time;
pub mod trained;
pub mod tuned;
pub mod workflow;
pub mod write;

pub use error::ReportError;
pub use figure::Figure;
pub use page::Page;
pub use table::Table;
