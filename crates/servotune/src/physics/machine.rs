//! A machine in motion: the exactly sampled plant with effects at their places, one controller sample at a time.
//!
//! A torque depends on the motion that it causes: each step solves w = law(x + g w) for the mean torque w over the sample, by
//! secants and, where a stiff contact makes those crawl, within a bracket. Second order in the step; where a law is so stiff that
//! arm and law swing within few samples (a dry drag that holds), a sample is made in several steps.

use super::effect::{COLUMNS, Entry, Law, Port};
use super::library::LawSetting;
use super::sample::{MotionScene, Sample};
use crate::lti::{DiscretePlant, Intersample, LtiError, Plant, PlantState};
use crate::numeric::root::bracketed_root;

struct Part {
    law: Box<dyn Law>,
    strengths: Vec<f64>,
    /// Whether the head moves by it: what the sensor alone adds, the head does not see.
    head: bool,
}

impl Part {
    fn value(&self, from: &Sample, to: &Sample) -> f64 {
        if let [strength] = self.strengths[..] {
            let mut out = [0.0];
            self.law.columns(from, to, &mut out);
            return strength * out[0];
        }
        let mut out = [0.0; COLUMNS];
        self.law.columns(from, to, &mut out[..self.strengths.len()]);
        out.iter().zip(&self.strengths).map(|(c, s)| c * s).sum()
    }
}

/// One simulated machine, from rest at position 0.
///
/// Order of calls for sample k: [`SimulatedMachine::measure`], then [`SimulatedMachine::command`].
pub struct SimulatedMachine {
    delayed: DiscretePlant,
    /// The same without delay, sampled at the steps of the torque.
    direct: DiscretePlant,
    pushed: PlantState,
    torqued: PlantState,
    /// As they were when the last command was taken, for instants before the next sample; the torque's at every step. Copied where they are
    /// needed: for readings, and the command's between the steps of a sample.
    held: PlantState,
    held_torqued: Vec<PlantState>,
    /// Whether positions between samples are read.
    read: bool,
    /// Readings of the command's answer at the steps between two samples.
    steps_between: Vec<Intersample>,
    /// What the position effects add at the head at this sample.
    offset: f64,
    /// Position that a unit torque adds within one step.
    reach: f64,
    /// One over two steps of the torque (1/s).
    per_two_steps: f64,
    /// The last two positions at steps of the torque, and the speed as the last step ended.
    path: [f64; 2],
    speed: f64,
    command: Vec<Part>,
    torque: Vec<Part>,
    position: Vec<Part>,
    /// Commands behind the amplifier, newest last; as many as the delay needs.
    history: Vec<f64>,
    last: Sample,
    now: Sample,
    x: [f64; 3],
    /// The torque of the last two steps, and how much of a change of it its law gave back.
    w: [f64; 2],
    echo: f64,
    k: usize,
    /// When it began in its session (s).
    began_s: f64,
    origin: f64,
    /// Command behind the amplifier and torque under which it stood at `origin`: only what differs from them moves it.
    standing: [f64; 2],
    /// A motion that neither command nor law makes (a start in full swing, a hum), a value per sample; 0 behind its end.
    free: Vec<f64>,
    /// The arm's own position over the recorded one.
    arm: f64,
}

/// Most rounds of two points of a law, and its echo from which on it is bracketed.
const ROUNDS: usize = 6;
const ECHOES: f64 = 0.3;
/// Share of the torque within which it is found, and share by which a law's echo bends over the last move.
const EXACT: f64 = 1e-9;
const BENDS: f64 = 0.01;
/// Share of the torque within which it is found in a bracket, and half the bracket where a law does not resist, over that torque.
const CLOSE: f64 = 1e-10;
const WIDE: f64 = 4.0;
/// Farthest that arm and stiffest law swing within one step (rad), and most steps of a sample: errors go with the square of it.
const SWING: f64 = 0.2;
const MOST_STEPS: usize = 16;

/// Where a position between two samples is read: see [`SimulatedMachine::reading`].
#[derive(Clone, Debug)]
pub struct Reading {
    command: Intersample,
    torque: Intersample,
    /// The step of the torque that it falls into.
    step: usize,
}

