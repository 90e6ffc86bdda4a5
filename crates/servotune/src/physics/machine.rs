//! A machine in motion: the exactly sampled plant with effects at their places, one controller sample at a time.
//!
//! A torque depends on the motion that it causes: each step solves w = law(x + g w) for the mean torque w over the sample, by
//! fixed-point steps and, where a stiff contact makes those crawl, by a bracketed secant. Second order in the sample time.

use super::effect::{COLUMNS, Effect, Entry, Law, Port, Setting};
use super::sample::{Sample, Scene};
use crate::lti::{DiscretePlant, Intersample, LtiError, Plant, PlantState};

struct Part {
    law: Box<dyn Law>,
    strengths: Vec<f64>,
    /// Whether the head moves by it: what the sensor alone adds, the head does not see.
    head: bool,
}

impl Part {
    fn value(&self, from: &Sample, to: &Sample) -> f64 {
        let mut out = [0.0; COLUMNS];
        self.law.columns(from, to, &mut out[..self.strengths.len()]);
        out.iter().zip(&self.strengths).map(|(c, s)| c * s).sum()
    }
}

/// One simulated machine, from rest at position 0.
///
/// Order of calls for sample k: [`Machine::measure`], then [`Machine::command`].
pub struct Machine {
    delayed: DiscretePlant,
    direct: DiscretePlant,
    pushed: PlantState,
    torqued: PlantState,
    /// Both as they were when the last command was taken, for instants before the next sample.
    held: [PlantState; 2],
    /// What the position effects add at the head at this sample.
    offset: f64,
    /// Position that a unit torque adds within one sample.
    reach: f64,
    command: Vec<Part>,
    torque: Vec<Part>,
    position: Vec<Part>,
    /// Commands behind the amplifier, newest last; as many as the delay needs.
    history: Vec<f64>,
    last: Sample,
    now: Sample,
    x: [f64; 3],
    w: f64,
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

/// Fixed-point steps before the secant.
const STEPS: usize = 3;
/// Bisections at most; each halves the bracket.
const BISECTIONS: usize = 60;

impl Machine {
    /// The same machine, at rest at `origin` under a standing command, springs and cables in balance, instead of at 0.
    pub fn started_at(mut self, origin: f64, command: f64) -> Machine {
        self.origin = origin;
        self.x = [origin; 3];
        let still = Sample { x: origin, u: command, i: command, ..Sample::default() };
        (self.last, self.now) = (still, still);
        let value = |parts: &[Part], at: &Sample| parts.iter().map(|p| p.value(at, at)).sum::<f64>();
        self.standing[0] = command + value(&self.command, &still);
        let arm = still.scaled(self.arm);
        self.standing[1] = value(&self.torque, &arm);
        self.w = self.standing[1];
        self.history.fill(self.standing[0]);
        self
    }

    /// The same machine, started that long after its session began (s).
    pub fn begun_at(self, session_s: f64) -> Machine {
        Machine { began_s: session_s, ..self }
    }

    /// The same machine, started at rest but not in balance: beside command and laws a constant torque acts (command_unit).
    pub fn held_by(mut self, torque: f64, gain_at_rest: f64) -> Machine {
        let spring = if gain_at_rest.is_finite() && gain_at_rest != 0.0 { self.origin / gain_at_rest } else { 0.0 };
        self.standing = [spring - torque, 0.0];
        self.w = 0.0;
        self
    }

    /// The same machine with a motion that neither command nor law makes: the answer to a start in full swing or to a hum
    /// (position_unit, a value per sample). The laws feel it.
    pub fn carried_by(mut self, free: Vec<f64>) -> Machine {
        if let [first, second, ..] = free[..] {
            // The positions before the first sample, for the speed there.
            self.x = [0.0, 1.0, 2.0].map(|k| self.x[0] + first + k * (first - second));
        }
        self.free = free;
        self
    }

    /// The free motion at a sample.
    fn free(&self, k: usize) -> f64 {
        self.free.get(k).copied().unwrap_or(0.0)
    }

