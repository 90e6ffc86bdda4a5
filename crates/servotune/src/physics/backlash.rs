//! Play between the arm and what it pushes: a loose pushpin, a worn coupling.
//!
//! Rigid contact: the pushed part rests until the arm has crossed the gap, p = clip(p, x - g/2, x + g/2), the play operator
//! (Krasnoselskii, Pokrovskii 1989); what is recorded is p, the part being held by its own friction.
//! Contact with a stiffness: two masses with a spring and a damper that act outside the gap alone (Nordin, Gutman 2002, "Controlling mechanical
//! systems with backlash", dead-zone model). Their centre of mass follows the torque as the rigid plant does. What one is ahead of the other,
//! e = x1 - x2, obeys e'' = d (b i - k x - c x') - w² over(e) - 2 z w e' in contact, with w the frequency of both masses in contact and d the
//! whole inertia over the driven one. The encoder reads the centre and a share of e: on the driven mass s e, s being the load's share of
//! the inertia, behind the play -(1 - s) e.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd, Takes};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};
use super::share::Share;
use crate::lti::Body;
use nalgebra::Complex;
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

/// The play. With a contact its strength is the share of e that the encoder reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Backlash {
    /// Gap between the two contacts (position_unit), above 0.
    pub gap: f64,
    /// The contact, where it is not stiff.
    pub contact: Option<Contact>,
}

/// A contact that gives way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Frequency of the two masses against one another in contact (Hz), above 0.
    pub hz: f64,
    /// Damping ratio there.
    pub damping_ratio: f64,
    /// Inertia of both masses over that of the driven one.
    pub drive: f64,
}

const GAP: Key = Key::new("gap", Unit::Position, "g")
    .positive()
    .scan(ScanEnd::Greatest(&[(0.1, Measure::Noise), (1e-5, Measure::Travel)]), ScanEnd::At(1.0, Measure::Travel));
const CONTACT_HZ: Key = Key::new("contact_hz", Unit::Hertz, "the two masses against one another in contact")
    .or_else("a rigid contact")
    .positive()
    .scan(ScanEnd::At(CONTACTS[0], Measure::SampleRate), ScanEnd::At(CONTACTS[1], Measure::SampleRate));
const DAMPING_RATIO: Key =
    Key::new("damping_ratio", Unit::Ratio, "damping ratio there; the last fit moves it between 0.001 and 0.5")
        .or(DAMPING)
        .beside("contact_hz")
        .points(&[DAMPING]);
const LOAD_SHARE: Key = Key::new("load_share", Unit::Ratio, "share of the load in the inertia, s")
    .or(LOAD)
    .beside("contact_hz")
    .takes(Takes::Between(0.0, 1.0, "a number between 0 and 1"));
const DRIVE_RATIO: Key = Key::new("drive_ratio", Unit::Ratio, "whole inertia over the driven one, d")
    .or_else("1/(1 - load_share)")
    .beside("contact_hz")
    .points(&DRIVES);
const ENCODER_BEHIND: Key =
    Key::new("encoder_behind", Unit::Ratio, "0: the encoder sits on the driven mass; else behind the play")
        .or(0.0)
        .beside("contact_hz")
        .prior(Prior::Words("the sign of the strength"));

const fn play(fixed: bool, equation: &'static str) -> Facts {
    Facts {
        name: "backlash",
        port: Port::Structure,
        entry: Entry::Position,
        columns: 1,
        fixed,
        per_record: false,
        equation,
        keys: &[GAP, CONTACT_HZ, DAMPING_RATIO, LOAD_SHARE, DRIVE_RATIO, ENCODER_BEHIND],
        source: "M. A. Krasnoselskii, A. V. Pokrovskii, Systems with Hysteresis, 1989; the contact: M. Nordin, P.-O. Gutman, Controlling Mechanical Systems with Backlash: a Survey, Automatica 38(10), 2002",
        says: "there is play between the arm and the part it pushes: after each reversal the part waits until the gap is crossed",
        confused_with: &["coulomb_friction", "pivot_friction", "quantisation", "unmodelled_resonance"],
        experiment: "slow triangles of three sizes with the PES and the encoder recorded: the PES stops at reversals",
        band_hz: [1.0, 5000.0],
    }
}

/// What is known beforehand.
pub static FACTS: Facts = play(
    true,
    "m = p, p = clip(p, x - g/2, x + g/2); with a contact m = x + s e, e'' = d (b i - k x - c x') - w^2 over(e, g/2) - 2 z w e'",
);
/// The same of a play with a contact.
static WITH_CONTACT: Facts =
    play(false, "m = x + s e, e'' = d (b i - k x - c x') - w^2 over(e, g/2) - 2 z w e' in contact");