/// Steps of a sample that a plant needs with these effects; a power of two, so that few changes of their numbers change it.
fn steps(plant: &Plant, effects: &[&LawSetting], t: f64) -> Result<usize, LtiError> {
    let stiffest = effects.iter().map(|s| s.stiffness()).fold(0.0f64, f64::max);
    if stiffest <= 0.0 {
        return Ok(1);
    }
    let direct = DiscretePlant::of(&Plant { delay_s: 0.0, ..plant.clone() }, t)?;
    // A unit torque moves a free arm by b T²/2 within a sample.
    let swing = (2.0 * stiffest * reach(&direct).abs()).sqrt();
    let mut steps = 1;
    while steps < MOST_STEPS && swing > SWING * steps as f64 {
        steps *= 2;
    }
    Ok(steps)
}

/// Position that a unit torque adds within one sample of a plant.
fn reach(direct: &DiscretePlant) -> f64 {
    let mut unit = PlantState::at_rest(direct);
    unit.command(1.0);
    unit.advance(direct);
    unit.position()
}

impl SimulatedMachine {
    /// The same machine, at rest at `origin` under a standing command, springs and cables in balance, instead of at 0.
    pub fn started_at(mut self, origin: f64, command: f64) -> SimulatedMachine {
        self.origin = origin;
        self.x = [origin; 3];
        self.path = [origin; 2];
        let still = Sample { x: origin, u: command, i: command, ..Sample::default() };
        (self.last, self.now) = (still, still);
        let value = |parts: &[Part], at: &Sample| parts.iter().map(|p| p.value(at, at)).sum::<f64>();
        self.standing[0] = command + value(&self.command, &still);
        let arm = still.scaled(self.arm);
        self.standing[1] = value(&self.torque, &arm);
        self.w = [self.standing[1]; 2];
        self.history.fill(self.standing[0]);
        self
    }

    /// The same machine, started that long after its session began (s).
    pub fn begun_at(self, session_s: f64) -> SimulatedMachine {
        SimulatedMachine { began_s: session_s, ..self }
    }

    /// The same machine, started at rest but not in balance: beside command and laws a constant torque acts (command_unit).
    pub fn held_by(mut self, torque: f64, gain_at_rest: f64) -> SimulatedMachine {
        let spring = if gain_at_rest.is_finite() && gain_at_rest != 0.0 { self.origin / gain_at_rest } else { 0.0 };
        self.standing = [spring - torque, 0.0];
        self.w = [0.0; 2];
        self
    }

    /// The same machine with a motion that neither command nor law makes: the answer to a start in full swing or to a hum
    /// (position_unit, a value per sample). The laws feel it.
    pub fn carried_by(mut self, free: Vec<f64>) -> SimulatedMachine {
        if let [first, second, ..] = free[..] {
            // The positions before the first sample, for the speed there.
            self.x = [0.0, 1.0, 2.0].map(|k| self.x[0] + first + k * (first - second));
            let step = (first - second) / self.held_torqued.len() as f64;
            self.path = [self.x[0], self.x[0] + step];
            self.speed = -step / self.direct.sample_time_s();
        }
        self.free = free;
        self
    }

    /// The same machine, its laws led along the turns before it began to where it begins.
    pub fn led_by(mut self, turned: &[f64]) -> SimulatedMachine {
        let (begins, scale) = (self.x[0], self.arm);
        self.torque.iter_mut().for_each(|p| p.law.led(turned, begins, scale));
        self
    }

    /// A machine with these effects; `scene` says what the laws need to know of it.
    pub fn new(plant: &Plant, effects: &[&LawSetting], scene: &MotionScene) -> Result<SimulatedMachine, LtiError> {
        let t = scene.sample_time_s;
        let steps = steps(plant, effects, t)?;
        let delayed = DiscretePlant::of(plant, t)?;
        let direct = DiscretePlant::of(&Plant { delay_s: 0.0, ..plant.clone() }, t / steps as f64)?;
        let (pushed, torqued) = (PlantState::at_rest(&delayed), PlantState::at_rest(&direct));
        let (mut command, mut torque, mut position) = (Vec::new(), Vec::new(), Vec::new());
        for setting in effects {
            let facts = setting.facts();
            let part = Part {
                law: setting.law.in_motion(scene),
                strengths: setting.strengths.clone(),
                head: facts.port != Port::Sensor,
            };
            match facts.entry {
                Entry::Command => command.push(part),
                Entry::Torque => torque.push(part),
                Entry::Position => position.push(part),
            }
        }
        let history = vec![0.0; delayed.whole_delay_samples() + 2];
        Ok(SimulatedMachine {
            reach: reach(&direct),
            per_two_steps: (2.0 * direct.sample_time_s()).recip(),
            path: [0.0; 2],
            speed: 0.0,
            held: pushed.clone(),
            held_torqued: vec![torqued.clone(); steps],
            steps_between: (1..steps).map(|j| delayed.intersample(t * j as f64 / steps as f64)).collect(),
            read: false,
            offset: 0.0,
            delayed,
            direct,
            pushed,
            torqued,
            command,
            torque,
            position,
            history,
            last: Sample::default(),
            now: Sample::default(),
            x: [0.0; 3],
            w: [0.0; 2],
            echo: 0.0,
            k: 0,
            began_s: 0.0,
            origin: 0.0,
            standing: [0.0; 2],
            free: Vec::new(),
            arm: scene.arm_over_record(),
        })
    }

