//! The loop of a plant with physics at one amplitude: every effect by its describing function, linear ones exactly.
//!
//! In: a plant's physics made ready, the amplitude A of the position. Out: the response P(jw; A) from the command at the
//! samples to the recorded position, and its loop with the firmware's sections. With X the arm's position, W the torque
//! effects over the cycle and V the command behind the amplifier: X = P_d V + P W, Y = X + position effects, V = (1 + N_c) U,
//! where P_d is the exactly sampled plant and P the continuous one without delay. Linear entries (delay, lags, missing
//! vibrations) are exact for any amplitude. Source: Gelb, Vander Velde 1968; spec: `specs/mismatch.md`, "Use".

use super::open_loop::{angle_from_rest, section_poles};
use super::{FeedbackError, OpenLoop, Trace, frequency_grid, nyquist_count};
use crate::lti::{DiscretePlant, FrequencyResponse, LtiError, ModalForm, Plant, Sections};
use crate::physics::{Cycle, Entry, LawSetting, Motion, MotionScene, Restored, Share};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// A plant with physics, its linear parts taken in; amplitudes come later.
pub struct DescribedPlant<'a> {
    scene: &'a MotionScene,
    /// The linear plant with every delay, as the command meets it.
    delayed: DiscretePlant,
    /// Vibrations that the plant file adds.
    rings: Option<DiscretePlant>,
    /// The plant without its delay, as a torque meets it.
    direct: Plant,
    parts: Vec<Part<'a>>,
    cycle: Cycle,
    /// |P| of the linear plant where the loop is to cross over (position_unit per command_unit).
    size: f64,
}

struct Part<'a> {
    setting: &'a LawSetting,
    entry: Entry,
    /// Whether the law is linear ([`Share::Ratio`]).
    linear: bool,
}

