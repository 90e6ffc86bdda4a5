//! The best that one effect can do for the error of a model.

use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{PUSH_MOVES, PUSH_TOGETHER};
use crate::physics::{Effect, LawSetting, Port};

/// Whether no other law's form makes it: what turns with the disk, and a wave over the position.
pub(super) fn has_own_period(e: &dyn Effect) -> bool {
    e.facts().port == Port::Disk || e.is_wave_over_position()
}

/// The best that one effect can do.
#[derive(Clone)]
pub struct Candidate {
    /// Its law with its best numbers.
    pub setting: LawSetting,
    /// Fall of the sum of squares of the whitened error.
    pub gain: f64,
    /// Its gain over the median of the grid's points around it: how far it stands out among laws of its kind with other numbers.
    pub stands_out: f64,
    /// Share of its columns that the linear parameters can imitate, at its best point.
    pub concealed: f64,
    /// Points of the grid.
    pub points: usize,
    /// Free strengths.
    pub strengths: usize,
    /// Which numbers of the law are continuous.
    pub continuous: Vec<bool>,
    /// Range of each number's magnitude on the grid.
    pub range: Vec<[f64; 2]>,
}

impl Candidate {
    /// The effect that it is one of.
    pub fn effect(&self) -> &'static dyn Effect {
        self.setting.law.effect()
    }

    /// As an effect of a model, taken in a step.
    pub fn chosen(&self, step: usize) -> SelectedEffect {
        SelectedEffect {
            setting: self.setting.clone(),
            continuous: self.continuous.clone(),
            range: self.range.clone(),
            step,
        }
    }

    /// Logarithm of an upper bound of the chance that noise alone gives this gain somewhere on the grid, for `effects`
    /// effects tried at once: the tail of chi-square by Chernoff's bound, times all points and effects (Bonferroni).
    pub fn log_p_value(&self, effects: usize) -> f64 {
        log_tail(self.gain, self.strengths.max(1)) + (self.points.max(1) as f64).ln() + (effects.max(1) as f64).ln()
    }
    /// Whether a push has one strength in the records of several moves: it comes with the clock of the record, and not with a move.
    pub(in crate::diagnose) fn together(&self) -> bool {
        let s = &self.setting.strengths;
        let most = s.iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
        s.len() >= PUSH_MOVES && s.iter().all(|v| v * most.signum() > PUSH_TOGETHER * most.abs())
    }
}
