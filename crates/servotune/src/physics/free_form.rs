//! A curve without a name: what no law of the library holds, as it was estimated at one port of the machine.
//!
//! A natural cubic spline through knots. Beyond the first and the last nothing was seen: a torque and a gain stay there as they were last,
//! an amplifier and a sensor go on straight. At the amplifier a first-order lag may follow. Over the way since the last turn it is a loading
//! curve, linear between knots and level behind the last: a row of springs that slide, one at each knot (Iwan 1966; generalised Maxwell
//! slip, Al-Bender, Lampaert, Swevers 2005), whose loops follow Masing's rule. Over position and velocity at once it is a surface (`knots`).
//! One curve for each port, all under the name `free_form`; the search of the library leaves them out (`specs/mismatch.md`, "Curves without
//! a name").

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port};
use super::key::{Key, Prior};
use super::knots::{Knots, Surface};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample};
use super::share::Share;
use super::sliders::{Loading, Sliders, slider_stiffness};
use crate::lti::{CurveEntry, CurveKnot, PhysicsEntry};
use crate::numeric::spline::Spline;
use std::cell::Cell;

/// Where a curve acts and what it goes over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurvePort {
    /// Torque added (command_unit) over the arm's position.
    TorqueOverPosition,
    /// Torque added (command_unit) over the arm's velocity.
    TorqueOverVelocity,
    /// Torque added (command_unit) over the arm's position and velocity: a friction that changes along the stroke, a drag of one direction.
    TorqueOverMotion,
    /// Torque that resists (command_unit) over the way of the arm since it first moved: the loading curve of a hysteresis.
    TorqueOverLoading,
    /// Torque added (command_unit) over the time since the start of each record (s): what comes with every record at its own time.
    TorqueOverTime,
    /// What acts (command_unit) over the command.
    AmplifierOverCommand,
    /// Torque per command over the arm's position.
    GainOverPosition,
    /// Torque per command over the time of the session (s).
    GainOverTime,
    /// What is read (position_unit) over the position.
    SensorOverPosition,
}

/// A curve at one port.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeForm {
    /// Where it acts and what it goes over.
    pub port: CurvePort,
    /// Where its values stand, in the unit of the argument.
    pub knots: Knots,
    /// Values there, one a knot, in the unit of the port.
    pub value: Vec<f64>,
    /// Time constant of the lag that follows an amplifier's curve (s), above 0; none without one.
    pub lag_s: Option<f64>,
}

const fn made(part: Port, entry: Entry, equation: &'static str) -> Facts {
    Facts {
        name: "free_form",
        port: part,
        entry,
        columns: 1,
        fixed: true,
        per_record: false,
        equation,
        keys: &[LAG],
        source: "P. J. Green, B. W. Silverman, Nonparametric Regression and Generalized Linear Models, 1994; loading curves: W. D. Iwan, A Distributed-Element Model for Hysteresis and Its Steady-State Dynamic Response, Journal of Applied Mechanics 33(4), 1966",
        says: "something acts along a curve that has no name in the library",
        confused_with: &[],
        experiment: "the same moves at three sizes, and slow ramps over the whole range in both directions",
        band_hz: [0.1, 3000.0],
    }
}

static TORQUE_OVER_POSITION: Facts = made(Port::Torque, Entry::Torque, "tau = u + f(x), f a natural cubic spline");
static TORQUE_OVER_VELOCITY: Facts = made(Port::Torque, Entry::Torque, "tau = u + f(x'), f a natural cubic spline");
static TORQUE_OVER_MOTION: Facts =
    made(Port::Torque, Entry::Torque, "tau = u + f(x, x'), f a cubic spline over x, straight between velocities");
static AMPLIFIER_OVER_COMMAND: Facts = made(Port::Amplifier, Entry::Command, "i = f(u), f a natural cubic spline");
static GAIN_OVER_POSITION: Facts = made(Port::Torque, Entry::Torque, "tau = f(x) u, f a natural cubic spline");
static GAIN_OVER_TIME: Facts = made(Port::Torque, Entry::Torque, "tau = f(t) u, f a natural cubic spline");
static TORQUE_OVER_TIME: Facts =
    made(Port::Torque, Entry::Torque, "tau = u + f(t), f a natural cubic spline, t from the start of a record");
