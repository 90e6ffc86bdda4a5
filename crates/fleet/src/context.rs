//! Everything about a run that is the same for every slot.
//!
//! In: a [`Fleet`] file. Out: spec, gate, gains, settings, and the digest that ties results to them.

use super::FleetError;
use super::settings::{Fleet, FleetFile};
use servotune::controller::Controller;
use servotune::document::{parse_toml, read_text, sha256_hex};
use servotune::frf::Hold;
use servotune::gate::Gate;
use servotune::identify::IdentifySettings;
use servotune::tune::{Spec, SpecError, TuneSettings};

/// What every slot's work needs.
#[derive(Clone, Debug)]
pub struct Context {
    /// The document.
    pub file: FleetFile,
    /// What every slot must reach.
    pub spec: Spec,
    /// The same with every limit a guard inside: what searches aim at.
    pub guarded: Spec,
    /// The gains of slots that name none; the shape of every table.
    pub base: Controller,
    /// The text that they were read from.
    pub base_text: String,
    /// The gate.
    pub gate: Option<Gate>,
    /// Whether responses contain the hold.
    pub hold: Hold,
    /// How responses are identified.
    pub identify: IdentifySettings,
    /// How tables are searched from nothing.
    pub search: TuneSettings,
    /// Digests by name: fleet file, spec, profile, controller, gate.
    pub inputs: Vec<(&'static str, String)>,
    /// Digest over all of them and the program's version: results of equal digests are equal.
    pub digest: String,
}

/// Starts of a full search; the library stands for the rest.
const STARTS: usize = 6;

impl Context {
    /// Reads everything that the document names.
    pub fn of(fleet: &Fleet) -> Result<Context, FleetError> {
        let f = &fleet.file;
        // The fleet keeps a guard of its own (`robust.guard`), over every case.
        let spec = Spec::read(&f.spec)?.unguarded();
        let profile = Spec::profile_path(&f.spec)?.ok_or(SpecError::NeedsProfile { what: "a fleet" })?;
        let text = read_text(&f.controller)?;
        let base: Controller = parse_toml(&f.controller, &text)?;
        base.check()?;
        let mut inputs = vec![
            ("fleet", fleet.sha256.clone()),
            ("spec", sha256_hex(read_text(&f.spec)?.as_bytes())),
            ("profile", sha256_hex(read_text(&profile)?.as_bytes())),
            ("controller", sha256_hex(text.as_bytes())),
        ];
        let gate = match &f.gate {
            Some(file) => {
                let text = read_text(file)?;
                inputs.push(("gate", sha256_hex(text.as_bytes())));
                Some(Gate::parse(file, &text)?)
            }
            None => None,
        };
        let mut words = format!("{}\n", env!("CARGO_PKG_VERSION"));
        inputs.iter().for_each(|(name, sha256)| words += &format!("{name} {sha256}\n"));
        Ok(Context {
            guarded: Spec { guard: f.robust.guard, ..spec.clone() },
            hold: Hold::of(f.input.hold_included.then_some(base.sample_time_s)),
            identify: IdentifySettings::default(),
            search: TuneSettings { sample_time_s: Some(base.sample_time_s), starts: STARTS, ..TuneSettings::default() },
            digest: sha256_hex(words.as_bytes()),
            file: f.clone(),
            spec,
            base,
            base_text: text,
            gate,
            inputs,
        })
    }
}
