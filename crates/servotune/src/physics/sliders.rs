//! Springs in parallel that slide: the loading curve of a hysteresis in motion (Iwan 1966; generalised Maxwell slip, Al-Bender, Lampaert,
//! Swevers 2005). First loading follows the curve, every turn begins a loop by Masing's rule.

use super::effect::Law;
use super::sample::Sample;

/// A row of springs that slide, one at each knot of a loading curve behind the first.
pub(crate) struct Sliders {
    /// Way at which each slides (position_unit).
    yields: Vec<f64>,
    /// Stretch of each (position_unit).
    stretch: Vec<f64>,
}

impl Sliders {
    /// At rest, of the ways between the first knot and the others.
    pub fn of(at: &[f64]) -> Sliders {
        let yields: Vec<f64> = at.iter().skip(1).map(|a| a - at[0]).collect();
        Sliders { stretch: vec![0.0; yields.len()], yields }
    }

    /// The stretch of one after a way `dx`.
    pub fn moved(&self, j: usize, dx: f64) -> f64 {
        // Not `clamp`, which panics where the motion is no number.
        (self.stretch[j] + dx).max(-self.yields[j]).min(self.yields[j])
    }

    /// Goes the way `dx`; the stretches.
    pub fn go(&mut self, dx: f64) -> &[f64] {
        for j in 0..self.yields.len() {
            self.stretch[j] = self.moved(j, dx);
        }
        &self.stretch
    }
}

/// What each slider of a loading curve holds per stretch: the fall of the curve's slope at its knot.
pub(super) fn slider_stiffness(at: &[f64], value: &[f64]) -> Vec<f64> {
    let slope = |i: usize| if i + 1 < at.len() { (value[i + 1] - value[i]) / (at[i + 1] - at[i]) } else { 0.0 };
    (0..at.len().saturating_sub(1)).map(|i| slope(i) - slope(i + 1)).collect()
}

/// A loading curve in motion.
pub(super) struct Loading {
    pub(super) sliders: Sliders,
    /// Of each slider (command_unit per position_unit).
    pub(super) stiffness: Vec<f64>,
}

impl Law for Loading {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        let dx = to.x - from.x;
        let both = |(j, k): (usize, &f64)| k * (self.sliders.stretch[j] + self.sliders.moved(j, dx));
        out[0] = -0.5 * self.stiffness.iter().enumerate().map(both).sum::<f64>();
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.went(to.x - from.x);
    }

    fn went(&mut self, way: f64) {
        self.sliders.go(way);
    }
}