static TORQUE_OVER_LOADING: Facts = made(
    Port::Torque,
    Entry::Torque,
    "tau = u - sum k_j z_j, z_j = clip(z_j + dx, -d_j, d_j): a row of springs that slide, first loading f(d) linear between knots",
);
static SENSOR_OVER_POSITION: Facts = made(Port::Sensor, Entry::Position, "m = f(x), f a natural cubic spline");

impl CurvePort {
    /// All of them.
    pub const ALL: [CurvePort; 9] = [
        CurvePort::TorqueOverPosition,
        CurvePort::TorqueOverVelocity,
        CurvePort::TorqueOverLoading,
        CurvePort::TorqueOverTime,
        CurvePort::AmplifierOverCommand,
        CurvePort::GainOverPosition,
        CurvePort::GainOverTime,
        CurvePort::TorqueOverMotion,
        CurvePort::SensorOverPosition,
    ];

    /// What is known of a curve at this port.
    pub fn known(self) -> &'static Facts {
        match self {
            CurvePort::TorqueOverPosition => &TORQUE_OVER_POSITION,
            CurvePort::TorqueOverVelocity => &TORQUE_OVER_VELOCITY,
            CurvePort::TorqueOverMotion => &TORQUE_OVER_MOTION,
            CurvePort::TorqueOverLoading => &TORQUE_OVER_LOADING,
            CurvePort::TorqueOverTime => &TORQUE_OVER_TIME,
            CurvePort::AmplifierOverCommand => &AMPLIFIER_OVER_COMMAND,
            CurvePort::GainOverPosition => &GAIN_OVER_POSITION,
            CurvePort::GainOverTime => &GAIN_OVER_TIME,
            CurvePort::SensorOverPosition => &SENSOR_OVER_POSITION,
        }
    }

    /// Port and argument as files name them.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            CurvePort::TorqueOverPosition => ["torque", "position"],
            CurvePort::TorqueOverVelocity => ["torque", "velocity"],
            CurvePort::TorqueOverMotion => ["torque", "position_and_velocity"],
            CurvePort::TorqueOverLoading => ["torque", "loading"],
            CurvePort::TorqueOverTime => ["torque", "time"],
            CurvePort::AmplifierOverCommand => ["amplifier", "command"],
            CurvePort::GainOverPosition => ["gain", "position"],
            CurvePort::GainOverTime => ["gain", "time"],
            CurvePort::SensorOverPosition => ["sensor", "position"],
        }
    }

    /// Units of argument, over two of the position, and of the value on a machine with these units.
    pub fn units(self, position: &str, command: &str) -> [String; 2] {
        let speed = format!("{position}/s");
        match self {
            CurvePort::TorqueOverPosition | CurvePort::TorqueOverMotion | CurvePort::TorqueOverLoading => {
                [position.into(), command.into()]
            }
            CurvePort::TorqueOverVelocity => [speed, command.into()],
            CurvePort::AmplifierOverCommand => [command.into(), command.into()],
            CurvePort::GainOverPosition => [position.into(), "1".into()],
            CurvePort::GainOverTime => ["s".into(), "1".into()],
            CurvePort::TorqueOverTime => ["s".into(), command.into()],
            CurvePort::SensorOverPosition => [position.into(), position.into()],
        }
    }

    /// Whether the curve holds the gain of the command: it stands in its place or is a factor of it.
    pub fn is_of_command(self) -> bool {
        matches!(self, CurvePort::AmplifierOverCommand | CurvePort::GainOverPosition | CurvePort::GainOverTime)
    }

    /// The value that changes nothing.
    pub fn idle(self, at: f64) -> f64 {
        match self {
            CurvePort::TorqueOverPosition
            | CurvePort::TorqueOverVelocity
            | CurvePort::TorqueOverMotion
            | CurvePort::TorqueOverLoading
            | CurvePort::TorqueOverTime => 0.0,
            CurvePort::GainOverPosition | CurvePort::GainOverTime => 1.0,
            CurvePort::AmplifierOverCommand | CurvePort::SensorOverPosition => at,
        }
    }

    /// What the curve goes over, at a sample; over two arguments the position; of a loading curve the position, from whose turns on it counts.
    pub fn argument(self, s: &Sample) -> f64 {
        match self {
            CurvePort::TorqueOverVelocity => s.v,
            CurvePort::AmplifierOverCommand => s.u,
            CurvePort::GainOverTime => s.session,
            CurvePort::TorqueOverTime => s.t,
            _ => s.x,
        }
    }

    /// The curve through these values.
    pub fn curve(self, knots: &Knots, value: &[f64]) -> FreeForm {
        FreeForm { port: self, knots: knots.clone(), value: value.to_vec(), lag_s: None }
    }

    /// The entry of a plant file.
    pub fn entry(self, knots: Vec<CurveKnot>, lag_s: Option<f64>, position: &str, command: &str) -> PhysicsEntry {
        let [port, argument] = self.names().map(str::to_owned);
        let [_, unit] = self.units(position, command);
        let curve = Some(CurveEntry { port, argument, unit, knots });
        let parameters = lag_s.map(|lag| (LAG.name.to_owned(), lag)).into_iter().collect();
        PhysicsEntry { effect: FACTS.name.into(), parameters, curve }
    }
}