impl<'a> DescribedPlant<'a> {
    /// A plant's physics. `crossover_hz` is where the loop crosses over or is to: there the position's amplitude A goes with a
    /// command of A/|P|, at which effects of the amplifier are described.
    pub fn new(physics: &'a Restored, crossover_hz: f64) -> Result<DescribedPlant<'a>, LtiError> {
        let scene = &physics.scene;
        let mut plant = scene.plant.clone();
        let (mut parts, mut terms) = (Vec::new(), Vec::new());
        for setting in &physics.parts {
            let linear = match setting.response_share(scene, 1.0) {
                Share::Outside => continue,
                Share::Delay(late) => {
                    plant.delay_s += late;
                    continue;
                }
                Share::Terms(more) => {
                    terms.extend(more);
                    continue;
                }
                Share::Ratio(_) => true,
                Share::Cycle | Share::Blind => false,
            };
            parts.push(Part { setting, entry: setting.facts().entry, linear });
        }
        let t = scene.sample_time_s;
        let delayed = DiscretePlant::of(&plant, t)?;
        let form = ModalForm { terms, rigid2: 0.0, rigid1: 0.0, delay_s: plant.delay_s };
        let rings = if form.terms.is_empty() { None } else { Some(DiscretePlant::of_modal(&form, t)?) };
        let direct = Plant { delay_s: 0.0, ..plant };
        let size = delayed.at((TAU * crossover_hz).min(PI / t)).norm();
        Ok(DescribedPlant { scene, delayed, rings, direct, parts, cycle: Cycle::default(), size })
    }

    /// Whether the response depends on the amplitude.
    pub fn bends(&self) -> bool {
        self.parts.iter().any(|p| !p.linear)
    }

    /// Sample time (s).
    pub fn sample_time_s(&self) -> f64 {
        self.scene.sample_time_s
    }

    /// Ascending frequencies (rad/s) that resolve the plant's modes and the sections.
    pub fn grid(&self, sections: &Sections) -> Vec<f64> {
        let mut poles = self.delayed.terms().to_vec();
        poles.extend(self.rings.iter().flat_map(|r| r.terms()));
        frequency_grid(&poles, sections)
    }

    /// The response at a position amplitude (position_unit, above 0).
    pub fn at_amplitude(&'a self, amplitude: f64) -> Described<'a> {
        self.described(amplitude, amplitude / self.size)
    }

    fn described(&'a self, amplitude: f64, command: f64) -> Described<'a> {
        let steady = self.parts.iter().map(|p| self.steady(p, amplitude, command)).collect();
        Described { plant: self, amplitude, command, steady }
    }

    /// What an effect adds where neither the frequency nor the acting command matters, as for most friction and springs:
    /// one cycle then serves the whole curve.
    fn steady(&self, p: &Part<'_>, amplitude: f64, command: f64) -> Option<Complex<f64>> {
        if p.linear {
            return None;
        }
        let added = |w_rad_s: f64, acting: f64| {
            let acting = Complex::new(acting, 0.0);
            let motion = Motion { w_rad_s, position: amplitude, acting, command };
            self.cycle.added(p.setting, self.scene, &motion)
        };
        let first = added(PROBES[0], 0.0);
        let same = |other: Complex<f64>| (other - first).norm() <= SAME * first.norm();
        (same(added(PROBES[1], 0.0)) && same(added(PROBES[0], command)) && same(added(PROBES[2], -command)))
            .then_some(first)
    }

    fn has(&self, entry: Entry) -> bool {
        self.parts.iter().any(|p| p.entry == entry)
    }
}

/// Frequencies (rad/s) at which an effect that is the same at all of them is steady, and how much the same.
const PROBES: [f64; 3] = [7.0, 130.0, 11_000.0];
const SAME: f64 = 1e-12;

/// A plant at one amplitude.
#[derive(Clone)]
pub struct Described<'a> {
    plant: &'a DescribedPlant<'a>,
    amplitude: f64,
    command: f64,
    /// For each part what it adds, where that is the same at every frequency.
    steady: Vec<Option<Complex<f64>>>,
}

/// Rounds of the balance where a torque depends on the command; each shrinks the rest by the share of that torque.
const ROUNDS: usize = 60;
/// Change of the balance that ends it, relative.
const BALANCED: f64 = 1e-11;
/// Least gain of the amplifier: a command wholly inside a dead band counts as this, so that L keeps a logarithm.
const LEAST: f64 = 1e-9;

impl Described<'_> {
    /// Amplitude of the position (position_unit).
    pub fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// Amplitude of the command that effects of the amplifier are described at (command_unit).
    pub fn command(&self) -> f64 {
        self.command
    }

    fn sum(&self, entry: Entry, w: f64, motion: &Motion, input: Complex<f64>) -> Complex<f64> {
        let p = self.plant;
        let each = |(part, steady): (&Part<'_>, &Option<Complex<f64>>)| {
            steady.unwrap_or_else(|| match part.setting.response_share(p.scene, w) {
                Share::Ratio(r) => r * input,
                _ => p.cycle.added(part.setting, p.scene, motion),
            })
        };
        p.parts.iter().zip(&self.steady).filter(|(part, _)| part.entry == entry).map(each).sum()
    }

    /// The torque effects over the cycle, and the acting command that balances them (command_unit, against the position).
    fn balance(&self, w: f64) -> (Complex<f64>, Complex<f64>) {
        let p = self.plant;
        let free = self.amplitude / p.direct.at(w);
        if !p.has(Entry::Torque) {
            return (Complex::new(0.0, 0.0), free);
        }
        let (mut acting, mut torque) = (free, Complex::new(f64::NAN, 0.0));
        for _ in 0..ROUNDS {
            let motion = Motion { w_rad_s: w, position: self.amplitude, acting, command: 0.0 };
            let next = self.sum(Entry::Torque, w, &motion, acting);
            let settled = (next - torque).norm() <= BALANCED * free.norm().max(next.norm());
            torque = next;
            acting = free - torque;
            if settled {
                break;
            }
        }
        (torque, acting)
    }

    /// -P N: the loop from the position through the torque effects and back.
    fn inner(&self, w: f64) -> Complex<f64> {
        -self.plant.direct.at(w) * self.balance(w).0 / self.amplitude
    }
}

impl FrequencyResponse for Described<'_> {
    /// P(jw; A), sampled.
    fn at(&self, w: f64) -> Complex<f64> {
        let p = self.plant;
        let (_, acting) = self.balance(w);
        let sampled = p.delayed.at(w);
        let x = Complex::new(self.amplitude, 0.0);
        // The sampled command behind the amplifier that makes X beside the torques.
        let behind = acting * p.direct.at(w) / sampled;
        let command = self.command();
        let gain = if p.has(Entry::Command) {
            let u = Complex::new(command, 0.0);
            let motion = Motion { w_rad_s: w, position: 0.0, acting: u, command };
            1.0 + self.sum(Entry::Command, w, &motion, u) / command
        } else {
            Complex::new(1.0, 0.0)
        };
        let gain = if gain.norm() < LEAST { Complex::new(LEAST, 0.0) } else { gain };
        let mut y = x;
        if p.has(Entry::Position) {
            let motion = Motion { w_rad_s: w, position: self.amplitude, acting, command: 0.0 };
            y += self.sum(Entry::Position, w, &motion, x);
        }
        if let Some(rings) = &p.rings {
            y += rings.at(w) * behind;
        }
        y * gain / behind
    }
}

