//! A resonance as a stage of the plant's product form, its pole moving: what that changes in the position.
//!
//! The stage (s² + 2 ζz ωz s + ωz²)/(s² + 2 ζp ωp s + ωp²) is x + a q0 + b q1 with q0' = ω q1, q1' = ω (x - q0 - 2 ζ q1), x what
//! enters it, a = (ωz/ωp)² - 1, b = 2 (ζz ωz - ζp ωp)/ωp. Both are kept while pole and zero move together. Body and all other stages
//! stand before it: they commute with it as long as it changes slowly.

use super::sample::MotionScene;
use crate::lti::{ModalForm, Plant};
use nalgebra::Complex;
use std::cell::Cell;

/// One term of the partial fractions of what enters, stepped exactly under a held command.
#[derive(Clone, Copy)]
struct Term {
    turn: Complex<f64>,
    push: Complex<f64>,
    /// 2 where the term stands for a pair.
    weight: f64,
    q: Complex<f64>,
}

/// The stage with its pole where the law puts it, and where the plant has it.
pub(super) struct Stage {
    terms: Vec<Term>,
    /// Double integrator: coefficients of 1/s² and 1/s, velocity part and position.
    rigid: [f64; 2],
    free: [f64; 2],
    /// What enters at the sample.
    x: f64,
    step: f64,
    out: [f64; 2],
    pub(super) w_rad_s: f64,
    pub(super) damping: f64,
    /// Moved and at rest in the plant's place: deflection, rate over ω.
    pub(super) moved: [f64; 2],
    plain: [f64; 2],
    swing: Swing,
    /// The step that was tried last: what is asked for is most often taken next.
    ahead: Cell<Option<Next>>,
}

/// A step taken on trial.
#[derive(Clone, Copy)]
pub(super) struct Next {
    /// Under which command, and what else the law looked at.
    under: [f64; 2],
    x: f64,
    moved: [f64; 2],
    plain: [f64; 2],
}

impl Stage {
    /// The stage of `plant.modes[mode]` at rest; none where there is no such mode or it does not ring.
    pub(super) fn of(scene: &MotionScene, mode: usize) -> Option<Stage> {
        let m = *scene.plant.modes.get(mode).filter(|m| m.pole_damping_ratio < 1.0)?;
        let mut modes = scene.plant.modes.clone();
        modes.remove(mode);
        let rest = ModalForm::of(&Plant { modes, physics: Vec::new(), delay_s: 0.0, ..scene.plant.clone() }).ok()?;
        let h = scene.sample_time_s;
        let terms = rest.terms.iter().map(|t| {
            let turn = (t.pole * h).exp();
            let push = if t.pole.norm() > 0.0 { t.residue * (turn - 1.0) / t.pole } else { t.residue * h };
            Term { turn, push, weight: if t.pole.im > 0.0 { 2.0 } else { 1.0 }, q: Complex::new(0.0, 0.0) }
        });
        let ratio = m.zero_rad_s / m.pole_rad_s;
        Some(Stage {
            terms: terms.collect(),
            rigid: [rest.rigid2, rest.rigid1],
            free: [0.0; 2],
            x: 0.0,
            step: h,
            out: [ratio * ratio - 1.0, 2.0 * (m.zero_damping_ratio * ratio - m.pole_damping_ratio)],
            w_rad_s: m.pole_rad_s,
            damping: m.pole_damping_ratio,
            moved: [0.0; 2],
            plain: [0.0; 2],
            swing: Swing::of(m.pole_rad_s, m.pole_damping_ratio, h),
            ahead: Cell::new(None),
        })
    }

    /// What enters at the next sample under the command `i`.
    fn entering(&self, i: f64) -> f64 {
        let [r2, r1] = self.rigid;
        let h = self.step;
        let rigid = self.free[1] + self.free[0] * h + i * (0.5 * r2 * h * h + r1 * h);
        rigid + self.terms.iter().map(|t| t.weight * (t.q * t.turn + t.push * i).re).sum::<f64>()
    }

    /// The deflection after a step with ω and ζ, what enters moving from here to `x`.
    pub(super) fn moved_by(&self, w: f64, z: f64, x: f64) -> [f64; 2] {
        Swing::of(w, z, self.step).next(self.moved, [self.x, x])
    }

    /// Amplitudes of the stage's own swing, as the position has it, at both ends of a step that leads to `moved`, what enters moving to `x`.
    pub(super) fn amplitudes(&self, moved: [f64; 2], x: f64) -> [f64; 2] {
        let rate = (x - self.x) / (self.step * self.w_rad_s);
        let share = self.out[0].hypot(self.out[1]);
        [(self.moved, self.x), (moved, x)].map(|(q, x)| share * (q[0] - x).hypot(q[1] - rate))
    }

    /// The next sample under the command `i`; the law moves the pole, knowing the stage, what enters then and `by`, all else that it goes by.
    pub(super) fn next(&self, i: f64, by: f64, law: impl Fn(&Stage, f64) -> [f64; 2]) -> Next {
        let under = [i, by];
        if let Some(next) = self.ahead.get().filter(|n| n.under == under) {
            return next;
        }
        let x = self.entering(i);
        let next = Next { under, x, moved: law(self, x), plain: self.swing.next(self.plain, [self.x, x]) };
        self.ahead.set(Some(next));
        next
    }

    /// What the law changes in the position.
    pub(super) fn change(&self, next: &Next) -> f64 {
        (0..2).map(|j| self.out[j] * (next.moved[j] - next.plain[j])).sum()
    }

    /// Takes a step for good.
    pub(super) fn take(&mut self, i: f64, next: Next) {
        for t in &mut self.terms {
            t.q = t.q * t.turn + t.push * i;
        }
        let [r2, r1] = self.rigid;
        let h = self.step;
        self.free[1] += self.free[0] * h + i * (0.5 * r2 * h * h + r1 * h);
        self.free[0] += r2 * h * i;
        (self.x, self.moved, self.plain) = (next.x, next.moved, next.plain);
        self.ahead.set(None);
    }
}

/// q0' = w q1, q1' = w (x - q0 - 2 z q1) over one step, x moving straight: exact.
#[derive(Clone, Copy)]
struct Swing {
    w: f64,
    z: f64,
    step: f64,
    /// Transition of what is off the answer to the straight motion.
    turn: [f64; 4],
}

impl Swing {
    fn of(w: f64, z: f64, step: f64) -> Swing {
        let square = 1.0 - z * z;
        let angle = w * square.abs().sqrt() * step;
        // cos and w sin/w_d, hyperbolic where it creeps.
        let (c, s) = if angle < 1e-9 {
            (1.0, w * step)
        } else if square > 0.0 {
            let (sin, cos) = angle.sin_cos();
            (cos, sin / square.sqrt())
        } else {
            (angle.cosh(), angle.sinh() / (-square).sqrt())
        };
        let fall = (-z * w * step).exp();
        Swing { w, z, step, turn: [c + z * s, s, -s, c - z * s].map(|v| fall * v) }
    }

    fn next(&self, q: [f64; 2], x: [f64; 2]) -> [f64; 2] {
        let rate = (x[1] - x[0]) / (self.step * self.w);
        let lag = 2.0 * self.z * rate;
        let off = [q[0] - (x[0] - lag), q[1] - rate];
        let [a, b, c, d] = self.turn;
        [a * off[0] + b * off[1] + x[1] - lag, c * off[0] + d * off[1] + rate]
    }
}