    /// A machine with these effects; `scene` says what the laws need to know of it.
    pub fn new(plant: &Plant, effects: &[(&dyn Effect, &Setting)], scene: &Scene) -> Result<Machine, LtiError> {
        let t = scene.sample_time_s;
        let delayed = DiscretePlant::of(plant, t)?;
        let direct = DiscretePlant::of(&Plant { delay_s: 0.0, ..plant.clone() }, t)?;
        let (pushed, torqued) = (PlantState::at_rest(&delayed), PlantState::at_rest(&direct));
        let mut unit = torqued.clone();
        unit.command(1.0);
        unit.advance(&direct);
        let (mut command, mut torque, mut position) = (Vec::new(), Vec::new(), Vec::new());
        for (effect, setting) in effects {
            let part = Part {
                law: effect.law(&setting.inner, scene),
                strengths: setting.strengths.clone(),
                head: effect.facts().port != Port::Sensor,
            };
            match effect.facts().entry {
                Entry::Command => command.push(part),
                Entry::Torque => torque.push(part),
                Entry::Position => position.push(part),
            }
        }
        let history = vec![0.0; delayed.whole_delay_samples() + 2];
        Ok(Machine {
            reach: unit.position(),
            held: [pushed.clone(), torqued.clone()],
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
            w: 0.0,
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
        let x = self.origin + self.pushed.position() + self.torqued.position() + self.free(self.k);
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

    /// The plant as the command meets it, and without its delay, as a torque does: what [`Machine::between`] is read with.
    pub fn plants(&self) -> [&DiscretePlant; 2] {
        [&self.delayed, &self.direct]
    }

    /// Position of the arm between the last sample and the next, after [`Machine::command`]; readings of [`Machine::plants`].
    ///
    /// Exact for the command. The torque is taken at its mean over the interval: second order in the sample time.
    pub fn between(&self, at: [&Intersample; 2]) -> f64 {
        self.origin + self.held[0].between(at[0]) + self.held[1].between(at[1])
    }

    /// Takes the command of this sample (controller plus excitation) and moves on to the next.
    pub fn command(&mut self, u: f64) {
        self.now.u = u;
        let mut acting = u;
        for part in &mut self.command {
            acting += part.value(&self.last, &self.now);
            part.law.commit(&self.last, &self.now);
        }
        self.history.rotate_left(1);
        let n = self.history.len();
        self.history[n - 1] = acting;
        let share = self.delayed.fractional_delay_s() / self.delayed.sample_time_s();
        self.now.i = share * self.history[0] + (1.0 - share) * self.history[1];
        self.pushed.command(acting - self.standing[0]);
        self.held[0].clone_from(&self.pushed);
        self.pushed.advance(&self.delayed);
        if !self.torque.is_empty() {
            self.w = self.solve();
        }
        self.torqued.command(self.w - self.standing[1]);
        self.held[1].clone_from(&self.torqued);
        self.torqued.advance(&self.direct);
        if !self.torque.is_empty() {
            let to = self.ahead(self.origin + self.pushed.position() + self.torqued.position() + self.free(self.k + 1));
            let (from, to) = (self.now.scaled(self.arm), to.scaled(self.arm));
            for part in &mut self.torque {
                part.law.commit(&from, &to);
            }
        }
        self.last = self.now;
        self.k += 1;
    }

    /// The next sample, if the arm goes to `x`.
    fn ahead(&self, x: f64) -> Sample {
        let t = self.delayed.sample_time_s();
        let (after, session) = (self.now.t + t, self.now.session + t);
        Sample { t: after, session, x, v: (3.0 * x - 4.0 * self.x[0] + self.x[1]) / (2.0 * t), ..self.now }
    }

    fn solve(&self) -> f64 {
        let torqued = self.torqued.after(&self.direct, -self.standing[1]);
        let free = self.origin + self.pushed.position() + torqued + self.free(self.k + 1);
        let from = self.now.scaled(self.arm);
        let law = |w: f64| {
            let to = self.ahead(free + self.reach * w).scaled(self.arm);
            self.torque.iter().map(|p| p.value(&from, &to)).sum::<f64>()
        };
        let mut w = self.w;
        for _ in 0..STEPS {
            let next = law(w);
            if (next - w).abs() <= 1e-9 * (next.abs() + w.abs()) {
                return next;
            }
            w = next;
        }
        // w - law(w) rises with w for every law that resists motion: bracket its root and close in.
        let off = |w: f64| w - law(w);
        let size = w.abs().max(law(0.0).abs()).max(f64::MIN_POSITIVE);
        let (mut low, mut high) = (-4.0 * size, 4.0 * size);
        if !(off(low) < 0.0 && off(high) > 0.0) {
            return w;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if off(middle) > 0.0 {
                high = middle
            } else {
                low = middle
            }
            if high - low <= 1e-10 * size {
                break;
            }
        }
        0.5 * (low + high)
    }
}
