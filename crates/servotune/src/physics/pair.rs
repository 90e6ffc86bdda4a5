//! One resonance of the plant on its own: its pole and residue out of the partial fractions.
//!
//! In: plant, number of the mode. Out: the pair whose response 2 Re(r/(s - p)) is the mode's share of the position.
//! Convention: as in `lti::ModalForm`; `specs/mismatch.md`.

use super::sample::MotionScene;
use crate::lti::ModalForm;
use nalgebra::Complex;

/// A complex pole, imaginary part above 0, with its residue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) pole: Complex<f64>,
    pub(super) residue: Complex<f64>,
}

impl Pair {
    /// The pair of `plant.modes[mode]`; none where there is no such mode or it does not ring.
    pub(super) fn of(scene: &MotionScene, mode: usize) -> Option<Pair> {
        let found = scene.plant.modes.get(mode)?;
        let (w, z) = (found.pole_rad_s, found.pole_damping_ratio);
        if z >= 1.0 {
            return None;
        }
        let pole = Complex::new(-z * w, w * ((1.0 - z) * (1.0 + z)).sqrt());
        let terms = ModalForm::of(&scene.plant).ok()?.terms;
        let near = terms.iter().filter(|t| t.pole.im > 0.0);
        let term = near.min_by(|a, b| (a.pole - pole).norm().total_cmp(&(b.pole - pole).norm()))?;
        Some(Pair { pole: term.pole, residue: term.residue })
    }

    /// Numbers of the modes that have a pair.
    pub(super) fn all(scene: &MotionScene) -> Vec<(usize, Pair)> {
        (0..scene.plant.modes.len()).filter_map(|j| Some((j, Pair::of(scene, j)?))).collect()
    }
}

/// One step of q' = pole q + residue u with u held: exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    turn: Complex<f64>,
    gain: Complex<f64>,
}

impl Turn {
    pub(super) fn of(pole: Complex<f64>, residue: Complex<f64>, step: f64) -> Turn {
        let turn = (pole * step).exp();
        Turn { turn, gain: residue * (turn - 1.0) / pole }
    }

    pub(super) fn after(&self, q: Complex<f64>, u: f64) -> Complex<f64> {
        q * self.turn + self.gain * u
    }
}
