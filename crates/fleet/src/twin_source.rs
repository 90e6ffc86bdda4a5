//! The made-up floor as a source of slots: each is drawn when it is asked for, and nothing is kept.

use super::{Loaded, SlotName, SlotSource, TwinInput};
use servotune::document::sha256_hex;
use servotune::twin::fleet::FleetSettings;

/// Slots of a made-up floor.
#[derive(Clone, Debug)]
pub struct TwinSource {
    settings: FleetSettings,
    slots: usize,
}

impl TwinSource {
    /// The floor of `[input.twin]` in FLEET.toml.
    pub fn of(input: &TwinInput) -> TwinSource {
        let slots = FleetSettings::default().slots;
        let testers = input.slots.div_ceil(slots);
        TwinSource { settings: FleetSettings { seed: input.seed, testers, slots, run: input.run }, slots: input.slots }
    }
}

impl SlotSource for TwinSource {
    fn count(&self) -> usize {
        self.slots
    }

    fn name(&self, index: usize) -> SlotName {
        let (tester, slot) = (index / self.settings.slots + 1, index % self.settings.slots + 1);
        SlotName { tester: format!("T{tester:03}"), slot: format!("S{slot:02}") }
    }

    fn load(&self, index: usize) -> Loaded {
        let s = &self.settings;
        match s.slot(index) {
            Ok(slot) => {
                let mut machine = slot.machine.record;
                // Nobody has told the gate what it is.
                machine.label = None;
                let words = format!("twin {} {} {index} {:?}", s.seed, s.run, machine.response);
                Loaded {
                    controller: Some(slot.machine.truth.controller),
                    controller_text: None,
                    temperature_c: Some(slot.temperature_c),
                    problems: Vec::new(),
                    digest: sha256_hex(words.as_bytes()),
                    machine,
                }
            }
            Err(e) => Loaded { problems: vec![e.to_string()], ..Loaded::default() },
        }
    }
}
