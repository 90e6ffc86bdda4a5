//! A strictly proper quotient by its roots: P(s) = gain Π(s - z)/Π(s - p).
//!
//! In: gain and complete lists of roots (rad/s). Out: its response, its counts, and its resonance pairs. Convention: real roots
//! have imaginary part 0, complex ones stand beside their exact conjugates. Spec: `specs/files.md`, "plant.toml".

use super::LtiError;
use nalgebra::Complex;

/// Poles and zeros with a gain.
#[derive(Clone, Debug, PartialEq)]
pub struct Rational {
    /// P(s) s^r far above every root, r = poles less zeros (position_unit/s^r per command_unit).
    pub gain: f64,
    /// Zeros (rad/s), each complex one beside its conjugate.
    pub zeros: Vec<Complex<f64>>,
    /// Poles (rad/s), likewise; at most two at the origin, no other on the imaginary axis.
    pub poles: Vec<Complex<f64>>,
}

/// Most poles taken.
pub(super) const MOST: usize = 60;

impl Rational {
    /// The response at s = j w. Factors are taken in turn, one zero and one pole, so that no partial product leaves the range of f64.
    pub fn at(&self, w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        let mut zeros = self.zeros.iter();
        self.poles.iter().fold(Complex::new(self.gain, 0.0), |v, p| {
            let up = zeros.next().map_or(Complex::new(1.0, 0.0), |z| s - z);
            v * (up / (s - p))
        })
    }

    /// Poles less zeros.
    pub fn relative_degree(&self) -> usize {
        self.poles.len().saturating_sub(self.zeros.len())
    }

    /// Poles at the origin.
    pub fn integrators(&self) -> usize {
        self.poles.iter().filter(|p| p.norm() == 0.0).count()
    }

    /// Poles in the right half-plane.
    pub fn unstable_poles(&self) -> usize {
        self.poles.iter().filter(|p| p.re > 0.0).count()
    }

    /// Value and logarithmic slope at rest of all but gain and integrators.
    pub(super) fn beside_the_integrators(&self) -> (f64, f64) {
        let (mut value, mut slope) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
        let mut zeros = self.zeros.iter();
        for p in &self.poles {
            if let Some(z) = zeros.next() {
                value *= -z;
                slope -= z.inv();
            }
            if p.norm() > 0.0 {
                value /= -p;
                slope += p.inv();
            }
        }
        (value.re, slope.re)
    }

    /// Refuses what is no plant; `modes` are the resonance pairs that multiply it.
    pub(super) fn check(&self, modes: usize) -> Result<(), LtiError> {
        let range =
            |key: &str, found: f64, expected: &'static str| LtiError::Range { key: key.into(), found, expected };
        if !(self.gain.is_finite() && self.gain != 0.0) {
            return Err(range("plant.gain", self.gain, "a finite number, not 0"));
        }
        let (zeros, poles) = (self.zeros.len(), self.poles.len());
        if zeros >= poles || poles + 2 * modes > MOST {
            return Err(LtiError::Proper { zeros, poles: poles + 2 * modes, limit: MOST });
        }
        for (key, roots) in [("plant.zeros", &self.zeros), ("plant.poles", &self.poles)] {
            for r in roots {
                if let Some(found) = [r.re, r.im].into_iter().find(|x| !x.is_finite()) {
                    return Err(range(key, found, "finite roots"));
                }
                let count = |x: Complex<f64>| roots.iter().filter(|y| **y == x).count();
                if r.im != 0.0 && count(*r) != count(r.conj()) {
                    return Err(LtiError::Conjugate { key: key.into(), re: r.re, im: r.im });
                }
            }
        }
        let still = self.integrators();
        if still > 2 {
            return Err(range("plant.poles: number of poles at the origin", still as f64, "at most 2"));
        }
        if still > 0 && self.zeros.iter().any(|z| z.norm() == 0.0) {
            return Err(range("plant.zeros", 0.0, "no zero at the origin beside a pole there: leave out both"));
        }
        match self.poles.iter().find(|p| p.re == 0.0 && p.im != 0.0) {
            Some(p) => {
                let expected =
                    "no undamped pole on the imaginary axis beside the origin: give it the damping that it has";
                Err(range("plant.poles: imaginary part beside a real part of 0", p.im, expected))
            }
            None => Ok(()),
        }
    }
}

/// Roots this close to the real axis, as a share of their size, are a double real root that rounding has split: moving them onto the axis
/// moves the response by the square of it.
const DOUBLE: f64 = 2e-6;

/// Computed roots of a real polynomial made exactly conjugate.
pub(super) fn conjugate(mut found: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    found.iter_mut().filter(|r| r.im.abs() < DOUBLE * r.norm()).for_each(|r| r.im = 0.0);
    let (above, mut below): (Vec<_>, Vec<_>) =
        found.iter().copied().filter(|r| r.im != 0.0).partition(|r: &Complex<f64>| r.im > 0.0);
    let mut all: Vec<Complex<f64>> = found.into_iter().filter(|r| r.im == 0.0).collect();
    for r in above {
        let gap = |b: &Complex<f64>| (b.conj() - r).norm();
        let nearest = (0..below.len()).min_by(|&i, &j| gap(&below[i]).total_cmp(&gap(&below[j])));
        let middle = nearest.map_or(r, |at| 0.5 * (r + below.swap_remove(at).conj()));
        all.extend([middle, middle.conj()]);
    }
    all
}

