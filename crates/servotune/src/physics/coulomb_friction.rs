//! Dry friction: a constant drag against the motion, optionally higher at low speed.
//!
//! Coulomb with Stribeck's rise: level (1 + rise exp(-(v/v_s)²)) (Armstrong-Helouvry, Dupont, Canudas de Wit 1994). At rest the
//! torque is what holds the arm: Dahl's law with a pre-sliding length near what the sensor resolves, never sgn(v). A film that
//! shears instead of sticking lets the arm creep: the drag then turns round over a speed, not over a length, tanh(v/v_c). The
//! viscous part belongs to the linear plant; a mean offset belongs to the torque offset.
//!
//! Bristles that are damped make it LuGre's law (Canudas de Wit, Olsson, Astrom, Lischinsky 1995): z + `bristle_time_s` dz/dt in the place of z,
//! and a rise stands inside the bristles, dz/dx = (1 - sgn(dx) z/g)/length with g = 1 + rise exp(-(v/v_s)²): they stretch to g before they slip.
//! While the arm sticks they damp what swings on them; once it slides dz/dt is 0, and nothing is left of it.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::pivot_friction::{BRISTLE_TIME_S, BRISTLE_TIMES, SLID, bristle_rate, bristle_time_of, dahl, shortest_loop};
use super::sample::{MotionScene, Sample, logarithmic};
use std::cell::Cell;

/// Dry friction. Its strength is the level at speed.
#[derive(Clone, Debug, PartialEq)]
pub struct CoulombFriction {
    /// Over what the drag turns round with the motion.
    pub turning: Turning,
    /// The rise at low speed, where there is one.
    pub stribeck: Option<Stribeck>,
    /// Damping of the bristles over their stiffness (s), above 0, of what sticks; none without.
    pub bristle_time_s: Option<f64>,
}

/// Over what a dry drag turns round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turning {
    /// Over a length: the arm sticks.
    Length {
        /// Pre-sliding length (position_unit), above 0.
        sliding_length: f64,
    },
    /// Over a speed: the arm creeps.
    Creep {
        /// Speed at which tanh(1) of the level is reached (position_unit/s), above 0.
        speed: f64,
    },
}

/// Stribeck's rise of a drag towards low speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck {
    /// Speed over which it falls off (position_unit/s), above 0.
    pub speed: f64,
    /// Rise at rest over the level at speed.
    pub rise: f64,
}

const LEVEL_COMMAND: Key = Key::new("level_command", Unit::Command, "drag at speed, F");
const SLIDING_LENGTH: Key = Key::new("sliding_length", Unit::Position, "way over which the drag turns round")
    .or_else("max(6 noise, 0.00001 travel)")
    .positive()
    .scan(
        ScanEnd::Greatest(&[(1.5, Measure::Noise), (3e-6, Measure::Travel)]),
        ScanEnd::Greatest(&[(12.0, Measure::Noise), (2e-3, Measure::Travel)]),
    );
const CREEP_SPEED: Key = Key::new(
    "creep_speed",
    Unit::PositionPerSecond,
    "speed over which the drag of a film turns round, in place of the length",
)
.or_else("it sticks")
.positive()
.scan(ScanEnd::At(1e-3, Measure::Speed), ScanEnd::At(0.3, Measure::Speed));
const STRIBECK_SPEED: Key = Key::new("stribeck_speed", Unit::PositionPerSecond, "speed over which the rise falls off")
    .or_else("no rise")
    .positive()
    .scan(ScanEnd::At(0.015, Measure::Speed), ScanEnd::At(0.2, Measure::Speed));
