//! The bearing remembers the last moves: its lubricant is pushed aside and pulls back, more after longer moves.
//!
//! b' = -(b - B sat(L/L_c) sgn)/tau_b, L the length of the last move and sgn its direction (after Helmick, Messner, Higgs 2008,
//! who saw the torque after a seek grow with the seek's length up to a critical one); tau = -b. A way back shorter than a
//! smallest one is no new move.

use super::effect::{Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
use super::key::{Key, Measure, Prior, ScanEnd};
use super::parameter::{Parameter, Unit};
use super::sample::{MotionScene, Sample, logarithmic};

/// The bearing's memory. Its strength is the largest bias B.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingBias {
    /// Length of a move beyond which its bias grows no further (position_unit), above 0.
    pub critical_length: f64,
    /// Time constant of the bias (s), above 0.
    pub relaxation_time_s: f64,
    /// Shortest way back that begins a new move (position_unit).
    pub shortest_move: f64,
}

const BIAS_COMMAND: Key = Key::new("bias_command", Unit::Command, "largest bias, B");
const CRITICAL_LENGTH: Key = Key::new("critical_length", Unit::Position, "move beyond which the bias grows no further")
    .positive()
    .scan(ScanEnd::At(0.15, Measure::Travel), ScanEnd::At(1.5, Measure::Travel));
const RELAXATION_TIME_S: Key = Key::new("relaxation_time_s", Unit::Second, "time constant of the bias")
    .positive()
    .scan(ScanEnd::At(0.01, Measure::Record), ScanEnd::At(3.0, Measure::Record));
const SHORTEST_MOVE: Key = Key::new("shortest_move", Unit::Position, "way back that begins a new move")
    .or_else("max(6 noise, 0.0001 travel)")
    .prior(Prior::Words("max(6 noise, 0.0001 travel), 5 and 25 times that, up to 0.1 travel"));

/// What is known beforehand.
pub static FACTS: Facts = Facts {
    name: "bearing_bias",
    port: Port::Torque,
    entry: Entry::Torque,
    columns: 1,
    fixed: false,
    per_record: false,
    equation: "tau = -b, b' = -(b - B sat(L/L_c) sgn(last move))/tau_b",
    keys: &[BIAS_COMMAND, CRITICAL_LENGTH, RELAXATION_TIME_S, SHORTEST_MOVE],
    source: "M. T. Helmick, W. C. Messner, C. F. Higgs, on pivot bias and lubrication, Microsystem Technologies, 2008",
    says: "after a long move the bearing pulls the arm back for a while; after a short one it does so less",
    confused_with: &["cable_spring", "pivot_friction", "offset_drift"],
    experiment: "the same target reached by moves of five lengths from both sides, then half a second of rest",
    band_hz: [0.1, 30.0],
};

#[derive(Clone, Copy)]
struct Move {
    /// Where the move began and the farthest point it has reached.
    start: f64,
    reached: f64,
    /// Its direction; 0 before the first move.
    direction: f64,
    bias: f64,
}

struct Memory {
    critical: f64,
    /// A way back shorter than this is no new move (position_unit).
    smallest: f64,
    keep: f64,
    mean: f64,
    now: Option<Move>,
}

impl Memory {
    /// The move after the step, its bias not yet updated.
    fn moved(&self, from: &Sample, to: &Sample) -> Move {
        let mut m = self.now.unwrap_or(Move { start: from.x, reached: from.x, direction: 0.0, bias: 0.0 });
        let way = to.x - m.reached;
        if m.direction == 0.0 {
            if way.abs() > self.smallest {
                (m.direction, m.reached) = (way.signum(), to.x);
            }
        } else if way * m.direction > 0.0 {
            m.reached = to.x;
        } else if way.abs() > self.smallest {
            m = Move { start: m.reached, reached: to.x, direction: -m.direction, bias: m.bias };
        }
        m
    }

    fn target(&self, m: &Move) -> f64 {
        m.direction * ((m.reached - m.start).abs() / self.critical).min(1.0)
    }
}

impl Law for Memory {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let m = self.moved(from, to);
        let target = self.target(&m);
        out[0] = -(target + (m.bias - target) * self.mean);
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        let mut m = self.moved(from, to);
        let target = self.target(&m);
        m.bias = target + (m.bias - target) * self.keep;
        self.now = Some(m);
    }
}

impl Parametric for BearingBias {
    fn known() -> &'static Facts {
        &FACTS
    }

    fn shown_over() -> ShownOver {
        ShownOver::Loop
    }

    fn grid(scene: &MotionScene) -> Vec<BearingBias> {
        let times = logarithmic(0.01 * scene.duration_s, 3.0 * scene.duration_s, 6);
        let shortest = (6.0 * scene.noise).max(1e-4 * scene.travel);
        let ways = [shortest, 5.0 * shortest, 25.0 * shortest].map(|w| w.min(0.1 * scene.travel));
        let lengths = [0.15, 0.5, 1.5].map(|share| share * scene.travel);
        let at = |tau: f64| {
            lengths.iter().flat_map(move |&l| {
                ways.map(|w| BearingBias { critical_length: l, relaxation_time_s: tau, shortest_move: w })
            })
        };
        times.iter().flat_map(|&tau| at(tau)).collect()
    }

    fn numbers_mut(&mut self) -> Vec<Option<&mut f64>> {
        vec![Some(&mut self.critical_length), Some(&mut self.relaxation_time_s), Some(&mut self.shortest_move)]
    }

    fn in_motion(&self, scene: &MotionScene) -> Box<dyn Law> {
        let ratio = scene.sample_time_s / self.relaxation_time_s;
        let mean = -(-ratio).exp_m1() / ratio;
        Box::new(Memory {
            critical: self.critical_length,
            smallest: self.shortest_move,
            keep: (-ratio).exp(),
            mean,
            now: None,
        })
    }

    fn parameters(&self, strengths: &[f64], _scene: &MotionScene) -> Vec<Parameter> {
        vec![
            BIAS_COMMAND.at(strengths[0]),
            CRITICAL_LENGTH.at(self.critical_length),
            RELAXATION_TIME_S.at(self.relaxation_time_s),
            SHORTEST_MOVE.at(self.shortest_move),
        ]
    }

    /// Bearings and cables hold to their laws to about a hundredth.
    fn form_uncertainty(&self, _parameter: &str) -> f64 {
        0.01
    }

    fn setting_of(given: &Given, scene: &MotionScene) -> Result<(BearingBias, Vec<f64>), PhysicsError> {
        let shortest_move = given.or_else(&SHORTEST_MOVE, (6.0 * scene.noise).max(1e-4 * scene.travel))?;
        let (critical_length, relaxation_time_s) = (given.need(&CRITICAL_LENGTH)?, given.need(&RELAXATION_TIME_S)?);
        let law = BearingBias { critical_length, relaxation_time_s, shortest_move };
        Ok((law, vec![given.need(&BIAS_COMMAND)?]))
    }
}