impl FreeForm {
    /// The spline through the knots of a curve over one argument.
    fn spline(&self) -> Spline {
        Spline::new(self.knots.at.clone(), self.value.clone())
    }

    /// The same curve, its output following it with a lag (s).
    pub fn lagged(self, lag_s: f64) -> FreeForm {
        FreeForm { lag_s: Some(lag_s), ..self }
    }
}

/// The lag behind an amplifier's curve.
const LAG: Key = Key::new("lag_s", Unit::Second, "time constant of a lag behind an amplifier's curve")
    .or_else("no lag")
    .positive()
    .prior(Prior::Words("the estimation of curves"));

/// A plant file's curve; refused by name where its keys make none.
pub(super) fn restored(entry: &PhysicsEntry) -> Result<FreeForm, PhysicsError> {
    let wrong = |what: String| PhysicsError::Curve { effect: entry.effect.clone(), what };
    let curve =
        entry.curve.as_ref().ok_or_else(|| wrong("found no knots; expected port, argument, unit and knots".into()))?;
    let port = CurvePort::ALL.into_iter().find(|p| p.names() == [&*curve.port, &*curve.argument]).ok_or_else(|| {
        let known: Vec<String> = CurvePort::ALL.iter().map(|p| p.names().join(" over ")).collect();
        wrong(format!("found {} over {}; expected one of: {}", curve.port, curve.argument, known.join(", ")))
    })?;
    let lagged = port == CurvePort::AmplifierOverCommand;
    if let Some(parameter) = entry.parameters.keys().find(|k| !lagged || *k != LAG.name) {
        return Err(wrong(format!(
            "parameter `{parameter}` is unknown; expected port, argument, unit and knots, and lag_s for an amplifier"
        )));
    }
    let lag_s = entry.parameters.get(LAG.name).copied();
    if let Some(found) = lag_s.filter(|l| !LAG.takes.takes(*l)) {
        return Err(wrong(format!("{} = {found}; expected {}", LAG.name, LAG.takes.text())));
    }
    let knots = &curve.knots;
    if knots.len() < 2 {
        return Err(wrong(format!("found {} knots; expected at least 2", knots.len())));
    }
    if let Some(k) = knots.iter().find(|k| !k.at.is_finite() || !k.value.is_finite()) {
        return Err(wrong(format!("found a knot at {} with the value {}; expected finite numbers", k.at, k.value)));
    }
    let value = knots.iter().map(|k| k.value).collect();
    let over_two = port == CurvePort::TorqueOverMotion;
    let knots = if over_two { Knots::grid_of(knots) } else { Knots::line_of(knots) }.map_err(wrong)?;
    Ok(FreeForm { port, knots, value, lag_s })
}

struct Curve {
    port: CurvePort,
    spline: Spline,
    lag: Option<Lag>,
    /// Where the last way began, and the value there: a step is tried with several ends.
    began: Cell<[f64; 2]>,
}

/// What follows an amplifier's curve with a first-order lag; what acts is the mean over each interval.
struct Lag {
    /// exp(-T/tau).
    keep: f64,
    /// Mean of exp(-t/tau) over an interval.
    mean: f64,
    current: Option<f64>,
}

impl Lag {
    /// The current at the end of an interval that began with `held`.
    fn arrived(&self, held: f64) -> f64 {
        held + (self.current.unwrap_or(held) - held) * self.keep
    }
}

impl Curve {
    /// The mean of a torque or a gain over a straight way from `a` to `b` (Simpson).
    fn mean(&self, a: f64, b: f64) -> f64 {
        let f = |x| self.spline.held(x);
        let [began, mut first] = self.began.get();
        if began != a {
            first = f(a);
            self.began.set([a, first]);
        }
        (first + 4.0 * f(0.5 * (a + b)) + f(b)) / 6.0
    }
}