const STRIBECK_RISE: Key =
    Key::new("stribeck_rise", Unit::Ratio, "rise at rest over the level").beside("stribeck_speed").points(&[0.5]);

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "coulomb_friction",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -F (1 + rise exp(-(v/v_s)^2)) z, dz/dx = (1 - sgn(dx) z)/length (sgn(v) once sliding); of a film z = tanh(v/v_c); of damped bristles tau = -F (z + tau_b dz/dt), dz/dx = (1 - sgn(dx) z/g)/length, g = 1 + rise exp(-(v/v_s)^2)",
    keys: &[LEVEL_COMMAND, SLIDING_LENGTH, CREEP_SPEED, STRIBECK_SPEED, STRIBECK_RISE, BRISTLE_TIME_S],
    source: "B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, A Survey of Models, Analysis Tools and Compensation Methods for the Control of Machines with Friction, Automatica 30(7), 1994; C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, A New Model for Control of Systems with Friction, IEEE Transactions on Automatic Control 40(3), 1995",
    says: "the arm drags with the same force at every speed, and the force turns round with the motion",
    confused_with: &["pivot_friction", "backlash", "dead_band", "torque_ripple"],
    experiment: "constant-velocity moves in both directions at six speeds over two decades",
    band_hz: [1.0, 300.0],
};

/// Speeds over which a creeping drag turns round, over the highest: a slower one is dry, a faster one all but viscous.
const CREEP: [f64; 2] = [1e-3, 0.3];

/// Speeds (over the highest) and sizes of a rise within which a fuller form is fitted.
const RISES_WITHIN: [f64; 2] = [3e-4, 0.5];
const RISES: [f64; 2] = [0.005, 3.0];
/// Speeds from which a rise sets out, so many of them, and its first size: a large rise at once would hold an arm that is driven with little more than
/// its friction, and no fit comes back from there.
const RISES_FROM: [f64; 2] = [1e-3, 0.1];
const RISING: usize = 3;
const FIRST_RISE: f64 = 0.02;
/// Lengths of bristles that are tried in the place of a film.
const BRISTLES: usize = 3;

/// Lengths to a doubling.
const OCTAVE: f64 = 1.34;

/// Shortest length that a simulation is fitted with, over the shortest of the grid.
const DRIER: f64 = 0.02;

/// What sticks: Dahl's law with a short length.
struct Slider {
    length: f64,
    stribeck: Option<Stribeck>,
    z: f64,
}

/// Drag at a speed over its level at high speed.
fn level(stribeck: Option<Stribeck>, v: f64) -> f64 {
    stribeck.map_or(1.0, |s| 1.0 + s.rise * (-(v / s.speed).powi(2)).exp())
}

/// The mean of z over a straight path that begins with it, towards `most`: s - (s - z0) (1 - exp(-r))/r with r the path in lengths.
fn mean(z: f64, dx: f64, length: f64, most: f64) -> f64 {
    let (path, s) = (dx.abs() / length, dx.signum() * most);
    match path {
        p if p < 1e-6 => z + 0.5 * p * (s - z),
        p if p > SLID => s - (s - z) / p,
        p => s + (s - z) * (-p).exp_m1() / p,
    }
}

impl Law for Slider {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let mean = mean(self.z, to.x - from.x, self.length, 1.0);
        out[0] = -mean * level(self.stribeck, 0.5 * (from.v + to.v));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.went(to.x - from.x);
    }

    fn went(&mut self, way: f64) {
        self.z = dahl(self.z, way, self.length);
    }
}

/// What sticks on damped bristles: LuGre's law. `z` is the stretch of the bristles over that at which they slip at speed.
struct Bristles {
    length: f64,
    time_s: f64,
    stribeck: Option<Stribeck>,
    z: f64,
}

impl Bristles {
    /// The stretch after a step, and what they stretch to: the speed over the step is its mean.
    fn moved(&self, from: &Sample, to: &Sample) -> [f64; 2] {
        let most = level(self.stribeck, 0.5 * (from.v + to.v));
        [most * dahl(self.z / most, to.x - from.x, most * self.length), most]
    }
}

impl Law for Bristles {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let [z, most] = self.moved(from, to);
        let mean = mean(self.z, to.x - from.x, most * self.length, most);
        out[0] = -mean - self.time_s * bristle_rate([self.z, z], from, to);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.z = self.moved(from, to)[0];
    }

    fn went(&mut self, way: f64) {
        self.z = dahl(self.z, way, self.length);
    }
}