/// Gaps of the grid with a contact.
const GAPS: usize = 10;
/// Frequencies of the grid, over the sample rate, and how many.
const CONTACTS: [f64; 2] = [0.012, 0.35];
const FREQUENCIES: usize = 8;
/// Damping from which the search sets out: steel on steel.
const DAMPING: f64 = 0.03;
/// Inertia over the driven one on the grid.
const DRIVES: [f64; 2] = [1.12, 1.4];
/// Share of the load where a file does not say.
const LOAD: f64 = 0.2;
/// Phase of the contact within a step of the integrator (rad), and most steps a sample.
const PHASE: f64 = 0.1;
const STEPS: f64 = 64.0;
/// Share of the contact's frequency above which a body's own spring is none: a plant that was fitted to something else.
const SPRING: f64 = 0.2;

struct Play {
    half: f64,
    part: Option<f64>,
}

impl Play {
    fn next(&self, from: &Sample, to: &Sample) -> f64 {
        // Not `clamp`, which panics where the motion is no number.
        self.part.unwrap_or(from.x).max(to.x - self.half).min(to.x + self.half)
    }
}

impl Law for Play {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to) - to.x;
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.part = Some(self.next(from, to));
    }
}

/// Two masses with a gap between them: how far one is ahead of the other, and how fast.
struct Apart {
    half: f64,
    /// Square of the contact's frequency (1/s²) and twice its damping (1/s).
    stiff: f64,
    damping: f64,
    /// Acceleration of e per command, and the body's spring and damper per command.
    drive: f64,
    spring: f64,
    damper: f64,
    steps: usize,
    step_s: f64,
    /// Over a whole sample, in contact: the transition of what is off the balance (none where too much happens in a sample), and the sample.
    swing: Option<[f64; 4]>,
    sample_s: f64,
    e: [f64; 2],
    /// Where the last step asked for leads: it is asked for once to be seen and once to be taken.
    ahead: Cell<Option<(Sample, f64, [f64; 2])>>,
}

impl Apart {
    fn of(gap: f64, contact: Contact, scene: &MotionScene) -> Apart {
        let w = TAU * contact.hz;
        let b = scene.acceleration_gain();
        let [k, c] = match scene.plant.body {
            Body::SecondOrder { natural_frequency_rad_s: w0, damping_ratio, .. } if w0 < SPRING * w => {
                [w0 * w0, 2.0 * damping_ratio * w0]
            }
            Body::FreeInertia { viscous_rate_per_s, .. } if viscous_rate_per_s < SPRING * w => {
                [0.0, viscous_rate_per_s]
            }
            _ => [0.0; 2],
        };
        let steps = (w * scene.sample_time_s / PHASE).ceil().clamp(1.0, STEPS);
        Apart {
            half: 0.5 * gap.abs(),
            stiff: w * w,
            damping: 2.0 * contact.damping_ratio * w,
            drive: contact.drive * b,
            spring: k / b,
            damper: c / b,
            steps: steps as usize,
            step_s: scene.sample_time_s / steps,
            swing: Self::swing(w, contact.damping_ratio, scene.sample_time_s),
            sample_s: scene.sample_time_s,
            e: [0.0; 2],
            ahead: Cell::new(None),
        }
    }

    /// o and o' after a time, of o'' = -w² o - 2 z w o'; none beyond three quarters of half a swing, within which o turns round once at most.
    fn swing(w: f64, z: f64, time_s: f64) -> Option<[f64; 4]> {
        let root = (z < 1.0).then(|| (1.0 - z * z).sqrt()).filter(|root| w * root * time_s < 0.75 * PI)?;
        let (sin, cos) = (w * root * time_s).sin_cos();
        let (fall, lean) = ((-z * w * time_s).exp(), z / root * sin);
        Some([cos + lean, sin / (w * root), -w / root * sin, cos - lean].map(|v| fall * v))
    }

    /// The sample in one step, where both masses stay apart, or in contact, all the time.
    fn undisturbed(&self, push: f64) -> Option<[f64; 2]> {
        let ([e, v], h) = (self.e, self.sample_s);
        if e.abs() <= self.half {
            let to = [e + h * (v + 0.5 * h * push), v + h * push];
            let turns = if v * to[1] < 0.0 { e - 0.5 * v * v / push } else { e };
            return (to[0].abs() <= self.half && turns.abs() <= self.half).then_some(to);
        }
        // Outwards counts up.
        let (side, [a, b, c, d]) = (e.signum(), self.swing?);
        let (rest, off, v) = (side * push / self.stiff, side * e - self.half, side * v);
        let to = [a * (off - rest) + b * v, c * (off - rest) + d * v];
        // It may come inwards and go out again: by no more than its swing.
        let reach = if v < 0.0 && to[1] > 0.0 { (off - rest).hypot(v / self.stiff.sqrt()) } else { 0.0 };
        let stays = rest + to[0] > 0.0 && (reach == 0.0 || rest > 2.0 * reach);
        stays.then_some([side * (self.half + rest + to[0]), side * to[1]])
    }

    fn acceleration(&self, push: f64, e: f64, v: f64) -> f64 {
        let over = e - e.max(-self.half).min(self.half);
        let damped = if over == 0.0 { 0.0 } else { self.damping * v };
        push - self.stiff * over - damped
    }