    /// The position as the sensor gives it at this sample, without noise (position_unit).
    pub fn measure(&mut self, spindle_rad: f64, temperature: f64) -> f64 {
        let t = self.delayed.sample_time_s();
        let torqued = if self.torque.is_empty() { 0.0 } else { self.torqued.position() };
        let x = self.origin + self.pushed.position() + torqued + self.free.get(self.k).unwrap_or(&0.0);
        self.x = [x, self.x[0], self.x[1]];
        // Second-order backward difference.
        let v = (3.0 * self.x[0] - 4.0 * self.x[1] + self.x[2]) / (2.0 * t);
        let time = self.k as f64 * t;
        let (u, i) = (self.last.u, self.last.i);
        self.now = Sample { t: time, session: self.began_s + time, x, v, u, i, spindle_rad, temperature };
        let mut y = x;
        self.offset = 0.0;
        for part in &mut self.position {
            let added = part.value(&self.last, &self.now);
            y += added;
            self.offset += if part.head { added } else { 0.0 };
            part.law.commit(&self.last, &self.now);
        }
        y
    }

    /// What the position effects add at the head at the sample last measured: everything but the sensor's own errors.
    pub fn head_offset(&self) -> f64 {
        self.offset
    }

    /// How [`SimulatedMachine::between`] reads the position `offset_s` after a sample, 0 <= offset < T; from the next command on it can.
    pub fn reading(&mut self, offset_s: f64) -> Reading {
        self.read = true;
        let step_s = self.direct.sample_time_s();
        let step = ((offset_s / step_s) as usize).min(self.held_torqued.len() - 1);
        let torque = self.direct.intersample(offset_s - step as f64 * step_s);
        Reading { command: self.delayed.intersample(offset_s), torque, step }
    }

    /// Position of the arm between the last sample and the next, after [`SimulatedMachine::command`].
    ///
    /// Exact for the command. The torque is taken at its mean over each step: second order in it.
    pub fn between(&self, at: &Reading) -> f64 {
        self.origin + self.held.between(&at.command) + self.held_torqued[at.step].between(&at.torque)
    }

    /// Takes the command of this sample (controller plus excitation) and moves on to the next.
    pub fn command(&mut self, u: f64) {
        self.now.u = u;
        let mut acting = u;
        for part in &mut self.command {
            acting += part.value(&self.last, &self.now);
            part.law.commit(&self.last, &self.now);
        }
        let n = self.history.len();
        self.history.copy_within(1.., 0);
        self.history[n - 1] = acting;
        let share = self.delayed.fractional_delay_s() / self.delayed.sample_time_s();
        self.now.i = share * self.history[0] + (1.0 - share) * self.history[1];
        self.pushed.command(acting - self.standing[0]);
        if self.read || !self.steps_between.is_empty() {
            self.held.clone_from(&self.pushed);
        }
        self.pushed.advance(&self.delayed);
        // Without a torque its part stays at rest.
        if !self.torque.is_empty() {
            self.turn();
        }
        self.last = self.now;
        self.k += 1;
    }

