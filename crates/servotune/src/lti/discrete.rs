//! The plant as the digital controller sees it: zero-order hold and fractional delay, exact, in modal form.
//!
//! With delay = D T + δ, 0 <= δ < T, the command held over a sample reaches the modes δ late. For one pole p
//!   x[k+1] = e^{pT} x[k] + φ(T-δ) u[k-D] + e^{p(T-δ)} φ(δ) u[k-D-1],   φ(h) = (e^{ph} - 1)/p,
//! which is the modified z-transform (Åström & Wittenmark, Computer-Controlled Systems, ch. 2), eq. (31)'s counterpart.

use super::{FrequencyResponse, LtiError, ModalForm, Plant};
use crate::document::size_limits::DELAY_SAMPLES;
use crate::numeric::wide::{Wide, widest};
use nalgebra::{Complex, DMatrix};

/// The exactly sampled plant. Arrays hold one entry per term; a complex pole stands for itself and its conjugate.
///
/// The states carry their residues, so that the position is the plain sum of their real parts.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscretePlant {
    pub(super) sample_time_s: f64,
    /// Whole samples of delay, D.
    pub(super) whole: usize,
    /// The rest of the delay, δ (s).
    pub(super) rest_s: f64,
    pub(super) pole: Vec<Complex<f64>>,
    /// Weight: 2 residue for a complex pole, residue for a real one.
    pub(super) weight: Vec<Complex<f64>>,
    pub(super) lambda_re: Vec<f64>,
    pub(super) lambda_im: Vec<f64>,
    /// Input gain of u[k-D], weight included.
    pub(super) now_re: Vec<f64>,
    pub(super) now_im: Vec<f64>,
    /// Input gain of u[k-D-1], weight included.
    pub(super) before_re: Vec<f64>,
    pub(super) before_im: Vec<f64>,
    pub(super) rigid2: f64,
    pub(super) rigid1: f64,
}

/// (e^{ph} - 1)/p without cancellation for small p h.
pub(super) fn phi(p: Complex<f64>, h: f64) -> Complex<f64> {
    let (a, b) = (p.re * h, p.im * h);
    if a == 0.0 && b == 0.0 {
        return Complex::new(h, 0.0);
    }
    let half = (0.5 * b).sin();
    let grown = Complex::new(a.exp_m1() * b.cos() - 2.0 * half * half, a.exp() * b.sin());
    grown / p
}

/// How to read the position at one instant between controller samples; made once, used for every simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Intersample {
    /// Propagation of the real and imaginary state parts to that instant.
    pub(super) re: Vec<f64>,
    pub(super) im: Vec<f64>,
    /// Gain of u[k-D] and of u[k-D-1].
    pub(super) now: f64,
    pub(super) before: f64,
    /// Time since the sample (s), for the double integrator.
    pub(super) offset_s: f64,
}

impl DiscretePlant {
    /// Samples a plant at `sample_time_s` (s).
    pub fn of(plant: &Plant, sample_time_s: f64) -> Result<DiscretePlant, LtiError> {
        if !(sample_time_s.is_finite() && sample_time_s > 0.0) {
            let expected = "a finite time above 0 s";
            return Err(LtiError::Range { key: "sample_time_s".into(), found: sample_time_s, expected });
        }
        DiscretePlant::of_modal(&ModalForm::of(plant)?, sample_time_s)
    }

