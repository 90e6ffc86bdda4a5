//! The plant from a sweep of a closed loop: L, S, T, PS or CS taken while a known controller ran.
//!
//! In: the response as measured, C at the same frequencies. Out: P with the controller's hold taken out again, its deviation grown by what the loop
//! hides, the points that say nothing left out. Convention: negative feedback, S = 1/(1 + L), L = P C (`specs/conventions.md`). Spec: `specs/frf.md`.

use super::error::FrfError;
use super::response::Frf;
use super::settings::Measured;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A point whose plant is known no better than this relative standard deviation is left out.
const KNOWN: f64 = 0.3;
/// Points left at least.
const FEWEST: usize = 8;

/// A plant opened out of its loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Opened {
    /// The plant, hold not included.
    pub frf: Frf,
    /// Points of the sweep that say nothing of the plant, and those at or above half the sample rate.
    pub unknown: usize,
    /// See [`Opened::unknown`].
    pub beyond: usize,
    /// Band that is left (Hz).
    pub band_hz: [f64; 2],
    /// Largest factor from the deviation of the measured value to that of the plant.
    pub growth: f64,
    /// The relative deviation taken where the file has none, from the scatter of neighbours.
    pub assumed: Option<f64>,
}

impl Measured {
    /// P from the measured value and C, and the size of d ln P / d ln of the measured value.
    fn open(self, x: Complex<f64>, c: Complex<f64>) -> (Complex<f64>, f64) {
        match self {
            Measured::Plant => (x, 1.0),
            Measured::Loop => (x / c, 1.0),
            // L = 1/S - 1 = (1 - S)/S.
            Measured::Sensitivity => ((1.0 - x) / x / c, 1.0 / (1.0 - x).norm()),
            // L = T/(1 - T).
            Measured::Complementary => (x / (1.0 - x) / c, 1.0 / (1.0 - x).norm()),
            // P = PS/(1 - C PS), since C PS = T.
            Measured::Process => (x / (1.0 - c * x), 1.0 / (1.0 - c * x).norm()),
            // S = CS/C.
            Measured::Control => Measured::Sensitivity.open(x / c, c),
        }
    }
}

/// Opens the loop: `controller` is C at a frequency (rad/s) as the firmware runs it, `sample_time_s` its clock.
///
/// The measured value is that of the sampled loop, whose plant has the zero-order hold in it; it is divided out, so that P is a response like any
/// other sweep's. To first order its relative deviation is that of the measured value times 1/|1 - S| or 1/|1 - T|.
pub fn open_loop(
    measured: Measured,
    frf: &Frf,
    sample_time_s: f64,
    controller: impl Fn(f64) -> Complex<f64>,
) -> Result<Opened, FrfError> {
    let below = frf.w_rad_s().iter().filter(|w| **w * sample_time_s < std::f64::consts::PI).count();
    let ln: Vec<Complex<f64>> = logarithms(&frf.value()[..below]);
    let assumed = if frf.relative_std().is_none() && below >= 4 { Some(scatter(&ln)) } else { None };
    let (mut w_rad_s, mut value, mut std) = (Vec::new(), Vec::new(), Vec::new());
    let mut growth = 0.0f64;
    for i in 0..below {
        let w = frf.w_rad_s()[i];
        let (held, by) = measured.open(frf.value()[i], controller(w));
        let p = if measured == Measured::Plant { held } else { held / hold(w * sample_time_s) };
        let deviation = by * frf.relative_std().map_or(assumed.unwrap_or_default(), |s| s[i]);
        let size = p.norm();
        if !(size.is_finite() && size > 0.0 && deviation <= KNOWN) {
            continue;
        }
        growth = growth.max(by);
        w_rad_s.push(w);
        value.push(p);
        std.push(deviation);
    }
    let (found, of) = (value.len(), frf.len());
    if found < FEWEST {
        return Err(FrfError::Closed { measured, found, of, needed: FEWEST, known: KNOWN });
    }
    let band_hz = [w_rad_s[0] / TAU, w_rad_s[found - 1] / TAU];
    let shape = |source| FrfError::Shape { file: "opened response".to_owned(), source };
    let opened = Frf::new(w_rad_s, value, Some(std)).map_err(shape)?.with_unstable_poles(frf.unstable_poles());
    Ok(Opened { frf: opened, unknown: below - found, beyond: of - below, band_hz, growth, assumed })
}

/// The zero-order hold, (1 - e^{-jx})/(jx) with x = w T.
fn hold(x: f64) -> Complex<f64> {
    Complex::from_polar((0.5 * x).sin() / (0.5 * x), -0.5 * x)
}

fn logarithms(value: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let mut ln: Vec<Complex<f64>> = Vec::with_capacity(value.len());
    for (i, v) in value.iter().enumerate() {
        ln.push(if i == 0 { v.ln() } else { ln[i - 1] + (v / value[i - 1]).ln() });
    }
    ln
}

