//! Springs in parallel that slide: the loading curve of a hysteresis in motion (Iwan 1966; generalised Maxwell slip, Al-Bender, Lampaert,
//! Swevers 2005). First loading follows the curve, linear between its knots and level behind the last; every turn begins a loop by Masing's rule.

use super::effect::Law;
use super::sample::Sample;

/// Springs that are moved side by side.
const LANES: usize = 4;

/// A row of springs that slide, one at each knot of a loading curve behind the first.
pub(crate) struct Sliders {
    /// Springs; behind the last, such that hold nothing.
    count: usize,
    /// Way at which each slides (position_unit).
    yields: Vec<[f64; LANES]>,
    /// What each holds per stretch (command_unit per position_unit).
    stiffness: Vec<[f64; LANES]>,
    /// Stretch of each (position_unit).
    stretch: Vec<[f64; LANES]>,
    /// What all hold (command_unit).
    held: f64,
}

/// Numbers in rows of lanes, 0 behind the last.
fn in_lanes(numbers: &[f64]) -> Vec<[f64; LANES]> {
    let row = |few: &[f64]| std::array::from_fn(|i| few.get(i).copied().unwrap_or(0.0));
    numbers.chunks(LANES).map(row).collect()
}

/// A stretch after a way more.
#[inline]
fn moved(stretch: f64, dx: f64, yields: f64) -> f64 {
    // Not `clamp`, which panics where the motion is no number.
    (stretch + dx).max(-yields).min(yields)
}

impl Sliders {
    /// At rest, of a loading curve through these values at these ways.
    pub fn of(at: &[f64], value: &[f64]) -> Sliders {
        let yields: Vec<f64> = at.iter().skip(1).map(|a| a - at[0]).collect();
        let (count, yields) = (yields.len(), in_lanes(&yields));
        let stretch = vec![[0.0; LANES]; yields.len()];
        Sliders { count, stretch, stiffness: in_lanes(&slider_stiffness(at, value)), yields, held: 0.0 }
    }

    /// What all hold.
    pub fn held(&self) -> f64 {
        self.held
    }

    /// The same after a way `dx` more.
    #[inline]
    pub fn held_after(&self, dx: f64) -> f64 {
        let mut sums = [0.0; LANES];
        for ((s, y), k) in self.stretch.iter().zip(&self.yields).zip(&self.stiffness) {
            (0..LANES).for_each(|i| sums[i] += k[i] * moved(s[i], dx, y[i]));
        }
        sums.iter().sum()
    }

    /// Goes the way `dx`; the stretches.
    pub fn go(&mut self, dx: f64) -> &[f64] {
        self.held = self.held_after(dx);
        for (s, y) in self.stretch.iter_mut().zip(&self.yields) {
            (0..LANES).for_each(|i| s[i] = moved(s[i], dx, y[i]));
        }
        &self.stretch.as_flattened()[..self.count]
    }
}

/// What each slider of a loading curve holds per stretch: the fall of the curve's slope at its knot.
pub(super) fn slider_stiffness(at: &[f64], value: &[f64]) -> Vec<f64> {
    let slope = |i: usize| if i + 1 < at.len() { (value[i + 1] - value[i]) / (at[i + 1] - at[i]) } else { 0.0 };
    (0..at.len().saturating_sub(1)).map(|i| slope(i) - slope(i + 1)).collect()
}

/// A loading curve in motion.
pub(super) struct Loading(pub(super) Sliders);

impl Law for Loading {
    fn columns(&self, from: &Sample, to: &Sample, out: &mut [f64]) {
        out[0] = -0.5 * (self.0.held() + self.0.held_after(to.x - from.x));
    }

    fn commit(&mut self, from: &Sample, to: &Sample) {
        self.went(to.x - from.x);
    }

    fn went(&mut self, way: f64) {
        self.0.go(way);
    }
}