    /// Samples a sum of modes at `sample_time_s` (s, above 0).
    pub fn of_modal(modal: &ModalForm, sample_time_s: f64) -> Result<DiscretePlant, LtiError> {
        let samples = modal.delay_s / sample_time_s;
        if samples > DELAY_SAMPLES as f64 {
            let delay_s = modal.delay_s;
            return Err(LtiError::Delay { delay_s, sample_time_s, samples, limit: DELAY_SAMPLES });
        }
        // A delay within rounding of whole samples is that many samples: 79.2 us at 39.6 us is two, not one and a rest.
        let nearest = samples.round();
        let (whole, rest_s) = if (samples - nearest).abs() < 1e-9 {
            (nearest as usize, 0.0)
        } else {
            (samples.floor() as usize, modal.delay_s - samples.floor() * sample_time_s)
        };
        let n = modal.terms.len();
        let mut d = DiscretePlant {
            sample_time_s,
            whole,
            rest_s,
            pole: Vec::with_capacity(n),
            weight: Vec::with_capacity(n),
            lambda_re: Vec::with_capacity(n),
            lambda_im: Vec::with_capacity(n),
            now_re: Vec::with_capacity(n),
            now_im: Vec::with_capacity(n),
            before_re: Vec::with_capacity(n),
            before_im: Vec::with_capacity(n),
            rigid2: modal.rigid2,
            rigid1: modal.rigid1,
        };
        for t in &modal.terms {
            let weight = if t.pole.im > 0.0 { t.residue * 2.0 } else { t.residue };
            let lambda = (t.pole * sample_time_s).exp();
            let now = weight * phi(t.pole, sample_time_s - rest_s);
            let before = weight * (t.pole * (sample_time_s - rest_s)).exp() * phi(t.pole, rest_s);
            d.pole.push(t.pole);
            d.weight.push(weight);
            d.lambda_re.push(lambda.re);
            d.lambda_im.push(lambda.im);
            d.now_re.push(now.re);
            d.now_im.push(now.im);
            d.before_re.push(before.re);
            d.before_im.push(before.im);
        }
        Ok(d)
    }

    /// Sample time T (s).
    pub fn sample_time_s(&self) -> f64 {
        self.sample_time_s
    }

    /// Whole samples of delay.
    pub fn whole_delay_samples(&self) -> usize {
        self.whole
    }

    /// The delay left over after the whole samples (s), at least 0 and below T.
    pub fn fractional_delay_s(&self) -> f64 {
        self.rest_s
    }

    /// Poles of the sampled plant in z, conjugates and the integrator's included, the delay's poles at 0 not.
    pub fn poles(&self) -> Vec<Complex<f64>> {
        let mut all = Vec::with_capacity(2 * self.pole.len() + 2);
        if self.rigid2 != 0.0 {
            all.extend([Complex::new(1.0, 0.0); 2]);
        }
        for (i, p) in self.pole.iter().enumerate() {
            let z = Complex::new(self.lambda_re[i], self.lambda_im[i]);
            all.push(z);
            if p.im > 0.0 {
                all.push(z.conj());
            }
        }
        all
    }

    /// How many of the plant's poles lie outside the unit circle: those in the right half-plane.
    pub fn unstable_poles(&self) -> usize {
        self.pole.iter().filter(|p| p.re > 0.0).map(|p| if p.im > 0.0 { 2 } else { 1 }).sum()
    }

    /// Continuous poles of the terms (rad/s), each conjugate pair once.
    pub fn terms(&self) -> &[Complex<f64>] {
        &self.pole
    }

    /// How many of the plant's poles lie on z = 1.
    pub fn integrators(&self) -> usize {
        let at_origin = self.pole.iter().filter(|p| p.norm() == 0.0).count();
        at_origin + if self.rigid2 != 0.0 { 2 } else { 0 }
    }

    /// The reading of the position `offset_s` after a controller sample, 0 <= offset < T.
    pub fn intersample(&self, offset_s: f64) -> Intersample {
        let late = (offset_s - self.rest_s).max(0.0);
        let early = offset_s.min(self.rest_s);
        let mut reading = Intersample {
            re: Vec::with_capacity(self.pole.len()),
            im: Vec::with_capacity(self.pole.len()),
            now: 0.0,
            before: 0.0,
            offset_s,
        };
        for (&p, &weight) in self.pole.iter().zip(&self.weight) {
            let e = (p * offset_s).exp();
            reading.re.push(e.re);
            reading.im.push(-e.im);
            reading.now += (weight * phi(p, late)).re;
            reading.before += (weight * (p * late).exp() * phi(p, early)).re;
        }
        reading.now += 0.5 * self.rigid2 * late * late + self.rigid1 * late;
        reading.before += self.rigid2 * early * (late + 0.5 * early) + self.rigid1 * early;
        reading
    }
}