/// Relative deviation of values given by their unwrapped logarithms, where a file gives none: third differences see noise and hardly anything
/// else, and the median ignores the resonances. A third difference of white noise has 20 times its variance; 0.6745 is a normal's quartile.
pub fn scatter(ln: &[Complex<f64>]) -> f64 {
    let third = ln.windows(4).map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]);
    let mut all: Vec<f64> = third.flat_map(|d| [d.re.abs(), d.im.abs()]).collect();
    all.sort_by(f64::total_cmp);
    let one_part = all.get(all.len() / 2).copied().unwrap_or_default() / (0.6745 * 20f64.sqrt());
    one_part * std::f64::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    const T: f64 = 5e-5;

    fn c(w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        0.4 + 20.0 / s + s * 4e-4 / (1.0 + s * 2e-5)
    }

    fn p(w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        9e6 / (s * s + 90.0 * s + 250.0 * 250.0) * (s * -9e-5).exp()
    }

    fn measure(what: Measured, w: f64) -> Complex<f64> {
        let held = p(w) * (1.0 - Complex::from_polar(1.0, -w * T)) / Complex::new(0.0, w * T);
        let l = held * c(w);
        match what {
            Measured::Plant => p(w),
            Measured::Loop => l,
            Measured::Sensitivity => 1.0 / (1.0 + l),
            Measured::Complementary => l / (1.0 + l),
            Measured::Process => held / (1.0 + l),
            Measured::Control => c(w) / (1.0 + l),
        }
    }

    const ALL: [Measured; 6] = [
        Measured::Plant,
        Measured::Loop,
        Measured::Sensitivity,
        Measured::Complementary,
        Measured::Process,
        Measured::Control,
    ];

    fn grid() -> Vec<f64> {
        (0..300).map(|i| TAU * 20.0 * 450f64.powf(f64::from(i) / 299.0)).collect()
    }

    #[test]
    fn every_closed_loop_response_gives_the_plant_back() {
        for what in ALL {
            let w = grid();
            let value = w.iter().map(|&w| measure(what, w)).collect();
            let opened = open_loop(what, &Frf::new(w, value, Some(vec![1e-12; 300])).unwrap(), T, c).unwrap();
            assert_eq!((opened.unknown, opened.frf.len()), (0, 300));
            for (&w, v) in opened.frf.w_rad_s().iter().zip(opened.frf.value()) {
                // Rounding, grown by the loop; the hold written out here loses two digits at the bottom of the sweep.
                assert!((v / p(w) - 1.0).norm() < 1e-13 * opened.growth, "{what} {w}");
            }
        }
    }

    #[test]
    fn noise_stays_within_the_deviation_carried_and_hidden_points_go() {
        let mut random = Random::new(4);
        for (what, noise) in ALL.into_iter().zip([1e-2, 1e-2, 2e-2, 2e-2, 2e-2, 2e-2]) {
            let (mut inside, mut all, mut left_out) = (0, 0, 0);
            for _ in 0..20 {
                let w = grid();
                let value = w.iter().map(|&w| {
                    measure(what, w) * (1.0 + noise / 2f64.sqrt() * Complex::new(random.normal(), random.normal()))
                });
                let frf = Frf::new(w.clone(), value.collect(), Some(vec![noise; 300])).unwrap();
                let opened = open_loop(what, &frf, T, c).unwrap();
                left_out += opened.unknown;
                let std = opened.frf.relative_std().unwrap();
                for ((&w, v), s) in opened.frf.w_rad_s().iter().zip(opened.frf.value()).zip(std) {
                    // |complex normal| of deviation s: 95 % lie within sqrt(ln 20) s.
                    inside += usize::from((v / p(w) - 1.0).norm() < 20f64.ln().sqrt() * s);
                    all += 1;
                }
            }
            let share = inside as f64 / all as f64;
            // Some 6000 points: the share's own deviation is 0.003; the second order of what is known to 0.3 adds to it.
            assert!((0.93..=0.97).contains(&share), "{what} {share}");
            // T near 1 at the bottom and S near 1 at the top hide the plant.
            assert_eq!(left_out > 0, !matches!(what, Measured::Plant | Measured::Loop), "{what} {left_out}");
        }
    }

    #[test]
    fn a_file_without_deviations_gets_the_scatter_and_nothing_known_is_refused() {
        let (w, mut random) = (grid(), Random::new(9));
        let noisy = |what: Measured, noise: f64, random: &mut Random| -> Frf {
            let one = |&w: &f64| {
                measure(what, w) * (1.0 + noise / 2f64.sqrt() * Complex::new(random.normal(), random.normal()))
            };
            Frf::new(w.clone(), w.iter().map(one).collect(), None).unwrap()
        };
        let opened = open_loop(Measured::Sensitivity, &noisy(Measured::Sensitivity, 0.01, &mut random), T, c).unwrap();
        assert!((opened.assumed.unwrap() / 0.01 - 1.0).abs() < 0.2, "{:?}", opened.assumed);
        let flat = w.iter().map(|_| 1.0 + 1e-3 * Complex::new(random.normal(), random.normal())).collect();
        let e = open_loop(Measured::Sensitivity, &Frf::new(w, flat, None).unwrap(), T, c).unwrap_err();
        assert!(matches!(e, FrfError::Closed { of: 300, .. }));
    }
}