/// What creeps: a film that shears.
struct Film {
    speed: f64,
    stribeck: Option<Stribeck>,
    /// Speed from which a step was asked for last, and what it comes to: a step is tried several times.
    last: Cell<[f64; 2]>,
}

impl Law for Film {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        // Simpson's rule; the sign turns round over more than one sample.
        let at = |v: f64| (v / self.speed).tanh();
        if self.last.get()[0] != from.v {
            self.last.set([from.v, at(from.v)]);
        }
        let mean = (self.last.get()[1] + 4.0 * at(0.5 * (from.v + to.v)) + at(to.v)) / 6.0;
        out[0] = -mean * level(self.stribeck, 0.5 * (from.v + to.v));
    }
}

/// Shortest and longest length: up to that from which on pre-sliding friction is told by its loop.
fn lengths(scene: &MotionScene) -> [f64; 2] {
    [(1.5 * scene.noise).max(3e-6 * scene.travel), shortest_loop(scene)]
}

impl CoulombFriction {
    /// A drag that sticks over a length (position_unit), with a rise at low speed or without.
    pub fn sticking(sliding_length: f64, stribeck: Option<Stribeck>) -> CoulombFriction {
        CoulombFriction { turning: Turning::Length { sliding_length }, stribeck, bristle_time_s: None }
    }

    /// A drag that creeps over a speed (position_unit/s).
    pub fn creeping(speed: f64) -> CoulombFriction {
        CoulombFriction { turning: Turning::Creep { speed }, stribeck: None, bristle_time_s: None }
    }
}

impl Parametric for CoulombFriction {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn acts_on_body() -> bool {
        true
    }

    fn shown_over() -> ShownOver {
        ShownOver::Loop
    }

    fn finer_simulated(place: usize) -> Option<f64> {
        (place == 0).then_some(DRIER)
    }

    fn grid(scene: &MotionScene) -> Vec<CoulombFriction> {
        let [short, long] = lengths(scene);
        let count = 1 + (OCTAVE * (long / short).log2()).ceil().max(4.0) as usize;
        let plain = |length| CoulombFriction::sticking(length, None);
        let mut all: Vec<CoulombFriction> = logarithmic(short, long, count).into_iter().map(plain).collect();
        // A rise that reaches up to the highest speed is no rise but the level.
        let rises = logarithmic(0.015, 0.2, 4);
        let rising =
            |l: f64, v: f64| CoulombFriction::sticking(l * long, Some(Stribeck { speed: v * scene.speed, rise: 0.5 }));
        all.extend([0.25, 0.5].iter().flat_map(|l| rises.iter().map(move |v| rising(*l, *v))));
        let creeps = logarithmic(CREEP[0] * scene.speed, CREEP[1] * scene.speed, 8);
        all.extend(creeps.into_iter().map(CoulombFriction::creeping));
        all
    }

    /// A film as bristles; these with Stribeck's rise, with damping. One after the other makes all.
    fn fuller(&self, scene: &MotionScene) -> Vec<(CoulombFriction, Vec<[f64; 2]>)> {
        let ([short, long], [slow, fast]) = (lengths(scene), RISES_FROM);
        let rising = |share: f64| {
            let stribeck = Some(Stribeck { speed: share * scene.speed, rise: FIRST_RISE });
            CoulombFriction { stribeck, ..self.clone() }
        };
        let damped = || CoulombFriction { bristle_time_s: Some(scene.sample_time_s), ..self.clone() };
        let all: Vec<CoulombFriction> = match (self.turning, self.stribeck) {
            (Turning::Creep { .. }, _) => {
                logarithmic(short, long, BRISTLES).into_iter().map(|l| CoulombFriction::sticking(l, None)).collect()
            }
            (Turning::Length { .. }, rises) => {
                let rises =
                    rises.map_or_else(|| logarithmic(slow, fast, RISING), |_| Vec::new()).into_iter().map(rising);
                rises.chain(self.bristle_time_s.is_none().then(damped)).collect()
            }
        };
        let of = |range: [f64; 2], by: f64| range.map(|v| by * v);
        let ranges = vec![[short, long], of(RISES_WITHIN, scene.speed), RISES, of(BRISTLE_TIMES, scene.sample_time_s)];
        all.into_iter().map(|law| (law, ranges.clone())).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        let (Turning::Length { sliding_length: over } | Turning::Creep { speed: over }) = &mut self.turning;
        let (speed, rise) = self.stribeck.as_mut().map(|s| (&mut s.speed, &mut s.rise)).unzip();
        vec![Some(over), speed, rise, self.bristle_time_s.as_mut()]
    }