/// The sampled plant over real states: x' = state x + now u[k-D] + before u[k-D-1], y = output x.
#[derive(Clone, Debug, PartialEq)]
pub struct RealForm {
    /// State matrix, n x n.
    pub state: DMatrix<f64>,
    /// Input of u[k-D], n.
    pub now: Vec<f64>,
    /// Input of u[k-D-1], n.
    pub before: Vec<f64>,
    /// Output row, n.
    pub output: Vec<f64>,
}

impl DiscretePlant {
    /// Real states: two for a complex pole, one for a real one, velocity and position for the double integrator.
    pub fn real_form(&self) -> RealForm {
        let n: usize = self.pole.iter().map(|p| if p.im > 0.0 { 2 } else { 1 }).sum();
        let n = n + if self.rigid2 != 0.0 { 2 } else { 0 };
        let mut f =
            RealForm { state: DMatrix::zeros(n, n), now: vec![0.0; n], before: vec![0.0; n], output: vec![0.0; n] };
        let mut at = 0;
        for (i, p) in self.pole.iter().enumerate() {
            f.state[(at, at)] = self.lambda_re[i];
            f.now[at] = self.now_re[i];
            f.before[at] = self.before_re[i];
            f.output[at] = 1.0;
            if p.im > 0.0 {
                f.state[(at, at + 1)] = -self.lambda_im[i];
                f.state[(at + 1, at)] = self.lambda_im[i];
                f.state[(at + 1, at + 1)] = self.lambda_re[i];
                f.now[at + 1] = self.now_im[i];
                f.before[at + 1] = self.before_im[i];
                at += 1;
            }
            at += 1;
        }
        if self.rigid2 != 0.0 {
            let (t, d) = (self.sample_time_s, self.rest_s);
            let h = t - d;
            f.state[(at, at)] = 1.0;
            f.state[(at + 1, at)] = t;
            f.state[(at + 1, at + 1)] = 1.0;
            f.now[at] = self.rigid2 * h;
            f.now[at + 1] = 0.5 * self.rigid2 * h * h + self.rigid1 * h;
            f.before[at] = self.rigid2 * d;
            f.before[at + 1] = self.rigid2 * d * (h + 0.5 * d) + self.rigid1 * d;
            f.output[at + 1] = 1.0;
        }
        f
    }
}

impl FrequencyResponse for DiscretePlant {
    /// P(z) at z = e^{j w T}: position over command as the controller sees it.
    fn at(&self, w: f64) -> Complex<f64> {
        self.at_z(Complex::from_polar(1.0, w * self.sample_time_s))
    }
}

impl DiscretePlant {
    /// P(z) on the unit circle.
    pub(crate) fn at_z(&self, z: Complex<f64>) -> Complex<f64> {
        let [now, before] = widest(Modes { plant: self, z });
        self.with_delay(z, now, before)
    }

    /// P(z) of what the terms give, of the newest command and of the one before: the double integrator and the delay added.
    pub(super) fn with_delay(&self, z: Complex<f64>, mut now: Complex<f64>, mut before: Complex<f64>) -> Complex<f64> {
        let t = self.sample_time_s;
        if self.rigid2 != 0.0 {
            let (h, d) = (t - self.rest_s, self.rest_s);
            let step = z - 1.0;
            // Velocity and position of the double integrator, driven over h by u[k-D] and over d before it.
            let drift = self.rigid2 * t / (step * step);
            now += drift * h + (0.5 * self.rigid2 * h * h + self.rigid1 * h) / step;
            before += drift * d + (self.rigid2 * d * (h + 0.5 * d) + self.rigid1 * d) / step;
        }
        (now + before / z) * z.conj().powu(self.whole as u32)
    }
}