    /// Moves on to the next sample under the torques, step by step.
    fn turn(&mut self) {
        let steps = self.held_torqued.len();
        let mut from = self.now;
        if steps > 1 {
            from.v = self.speed;
        }
        self.path = [self.x[0], if steps > 1 { self.path[1] } else { self.x[1] }];
        for j in 0..steps {
            let share = (j + 1) as f64 / steps as f64;
            let answer = self.steps_between.get(j).map_or(self.pushed.position(), |at| self.held.between(at));
            let free = |k: usize| self.free.get(k).copied().unwrap_or(0.0);
            let (before, after) = (free(self.k), free(self.k + 1));
            let carried = self.origin + answer + before + share * (after - before);
            let (torque, echo) = self.solve(&from, carried);
            (self.w, self.echo) = ([torque, self.w[0]], echo);
            self.torqued.command(torque - self.standing[1]);
            if self.read {
                self.held_torqued[j].clone_from(&self.torqued);
            }
            self.torqued.advance(&self.direct);
            let to = self.ahead(&from, carried + self.torqued.position());
            let (one, other) = (from.scaled(self.arm), to.scaled(self.arm));
            for part in &mut self.torque {
                part.law.commit(&one, &other);
            }
            self.path = [to.x, self.path[0]];
            self.speed = to.v;
            from = to;
        }
    }

    /// The end of the step, if the arm goes to `x`.
    fn ahead(&self, from: &Sample, x: f64) -> Sample {
        let t = self.direct.sample_time_s();
        let (after, session) = (from.t + t, from.session + t);
        Sample { t: after, session, x, v: self.speed_at(x), ..*from }
    }

    /// The speed there: second-order backward difference.
    fn speed_at(&self, x: f64) -> f64 {
        (3.0 * x - 4.0 * self.path[0] + self.path[1]) * self.per_two_steps
    }

    /// The mean torque over a step that leads to `carried` without it, and the law's echo there.
    fn solve(&self, from: &Sample, carried: f64) -> (f64, f64) {
        let free = carried + self.torqued.after(&self.direct, -self.standing[1]);
        let (one, end) = (from.scaled(self.arm), self.ahead(from, free));
        let law = |w: f64| {
            let x = free + self.reach * w;
            let to = Sample { x: x * self.arm, v: self.speed_at(x) * self.arm, ..end };
            self.torque.iter().map(|p| p.value(&one, &to)).sum::<f64>()
        };
        let near = |by: f64, w: f64| by.abs() <= EXACT * w.abs();
        // Torque and echo go on as they went; a straight law is solved by two points of it.
        let (mut w, mut echo) = (2.0 * self.w[0] - self.w[1], self.echo);
        let rounds = if echo.abs() < ECHOES { ROUNDS } else { 0 };
        for _ in 0..rounds {
            let first = law(w);
            if near(first - w, first) {
                return (first, echo);
            }
            let next = w + (first - w) / (1.0 - echo);
            let second = law(next);
            if near(second - next, second) {
                return (second, echo);
            }
            echo = (second - first) / (next - w);
            if echo.is_nan() || echo.abs() >= ECHOES {
                return self.bracketed(law, second, echo);
            }
            w = next + (second - next) / (1.0 - echo);
            if near(BENDS * (w - next), w) {
                return (w, echo);
            }
        }
        self.bracketed(law, w, echo)
    }

    /// The same where arm and law answer one another too strongly, or the law has a kink there: by a bracket around the root. The echo is that of
    /// its ends.
    fn bracketed(&self, law: impl Fn(f64) -> f64, w: f64, echo: f64) -> (f64, f64) {
        let near = w - law(w);
        let size = w.abs().max(near.abs()).max(f64::MIN_POSITIVE);
        let off = |w: f64| Some(w - law(w)).filter(|o| o.is_nan() || o.abs() > CLOSE * size).unwrap_or(0.0);
        if near.abs() <= CLOSE * size {
            return (w, echo);
        }
        // w - law(w) rises with w for every law that resists motion, and at least as fast as w: from any place its own height leads past the root.
        let ends = |a: f64, b: f64| [a.min(b), a.max(b)].map(|w| (w, off(w)));
        let tight = ends(w, w - near);
        let echo = 1.0 - (tight[1].1 - tight[0].1) / near.abs();
        let holds = |[low, high]: &[(f64, f64); 2]| low.1 <= 0.0 && high.1 >= 0.0;
        let wide = || Some(ends(-WIDE * size, WIDE * size)).filter(holds);
        let Some([(low, under), (high, over)]) = Some(tight).filter(holds).or_else(wide) else { return (w, 0.0) };
        (bracketed_root(off, low, under, high, over, CLOSE * size), echo)
    }
}