    fn class(&self) -> Vec<usize> {
        vec![usize::from(matches!(self.turning, Turning::Creep { .. }))]
    }

    fn in_motion(&self, _scene: &MotionScene) -> Box<dyn Law> {
        let stribeck = self.stribeck;
        match self.turning {
            Turning::Length { sliding_length: length } => match self.bristle_time_s {
                Some(time_s) => Box::new(Bristles { length, time_s, stribeck, z: 0.0 }),
                None => Box::new(Slider { length, stribeck, z: 0.0 }),
            },
            Turning::Creep { speed } => Box::new(Film { speed, stribeck, last: Cell::new([f64::NAN; 2]) }),
        }
    }

    fn is_drag() -> bool {
        true
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    fn stiffness(&self, strengths: &[f64]) -> f64 {
        // A creeping drag holds by its speed, and is no spring.
        let Turning::Length { sliding_length } = self.turning else { return 0.0 };
        // A rise inside the bristles makes them stretch farther, not stiffer.
        let rise = 1.0 + self.stribeck.filter(|_| self.bristle_time_s.is_none()).map_or(0.0, |s| s.rise);
        rise * strengths.first().copied().unwrap_or(0.0).abs() / sliding_length
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        let mut all = vec![
            LEVEL_COMMAND.at(strengths[0]),
            match self.turning {
                Turning::Length { sliding_length } => SLIDING_LENGTH.at(sliding_length),
                Turning::Creep { speed } => CREEP_SPEED.at(speed),
            },
        ];
        if let Some(Stribeck { speed, rise }) = self.stribeck {
            all.push(STRIBECK_SPEED.at(speed));
            all.push(STRIBECK_RISE.at(rise));
        }
        all.extend(self.bristle_time_s.map(|time| BRISTLE_TIME_S.at(time)));
        all
    }

    fn is_possible(&self, strengths: &[f64], _errors: &[f64]) -> bool {
        strengths.first().is_some_and(|s| *s > 0.0)
    }

    /// Laws of dry friction that fit the same records (Dahl, LuGre, bristles) differ in their level by some hundredths.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.03
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(CoulombFriction, Vec<f64>), PhysicsError> {
        let turning = if let Some(speed) = given.get(&CREEP_SPEED)? {
            Turning::Creep { speed }
        } else {
            let dry = (6.0 * scene.noise).max(1e-5 * scene.travel);
            Turning::Length { sliding_length: given.or_else(&SLIDING_LENGTH, dry)? }
        };
        let rising = given
            .has(&STRIBECK_SPEED)
            .then(|| Ok(Stribeck { speed: given.need(&STRIBECK_SPEED)?, rise: given.need(&STRIBECK_RISE)? }));
        let bristle_time_s = bristle_time_of(given)?;
        if let (Turning::Creep { .. }, Some(time)) = (turning, bristle_time_s) {
            return Err(given.refused(&BRISTLE_TIME_S, time));
        }
        let law = CoulombFriction { turning, stribeck: rising.transpose()?, bristle_time_s };
        Ok((law, vec![given.need(&LEVEL_COMMAND)?]))
    }
}