/// Terms handled side by side.
const LANES: usize = 4;

/// What the terms give to P(z), of the newest command and of the one before.
struct Modes<'a> {
    plant: &'a DiscretePlant,
    z: Complex<f64>,
}

impl Wide for Modes<'_> {
    type Output = [Complex<f64>; 2];

    #[inline(always)]
    fn compute(self) -> Self::Output {
        let (p, z) = (self.plant, self.z);
        let n = p.pole.len();
        let mut sum = [Complex::new(0.0, 0.0); 2];
        for from in (0..n).step_by(LANES) {
            let count = LANES.min(n - from);
            let of = |x: &[f64]| -> [f64; LANES] {
                if let Some(whole) = x[from..].first_chunk() {
                    return *whole;
                }
                let mut lanes = [0.0; LANES];
                lanes[..count].copy_from_slice(&x[from..from + count]);
                lanes
            };
            let (re, im) = (of(&p.lambda_re), of(&p.lambda_im));
            let (now_re, now_im) = (of(&p.now_re), of(&p.now_im));
            let (before_re, before_im) = (of(&p.before_re), of(&p.before_im));
            let mut part = [[0.0; LANES]; 4];
            for j in 0..LANES {
                let lambda = Complex::new(re[j], im[j]);
                // Re(weight x) is the half sum of the term and its conjugate, over the common denominator.
                let (upper, lower) = (z - lambda, z - lambda.conj());
                let scale = 0.5 / (upper * lower);
                let half = |gain: Complex<f64>| (gain * lower + gain.conj() * upper) * scale;
                let (now, before) =
                    (half(Complex::new(now_re[j], now_im[j])), half(Complex::new(before_re[j], before_im[j])));
                (part[0][j], part[1][j], part[2][j], part[3][j]) = (now.re, now.im, before.re, before.im);
            }
            // One after the other: a sum keeps its order and so its bits.
            let [a, b, c, d] = &part;
            for (((now_re, now_im), before_re), before_im) in a.iter().zip(b).zip(c).zip(d).take(count) {
                sum[0] += Complex::new(*now_re, *now_im);
                sum[1] += Complex::new(*before_re, *before_im);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// Term by term as the formula is written, to the last bit, for every number of terms up to three rounds of the lanes.
    #[test]
    fn terms_side_by_side_have_the_bits_of_terms_in_a_row() {
        let mut r = Random::new(3);
        for n in 0..=3 * LANES {
            let mut draw = || (0..n).map(|_| r.normal()).collect::<Vec<f64>>();
            let plant = DiscretePlant {
                sample_time_s: 1.0,
                whole: 0,
                rest_s: 0.0,
                pole: vec![Complex::new(0.0, 0.0); n],
                weight: vec![Complex::new(0.0, 0.0); n],
                lambda_re: draw(),
                lambda_im: draw(),
                now_re: draw(),
                now_im: draw(),
                before_re: draw(),
                before_im: draw(),
                rigid2: 0.0,
                rigid1: 0.0,
            };
            let z = Complex::from_polar(1.0, r.normal());
            let mut plain = [Complex::new(0.0, 0.0); 2];
            for i in 0..n {
                let lambda = Complex::new(plant.lambda_re[i], plant.lambda_im[i]);
                let gains = [(&plant.now_re, &plant.now_im), (&plant.before_re, &plant.before_im)];
                let (upper, lower) = (z - lambda, z - lambda.conj());
                for (sum, (re, im)) in plain.iter_mut().zip(gains) {
                    let gain = Complex::new(re[i], im[i]);
                    *sum += (gain * lower + gain.conj() * upper) * (0.5 / (upper * lower));
                }
            }
            assert_eq!(widest(Modes { plant: &plant, z }), plain, "{n} terms");
        }
    }
}
