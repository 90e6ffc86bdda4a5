//! What a push from outside into one record is called.

use super::finding::{Estimate, Finding, Where};
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::shock::DetectedShock;
use crate::physics::{Facts, shock};
use std::collections::BTreeMap;

impl DetectedShock {
    /// The finding, in a machine with these units.
    pub(in crate::diagnose) fn finding(&self, runs: &[Run], command_unit: &str) -> Finding {
        let &Facts { name: effect, says, port, .. } = &shock::FACTS;
        let number = |value: f64, off: f64, unit: &str| Estimate {
            value,
            low: value - off,
            high: value + off,
            unit: unit.into(),
        };
        let name = &runs[self.run].name;
        Finding {
            effect: effect.into(),
            family: vec![effect.into()],
            port,
            p_value: self.log_p.min(0.0).exp().max(1e-300),
            says: format!(
                "In record {name}, {:.4} s after its start, {says}; its repeats do not show it.",
                self.time_s
            ),
            parameters: BTreeMap::from([
                ("peak_command".to_owned(), number(self.peak[0], 1.96 * self.peak[1], command_unit)),
                ("time_s".to_owned(), number(self.time_s, 0.5 * self.width_s, "s")),
                ("width_s".to_owned(), number(self.width_s, 0.5 * self.width_s, "s")),
            ]),
            place: Where {
                records: vec![name.clone()],
                time_s: vec![[self.time_s, self.time_s + self.width_s]],
                velocity_sign: "both",
                ..Where::default()
            },
        }
    }
}