impl Law for Surface {
    /// The mean over a straight way (Simpson).
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let middle = self.value(0.5 * (from.x + to.x), 0.5 * (from.v + to.v));
        out[0] = (self.value(from.x, from.v) + 4.0 * middle + self.value(to.x, to.v)) / 6.0;
    }
}

impl Law for Curve {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = match self.port {
            CurvePort::TorqueOverPosition => self.mean(from.x, to.x),
            CurvePort::TorqueOverVelocity => self.mean(from.v, to.v),
            CurvePort::TorqueOverTime => self.mean(from.t, to.t),
            CurvePort::GainOverPosition => (self.mean(from.x, to.x) - 1.0) * from.i,
            CurvePort::GainOverTime => (self.mean(from.session, to.session) - 1.0) * from.i,
            // They have motions of their own (`Loading`, `Surface`).
            CurvePort::TorqueOverLoading | CurvePort::TorqueOverMotion => 0.0,
            CurvePort::AmplifierOverCommand => {
                let wanted = self.spline.value(to.u);
                let late = |lag: &Lag| (lag.arrived(self.spline.value(from.u)) - wanted) * lag.mean;
                wanted + self.lag.as_ref().map_or(0.0, late) - to.u
            }
            CurvePort::SensorOverPosition => self.spline.value(to.x) - to.x,
        };
    }

    fn commit(&mut self, from: &Sample, _to: &Sample) {
        let held = self.spline.value(from.u);
        if let Some(lag) = &mut self.lag {
            lag.current = Some(lag.arrived(held));
        }
    }
}

impl Parametric for FreeForm {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn facts(&self) -> &'static Facts {
        self.port.known()
    }

    /// None: the search of the library does not look for it.
    fn grid(_scene: &MotionScene) -> Vec<FreeForm> {
        Vec::new()
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        if self.port == CurvePort::TorqueOverLoading {
            return Box::new(Loading(Sliders::of(&self.knots.at, &self.value)));
        }
        if self.port == CurvePort::TorqueOverMotion {
            return Box::new(Surface::of(&self.knots, &self.value));
        }
        let made = |tau: f64| {
            let ratio = scene.sample_time_s / tau;
            Lag { keep: (-ratio).exp(), mean: -(-ratio).exp_m1() / ratio, current: None }
        };
        let began = Cell::new([f64::NAN; 2]);
        Box::new(Curve { port: self.port, spline: self.spline(), lag: self.lag_s.map(made), began })
    }

    fn memory_time_s(&self) -> Option<f64> {
        self.lag_s
    }

    /// None: its numbers are knots.
    fn parameters(&self, _strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        Vec::new()
    }

    fn is_hard_nonlinearity() -> bool {
        true
    }

    /// Of a loading curve, its first and steepest part.
    fn stiffness(&self, _strengths: &[f64]) -> f64 {
        let first = || slider_stiffness(&self.knots.at, &self.value).iter().sum::<f64>().max(0.0);
        if self.port == CurvePort::TorqueOverLoading { first() } else { 0.0 }
    }

    /// A reading that turns round does not tell where the arm is.
    fn response_share(&self, _strengths: &[f64], _scene: &MotionScene, _w_rad_s: f64) -> Share {
        if self.port == CurvePort::TorqueOverTime {
            return Share::Outside;
        }
        if self.port == CurvePort::TorqueOverMotion {
            return Share::Cycle;
        }
        let spline = self.spline();
        let rises = |k: &[f64]| spline.slope(k[0]) > 0.0 && spline.slope(0.5 * (k[0] + k[1])) > 0.0;
        let monotone = self.port != CurvePort::SensorOverPosition || spline.at().windows(2).all(rises);
        if monotone { Share::Cycle } else { Share::Blind }
    }

    /// Curves are restored from their knots (`restored`), not from named numbers.
    fn setting_of(_given: &Given, _scene: &MotionScene) -> Result<(FreeForm, Vec<f64>), PhysicsError> {
        Err(PhysicsError::Missing { effect: FACTS.name, parameter: "knots" })
    }
}

/// What is known beforehand of a curve at any port.
pub static FACTS: Facts = made(
    Port::Torque,
    Entry::Torque,
    "a natural cubic spline at one port: torque over position, velocity or both, amplifier over command, gain over position or time, torque over the time of a record, sensor over position; a loading curve over the way since the last turn",
);
