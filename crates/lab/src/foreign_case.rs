//! The cases of the page away from home: a machine of another make, what acts on it, and what a servo engineer expects.

use super::foreign::{Foreign, Joint, SOUND};
use super::foreign_trial::{Model, Trial};

/// Samples of a record.
const SAMPLES: usize = 4000;

/// One case and what a servo engineer expects.
pub(super) struct Foretold {
    pub id: &'static str,
    pub what: &'static str,
    pub expected: &'static [&'static str],
    pub trial: Trial,
}

/// The cases of the page.
pub(super) fn foretold() -> Vec<Foretold> {
    let trial = |machine: Foreign, model| Trial {
        machine,
        nominal: machine.body,
        model,
        sizes: [0.05, 0.2],
        samples: SAMPLES,
        seed: 0,
    };
    let all = |id, what, expected, machine, model| Foretold { id, what, expected, trial: trial(machine, model) };
    let off = Foreign { body: [1.1e7, 1.6e5, 140.0], ..SOUND };
    let joint = |behind| Foreign { joint: Some(Joint { gap: 0.05, contact_hz: 2400.0, share: 0.15, behind }), ..SOUND };
    let dry = |level| Foreign { bristles: [level, 0.004], ..SOUND };
    let dead = |half| Foreign { dead_band: half, ..SOUND };
    let bearing = Foreign { bearing: [0.05, 3.0], ..SOUND };
    vec![
        all("sound", "nothing", &[], SOUND, Model::Exact),
        Foretold {
            id: "linear_off",
            what: "linear part fitted at another place",
            expected: &[],
            trial: Trial { nominal: SOUND.body, ..trial(off, Model::Exact) },
        },
        all(
            "friction_hidden_1",
            "dry friction 0.05 V, model fitted under it at the small multisine",
            &["coulomb_friction"],
            dry(0.05),
            Model::Fitted(0.05),
        ),
        all(
            "friction_hidden_2",
            "dry friction 0.12 V, model fitted under it at the large multisine",
            &["coulomb_friction"],
            dry(0.12),
            Model::Fitted(0.2),
        ),
        all(
            "dead_band_hidden_1",
            "dead band of 0.03 V, model fitted under it at the small multisine",
            &["dead_band"],
            dead(0.03),
            Model::Fitted(0.05),
        ),
        all(
            "dead_band_hidden_2",
            "dead band of 0.06 V, model fitted under it at the large multisine",
            &["dead_band"],
            dead(0.06),
            Model::Fitted(0.2),
        ),
        all(
            "lattice",
            "encoder counts of 0.06 track",
            &["quantisation"],
            Foreign { lattice: 0.06, ..SOUND },
            Model::Exact,
        ),
        all(
            "lattice_bearing",
            "encoder counts of 0.05 track beside pivot friction",
            &["pivot_friction", "quantisation"],
            Foreign { lattice: 0.05, ..bearing },
            Model::Exact,
        ),
        all(
            "wind",
            "torque noise of 0.04 V with a corner of 250 Hz",
            &["broadband_disturbance"],
            Foreign { wind: [0.04, 250.0], ..SOUND },
            Model::Exact,
        ),
        all(
            "play_before",
            "play of 0.05 track, contact of 2.4 kHz, encoder on the motor's side",
            &["backlash"],
            joint(false),
            Model::Exact,
        ),
        all("play_behind", "the same, encoder behind the play", &["backlash"], joint(true), Model::Exact),
        Foretold {
            id: "bristles",
            what: "dry friction of 0.09 V whose bristles give way over 0.02 track, small motion",
            expected: &["coulomb_friction"],
            trial: Trial { sizes: [0.1, 0.16], ..trial(Foreign { bristles: [0.09, 0.02], ..SOUND }, Model::Exact) },
        },
        all(
            "bearing_runout",
            "pivot friction beside run-out of 0.02 track at 120 Hz",
            &["pivot_friction", "repeatable_runout"],
            Foreign { runout: [0.02, 120.0], ..bearing },
            Model::Exact,
        ),
        all(
            "limit_runout",
            "an amplifier limited to 0.6 V beside run-out of 0.02 track at 120 Hz",
            &["current_saturation", "repeatable_runout"],
            Foreign { limit: 0.6, runout: [0.02, 120.0], ..SOUND },
            Model::Exact,
        ),
        all(
            "friction_cyclic",
            "dry friction of 0.05 V beside a cyclic error of 0.02 track over 1.3 track",
            &["coulomb_friction", "encoder_cyclic_error"],
            Foreign { cyclic: [0.02, 1.3], ..dry(0.05) },
            Model::Exact,
        ),
        all(
            "push",
            "a push of 0.3 V over 4 ms at 0.08 s of every record",
            &["shock"],
            Foreign { push: [0.08, 0.004, 0.3], ..SOUND },
            Model::Exact,
        ),
    ]
}
