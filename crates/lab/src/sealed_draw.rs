//! Cases of the sealed set, drawn: which kind, what acts and how much, the machine, the model that is given, units and rate.

use super::foreign::{Foreign, Joint, SOUND, T};
use super::foreign_scale::Scale;
use super::foreign_stage::{BARE, Stage};
use super::foreign_trial::{Model, Trial};
use servotune::numeric::random::Random;

/// A machine of one of the two makes.
pub(super) enum Made {
    /// A voice coil on a pivot.
    Arm(Box<Trial>),
    /// A slow stage, and the size of the multisine that its model was fitted to.
    Stage(Stage, Option<f64>),
}

/// A number that is known: effect, parameter, value in the units of the case.
pub(super) type Truth = (&'static str, &'static str, f64);

/// One case of the set.
pub(super) struct Drawn {
    pub kind: &'static str,
    /// Effects that act and have a name in the library.
    pub expected: Vec<&'static str>,
    pub truth: Vec<Truth>,
    pub made: Made,
    pub scale: Scale,
}

impl Drawn {
    /// Whether the given model was fitted to records.
    pub fn fitted(&self) -> bool {
        match &self.made {
            Made::Arm(t) => matches!(t.model, Model::Fitted(_)),
            Made::Stage(_, size) => size.is_some(),
        }
    }
}

/// Kinds and how many there are of each in a set of [`WHOLE`].
const KINDS: [(&str, usize); 22] = [
    ("sound", 14),
    ("linear_off", 14),
    ("friction", 22),
    ("dead_band", 18),
    ("bearing", 14),
    ("limit", 10),
    ("lattice", 10),
    ("wind", 10),
    ("runout", 10),
    ("cyclic", 10),
    ("play", 10),
    ("push", 10),
    ("friction+runout", 3),
    ("friction+cyclic", 3),
    ("bearing+runout", 3),
    ("limit+runout", 3),
    ("dead_band+cyclic", 3),
    ("dead_band+runout", 3),
    ("detent", 8),
    ("one_sided", 8),
    ("lopsided", 8),
    ("stage_friction", 8),
];
/// Of the stage with a dead band, and of all.
const STAGE_DEAD: usize = 6;
pub(super) const WHOLE: usize = 208;
/// A stage on which nothing acts: no kind of the set, but one of those that tell false alarms.
pub(super) const STAGE_SOUND: &str = "stage_sound";

/// The kind of a place in the set. Places go through the kinds in turn, so that a part of a set holds of all.
pub(super) fn kind(place: usize) -> &'static str {
    let all: Vec<(&str, usize)> = KINDS.into_iter().chain([("stage_dead_band", STAGE_DEAD)]).collect();
    // Each case of a kind stands at its share of the whole.
    let mut places: Vec<(f64, usize, &str)> = Vec::new();
    for (k, (name, count)) in all.iter().enumerate() {
        places.extend((0..*count).map(|i| ((i as f64 + 0.5) / *count as f64, k, *name)));
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    places[place % places.len()].2
}