    /// One sample on, exactly or, where a contact opens or closes in it, by velocity Verlet; none where no time goes by.
    fn next(&self, from: &Sample, to: &Sample) -> [f64; 2] {
        let [mut e, mut v] = self.e;
        if to.t <= from.t {
            return self.e;
        }
        if let Some((known, until, reached)) = self.ahead.get()
            && until == to.t
            && known == *from
        {
            return reached;
        }
        let push = self.drive * (from.i - self.spring * from.x - self.damper * from.v);
        let reached = self.undisturbed(push).unwrap_or_else(|| {
            let h = self.step_s;
            for _ in 0..self.steps {
                let middle = v + 0.5 * h * self.acceleration(push, e, v);
                e += h * middle;
                v = middle + 0.5 * h * self.acceleration(push, e, middle);
            }
            [e, v]
        });
        self.ahead.set(Some((*from, to.t, reached)));
        reached
    }
}

impl Law for Apart {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = self.next(from, to)[0];
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.e = self.next(from, to);
        self.ahead.set(None);
    }
}

impl Parametric for Backlash {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn facts(&self) -> &'static Facts {
        if self.contact.is_some() { &WITH_CONTACT } else { &FACTS }
    }

    fn shown_over() -> ShownOver {
        ShownOver::Loop
    }

    fn grid(scene: &MotionScene) -> Vec<Backlash> {
        // A gap below the sensor's noise still shows: thousands of reversals tell of it.
        let low = (0.1 * scene.noise).max(1e-5 * scene.travel);
        let rigid = logarithmic(low, scene.travel, 24).into_iter().map(|gap| Backlash { gap, contact: None });
        let gaps = logarithmic(scene.noise.max(1e-4 * scene.travel), 0.1 * scene.travel, GAPS);
        let rate = scene.sample_time_s.recip();
        let contacts = logarithmic(CONTACTS[0] * rate, CONTACTS[1] * rate, FREQUENCIES);
        let with = |gap: f64, hz: f64, drive: f64| Backlash {
            gap,
            contact: Some(Contact { hz, damping_ratio: DAMPING, drive }),
        };
        let apart = DRIVES.iter().flat_map(|drive| {
            contacts.iter().flat_map(|hz| gaps.iter().map(|gap| with(*gap, *hz, *drive)).collect::<Vec<_>>())
        });
        rigid.chain(apart).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        let (hz, rest) = match &mut self.contact {
            Some(c) => (Some(&mut c.hz), Some((&mut c.drive, &mut c.damping_ratio))),
            None => (None, None),
        };
        let (drive, damping) = rest.unzip();
        vec![Some(&mut self.gap), hz, drive, damping]
    }

    fn class(&self) -> Vec<usize> {
        vec![usize::from(self.contact.is_some())]
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn measured_in_last_fit(&self) -> Vec<(usize, [f64; 2])> {
        if self.contact.is_some() { vec![(3, [1e-3, 0.5])] } else { Vec::new() }
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        match self.contact {
            Some(contact) => Box::new(Apart::of(self.gap, contact, scene)),
            None => Box::new(Play { half: 0.5 * self.gap.abs(), part: None }),
        }
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![GAP.at(self.gap)];
        if let Some(c) = self.contact {
            let read = strengths.first().copied().unwrap_or(0.0);
            let behind = f64::from(read < 0.0);
            all.push(CONTACT_HZ.at(c.hz));
            all.push(DAMPING_RATIO.at(c.damping_ratio));
            all.push(LOAD_SHARE.at(behind + read));
            all.push(DRIVE_RATIO.at(c.drive));
            all.push(ENCODER_BEHIND.at(behind));
        }
        all
    }

    /// The encoder reads one of two masses.
    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        self.contact.is_none() || strengths.first().is_some_and(|s| *s != 0.0 && s.abs() < 1.0)
    }

    /// A machine holds to this law to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    /// With a contact that of both masses touching: what motions large beside the gap meet. Without one the play's own loop.
    fn response_share(&self, strengths: &[f64], _scene: &MotionScene, w_rad_s: f64) -> Share {
        let Some(c) = self.contact else { return Share::Cycle };
        let (w, read) = (TAU * c.hz, strengths.first().copied().unwrap_or(0.0));
        let answer = Complex::new(w * w - w_rad_s * w_rad_s, 2.0 * c.damping_ratio * w * w_rad_s);
        Share::Ratio(-read * c.drive * w_rad_s * w_rad_s / answer)
    }

    fn setting_of(given: &Given, _scene: &MotionScene) -> Result<(Backlash, Vec<f64>), PhysicsError> {
        let gap = given.need(&GAP)?;
        if !given.has(&CONTACT_HZ) {
            return Ok((Backlash { gap, contact: None }, vec![1.0]));
        }
        let share = given.or(&LOAD_SHARE)?;
        let behind = given.or(&ENCODER_BEHIND)? != 0.0;
        let contact = Contact {
            hz: given.need(&CONTACT_HZ)?,
            damping_ratio: given.or(&DAMPING_RATIO)?,
            drive: given.or_else(&DRIVE_RATIO, 1.0 / (1.0 - share))?,
        };
        Ok((Backlash { gap, contact: Some(contact) }, vec![if behind { share - 1.0 } else { share }]))
    }
}