/// Points of the grid on which two responses are compared.
const POINTS: usize = 300;

/// The largest relative difference of a found response from the one given, and where (rad/s): a log grid from a tenth of the smallest root to three
/// times the largest, and the roots' own frequencies. Farther up a dense triple's own rounding drowns a response that falls with a high power.
pub(super) fn worst_on_grid(
    roots: impl Iterator<Item = f64>,
    pair: impl Fn(f64) -> (Complex<f64>, Complex<f64>),
) -> (f64, f64) {
    let sizes: Vec<f64> = roots.filter(|w| *w > 0.0).collect();
    let low = 0.1 * sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let high = 3.0 * sizes.iter().copied().fold(0.0, f64::max);
    let (low, high) = if sizes.is_empty() { (0.1, 10.0) } else { (low, high) };
    let grid = (0..POINTS).map(|i| low * (high / low).powf(i as f64 / (POINTS - 1) as f64));
    let mut worst = (0.0, low);
    for w in grid.chain(sizes.iter().copied()) {
        let (found, given) = pair(w);
        let off = (found - given).norm() / given.norm();
        if off > worst.0 || off.is_nan() {
            worst = (if off.is_nan() { f64::INFINITY } else { off }, w);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, FrequencyResponse, ModalForm, Plant};

    fn c(re: f64, im: f64) -> Complex<f64> {
        Complex::new(re, im)
    }

    fn plant(gain: f64, zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>) -> Plant {
        Plant {
            position_unit: "um".into(),
            command_unit: "A".into(),
            body: Body::Rational(Rational { gain, zeros, poles }),
            delay_s: 3e-5,
            resonance_gain: 1.0,
            modes: vec![],
            physics: vec![],
        }
    }

    #[test]
    fn partial_fractions_of_real_unstable_and_resting_poles() {
        // Two integrators, a lag, a zero right of the axis, a resonance; then a magnetic bearing with a lag.
        let inertia = plant(
            2e9,
            vec![c(900.0, 0.0)],
            vec![c(0.0, 0.0), c(0.0, 0.0), c(-6e3, 0.0), c(-40.0, 7e3), c(-40.0, -7e3)],
        );
        let bearing = plant(3e8, vec![], vec![c(250.0, 0.0), c(-250.0, 0.0), c(-6e3, 0.0)]);
        let twice = plant(3e8, vec![], vec![c(-250.0, 0.0), c(-250.0, 0.0), c(-250.0, 0.0), c(0.0, 0.0)]);
        // The third stands for what spreading three poles costs, up to ten times their size.
        for (p, tolerance, decades) in [(inertia, 1e-11, 4.5), (bearing, 1e-12, 4.5), (twice, 1e-5, 2.9)] {
            let m = ModalForm::of(&p).unwrap();
            for i in 0..200 {
                let w = 10f64.powf(0.5 + decades * f64::from(i) / 199.0);
                assert!((m.at(w) / p.at(w) - 1.0).norm() < tolerance, "{w} {}", (m.at(w) / p.at(w) - 1.0).norm());
            }
        }
    }

    #[test]
    fn pairs_taken_out_multiply_to_the_same_response() {
        let zeros = vec![c(-30.0, 6.8e3), c(-30.0, -6.8e3), c(4e3, 0.0), c(900.0, 2e4), c(900.0, -2e4)];
        let poles = [c(-40.0, 7e3), c(-300.0, 2.1e4), c(-81.0, 360.0), c(-10.0, 4e4)];
        let poles: Vec<_> = poles.iter().flat_map(|p| [*p, p.conj()]).collect();
        let p = plant(-5e11, zeros, poles);
        let q = p.paired();
        assert_eq!(q.modes.len(), 2);
        assert_eq!(q.order(), p.order());
        for w in [1.0, 350.0, 6.9e3, 2.05e4, 4e4, 1e6] {
            // A few roundings a factor.
            assert!((q.at(w) / p.at(w) - 1.0).norm() < 1e-12);
        }
    }

    #[test]
    fn what_is_no_plant_is_refused_by_its_key() {
        let check = |zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>| plant(1.0, zeros, poles).check().unwrap_err();
        assert!(matches!(check(vec![c(1.0, 0.0)], vec![c(-1.0, 0.0)]), LtiError::Proper { zeros: 1, poles: 1, .. }));
        assert!(matches!(check(vec![], vec![c(-1.0, 2.0)]), LtiError::Conjugate { .. }));
        assert!(matches!(check(vec![], vec![c(0.0, 2.0), c(0.0, -2.0)]), LtiError::Range { .. }));
        assert!(matches!(check(vec![], vec![c(0.0, 0.0); 3]), LtiError::Range { .. }));
        assert!(matches!(check(vec![], vec![c(f64::NAN, 0.0)]), LtiError::Range { .. }));
        // Four poles in one place are more than partial fractions carry.
        let e = ModalForm::of(&plant(1.0, vec![], vec![c(-5.0, 0.0); 4])).unwrap_err();
        assert!(matches!(e, LtiError::Coincident { count: 4, .. }));
    }
}