/// The case of a kind at a place; `again` counts the draws that could not be made.
pub(super) fn draw(kind: &'static str, seed: u64, place: usize, samples: usize, again: u64) -> Drawn {
    let mut r = Random::stream(seed, (1 + again) * 100_000 + place as u64);
    let between = |r: &mut Random, low: f64, high: f64| low * (high / low).powf(r.uniform());
    let scale = scale(&mut r);
    if kind.starts_with("stage") {
        return stage(kind, &mut r, scale);
    }
    let mut m = Foreign {
        body: [
            SOUND.body[0] * r.between(0.85, 1.2),
            SOUND.body[1] * between(&mut r, 0.5, 2.0),
            SOUND.body[2] * between(&mut r, 0.6, 2.0),
        ],
        delay: 50 + (r.uniform() * 50.0) as usize,
        noise: between(&mut r, 0.0015, 0.006),
        ..SOUND
    };
    let mut nominal = m.body;
    let (mut expected, mut truth): (Vec<&'static str>, Vec<Truth>) = (Vec::new(), Vec::new());
    for one in kind.split('+') {
        match one {
            "linear_off" => {
                nominal[0] *= 1.0 + r.between(0.04, 0.2) * sign(&mut r);
                nominal[1] *= 1.0 + r.between(0.05, 0.3) * sign(&mut r);
                nominal[2] *= 1.0 + r.between(0.05, 0.4) * sign(&mut r);
            }
            "friction" => {
                m.bristles = [between(&mut r, 0.008, 0.12), between(&mut r, 0.003, 0.03)];
                expected.push("coulomb_friction");
                truth.push(("coulomb_friction", "level_command", m.bristles[0] * scale.command));
            }
            "dead_band" => {
                m.dead_band = between(&mut r, 0.008, 0.08);
                expected.push("dead_band");
                truth.push(("dead_band", "half_width", m.dead_band * scale.command));
            }
            "bearing" => {
                m.bearing = [between(&mut r, 0.01, 0.1), between(&mut r, 0.5, 4.0)];
                expected.push("pivot_friction");
            }
            "limit" => {
                m.limit = r.between(0.25, 0.75);
                expected.push("current_saturation");
                truth.push(("current_saturation", "limit", m.limit * scale.command));
            }
            "lattice" => {
                m.lattice = between(&mut r, 6.0, 25.0) * m.noise;
                expected.push("quantisation");
                truth.push(("quantisation", "step", m.lattice * scale.position));
            }
            "wind" => {
                m.wind = [between(&mut r, 0.006, 0.06), between(&mut r, 80.0, 600.0)];
                expected.push("broadband_disturbance");
                truth.push(("broadband_disturbance", "rms_command", m.wind[0] * scale.command));
            }
            "runout" => {
                m.runout = [between(&mut r, 0.8, 8.0) * m.noise, between(&mut r, 80.0, 200.0)];
                expected.push("repeatable_runout");
                truth.push(("repeatable_runout", "amplitude", m.runout[0] * scale.position));
            }
            "cyclic" => {
                m.cyclic = [between(&mut r, 1.0, 8.0) * m.noise, between(&mut r, 0.5, 3.0)];
                expected.push("encoder_cyclic_error");
                truth.push(("encoder_cyclic_error", "amplitude", m.cyclic[0] * scale.position));
                truth.push(("encoder_cyclic_error", "period", m.cyclic[1] * scale.position));
            }
            "play" => {
                let gap = between(&mut r, 0.015, 0.1);
                let contact_hz = between(&mut r, 1200.0, 3500.0);
                let (share, behind) = (r.between(0.1, 0.3), r.uniform() < 0.5);
                m.joint = Some(Joint { gap, contact_hz, share, behind });
                expected.push("backlash");
            }
            "push" => {
                m.push = [r.between(0.02, 0.08), between(&mut r, 0.002, 0.01), between(&mut r, 0.02, 0.4)];
                expected.push("shock");
            }
            "detent" => m.detent = [between(&mut r, 0.015, 0.1), r.between(0.5, 3.0), between(&mut r, 0.3, 1.5)],
            "one_sided" => m.one_sided = [between(&mut r, 0.02, 0.12), between(&mut r, 20.0, 150.0)],
            "lopsided" => m.lopsided = between(&mut r, 0.03, 0.3),
            _ => {}
        }
    }
    let (small, large) = (between(&mut r, 0.03, 0.1), between(&mut r, 0.15, 0.35));
    let fitted = nominal == m.body && r.uniform() < 0.6;
    let model = match fitted {
        true => Model::Fitted(if r.uniform() < 0.5 { small } else { large }),
        false => Model::Exact,
    };
    let samples = (samples as f64 * r.between(0.75, 1.25)) as usize;
    let trial = Trial { machine: m, nominal, model, sizes: [small, large], samples, seed: 1 + r.bits() % 1_000_000 };
    Drawn { kind, expected, truth, made: Made::Arm(Box::new(trial)), scale }
}

fn sign(r: &mut Random) -> f64 {
    if r.uniform() < 0.5 { -1.0 } else { 1.0 }
}

/// Other units and another rate.
fn scale(r: &mut Random) -> Scale {
    const UNITS: [(&str, &str, f64, f64); 6] = [
        ("track", "V", 1.0, 1.0),
        ("mm", "A", 2e-4, 3.0),
        ("um", "V", 0.35, 0.2),
        ("mrad", "A", 0.02, 8.0),
        ("count", "DAC", 180.0, 3000.0),
        ("deg", "N", 5e-3, 40.0),
    ];
    let (position_unit, command_unit, position, command) = UNITS[(r.uniform() * 6.0) as usize % 6];
    // From 50 kHz down to 1 kHz.
    let time = 20e-6 / T * 50f64.powf(r.uniform());
    Scale { position_unit, command_unit, position, command, time }
}

fn stage(kind: &'static str, r: &mut Random, scale: Scale) -> Drawn {
    let body = [BARE.body[0] * r.between(0.8, 1.2), BARE.body[1] * r.between(0.5, 2.0)];
    let noise = BARE.noise * r.between(0.7, 2.0);
    let mut machine = Stage { body, noise, ..BARE };
    let truth: Option<Truth> = match kind {
        STAGE_SOUND => {
            machine.seed = 1 + r.bits() % 1_000_000;
            None
        }
        "stage_friction" => {
            let rise = if r.uniform() < 0.5 { 0.0 } else { r.between(0.1, 0.4) };
            machine.friction =
                [0.05 * 8f64.powf(r.uniform()), rise, r.between(1.0, 4.0), 6e-3 * r.between(0.5, 2.0), 1e-3];
            Some(("coulomb_friction", "level_command", machine.friction[0] * scale.command))
        }
        _ => {
            machine.dead_band = 0.02 * 8f64.powf(r.uniform());
            Some(("dead_band", "half_width", machine.dead_band * scale.command))
        }
    };
    let size = (r.uniform() < 0.7).then_some(if r.uniform() < 0.5 { 0.25 } else { 0.8 });
    let expected = truth.iter().map(|t| t.0).collect();
    Drawn { kind, expected, truth: truth.into_iter().collect(), made: Made::Stage(machine, size), scale }
}