/// The loop of a plant at one amplitude and the firmware's sections.
pub struct DescribedLoop<'a> {
    plant: Described<'a>,
    sections: &'a Sections,
}

impl<'a> DescribedLoop<'a> {
    /// Closes nothing yet: L = P(A) C.
    pub fn new(plant: Described<'a>, sections: &'a Sections) -> Result<Self, FeedbackError> {
        let (plant_s, controller_s) = (plant.plant.sample_time_s(), sections.sample_time_s);
        if ((plant_s - controller_s) / controller_s).abs() > 1e-12 {
            return Err(FeedbackError::SampleTime { plant_s, controller_s });
        }
        Ok(DescribedLoop { plant, sections })
    }
}

/// The order of the pole at rest that a response has at `w`: its slope, rounded.
fn order_at_rest(response: impl Fn(f64) -> Complex<f64>, w: f64) -> usize {
    let slope = (response(w).norm() / response(2.0 * w).norm()).log2().round();
    if slope.is_finite() { slope.clamp(0.0, 2.0) as usize } else { 0 }
}

impl OpenLoop for DescribedLoop<'_> {
    fn at(&self, w: f64) -> Complex<f64> {
        self.plant.at(w) * self.sections.at(w)
    }

    fn grid(&self) -> Vec<f64> {
        self.plant.plant.grid(self.sections)
    }

    fn end_rad_s(&self) -> f64 {
        PI / self.sections.sample_time_s
    }

    fn start_angle(&self, w: f64, value: Complex<f64>) -> f64 {
        let integrators = order_at_rest(|w| self.plant.at(w), w) + section_poles(self.sections).0;
        angle_from_rest(w * self.sections.sample_time_s, value, integrators)
    }

    fn unstable_poles(&self) -> usize {
        let inner = Inner { plant: self.plant.clone(), sections: self.sections };
        let own = if self.plant.plant.has(Entry::Torque) {
            nyquist_count(&inner, &Trace::of(&inner)).unstable_closed_loop_poles.max(0) as usize
        } else {
            0
        };
        own + section_poles(self.sections).1
    }

    fn ends_at_half_rate(&self) -> bool {
        true
    }
}

/// The loop from the position through the torque effects back to it: its count says whether the plant itself runs away.
struct Inner<'a> {
    plant: Described<'a>,
    sections: &'a Sections,
}

impl OpenLoop for Inner<'_> {
    fn at(&self, w: f64) -> Complex<f64> {
        self.plant.inner(w)
    }

    fn grid(&self) -> Vec<f64> {
        self.plant.plant.grid(self.sections)
    }

    fn end_rad_s(&self) -> f64 {
        PI / self.sections.sample_time_s
    }

    fn start_angle(&self, w: f64, value: Complex<f64>) -> f64 {
        angle_from_rest(w * self.sections.sample_time_s, value, order_at_rest(|w| self.plant.inner(w), w))
    }

    fn unstable_poles(&self) -> usize {
        0
    }

    fn ends_at_half_rate(&self) -> bool {
        false
    }
}
