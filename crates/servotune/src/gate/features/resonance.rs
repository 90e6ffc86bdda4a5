//! Resonance pairs of a response, found one after the other by how much they explain.
//!
//! In: a [`ResponseView`] and its body. Out: [`Resonance`]s with frequency, damping, height and significance.
//! Method: measured / body is smooth but for the pairs. In a window around a trial frequency a pair 1 + (a + j w b)/D(w),
//! D = wp² - w² + 2 j zp wp w, is linear in a and b once a complex parabola in ln w has taken the rest away. The trial that
//! explains most is refined, divided out, and the search starts again until nothing is explained that noise would not.

use super::body::BodyFit;
use super::view::ResponseView;
use crate::numeric::golden::golden_section;
use crate::numeric::statistics::median;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// One pair, eq. (2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// Frequency of the pole (Hz).
    pub hz: f64,
    /// Damping ratio of the pole.
    pub damping: f64,
    /// Largest gain of the pair (dB).
    pub height_db: f64,
    /// Smallest gain of the pair (dB).
    pub depth_db: f64,
    /// Share of F: variance explained by the pair's two numbers over what is left, per degree of freedom.
    pub strength: f64,
    a: f64,
    b: f64,
}

/// Trial dampings.
const DAMPINGS: [f64; 4] = [0.01, 0.02, 0.04, 0.08];
/// Half width of the window (natural logarithm of frequency).
const WINDOW: f64 = 0.2;
/// Step of the trial frequencies (natural logarithm).
const STEP: f64 = 0.02;
/// Least F of a pair: chance reaches it once in 10⁶ trials, a sweep has some hundred.
const LEAST_STRENGTH: f64 = 20.0;
/// Least swing from depth to height (dB): what is smaller moves no loop.
const LEAST_SWING_DB: f64 = 0.4;
/// Most pairs looked for.
const MOST: usize = 8;

impl Resonance {
    /// The gain of the pair at w (rad/s), its gain at far lower frequencies included.
    fn at(&self, w: f64) -> Complex<f64> {
        let p = TAU * self.hz;
        1.0 + Complex::new(self.a, w * self.b) / Complex::new(p * p - w * w, 2.0 * self.damping * p * w)
    }

    /// The pair with its height and depth, read over six of its widths either way.
    fn sized(mut self) -> Resonance {
        let p = TAU * self.hz;
        let size = |k: i32| self.at(p * (self.damping * 0.1 * f64::from(k)).exp()).norm();
        let (low, high) = (-60..=60).map(size).fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        (self.height_db, self.depth_db) = (20.0 * high.log10(), 20.0 * low.log10());
        self
    }
}

/// Points around a trial frequency, with an orthonormal basis of parabolas in ln w.
struct Window {
    range: std::ops::Range<usize>,
    w: Vec<f64>,
    basis: [Vec<f64>; 3],
}

impl Window {
    fn around(view: &ResponseView, hz: f64) -> Option<Window> {
        let range = view.between(hz * (-WINDOW).exp(), hz * WINDOW.exp());
        // Six real numbers of background, two of the pair, and some to judge by; points on both sides of the trial.
        let sides = view.between(hz * (-WINDOW).exp(), hz).len().min(view.between(hz, hz * WINDOW.exp()).len());
        if range.len() < 8 || sides < 3 {
            return None;
        }
        let x: Vec<f64> = view.ln_hz[range.clone()].iter().map(|l| (l - hz.ln()) / WINDOW).collect();
        let mut basis = [vec![1.0; x.len()], x.clone(), x.iter().map(|x| x * x).collect::<Vec<f64>>()];
        for i in 0..3 {
            for j in 0..i {
                let share: f64 = basis[i].iter().zip(&basis[j]).map(|(a, b)| a * b).sum();
                let (low, high) = basis.split_at_mut(i);
                high[0].iter_mut().zip(&low[j]).for_each(|(a, b)| *a -= share * b);
            }
            let size = basis[i].iter().map(|v| v * v).sum::<f64>().sqrt();
            if size < 1e-9 {
                return None;
            }
            basis[i].iter_mut().for_each(|v| *v /= size);
        }
        let w = view.hz[range.clone()].iter().map(|f| TAU * f).collect();
        Some(Window { range, w, basis })
    }

    /// Takes the background away from a column.
    fn bare(&self, column: &mut [Complex<f64>]) {
        for b in &self.basis {
            let share: Complex<f64> = column.iter().zip(b).map(|(c, b)| c * b).sum();
            column.iter_mut().zip(b).for_each(|(c, b)| *c -= share * *b);
        }
    }

    /// The background of a column, at every point.
    fn background(&self, column: &[Complex<f64>]) -> Vec<Complex<f64>> {
        let mut rest = column.to_vec();
        self.bare(&mut rest);
        column.iter().zip(&rest).map(|(c, r)| c - r).collect()
    }

    /// Measured over body, over the background that the pair multiplies.
    fn relative(&self, ratio: &[Complex<f64>], background: &[Complex<f64>]) -> Vec<Complex<f64>> {
        ratio[self.range.clone()].iter().zip(background).map(|(r, b)| r / b).collect()
    }
}

/// The two columns of a trial pair, bare of background, with their products.
struct Trial {
    hz: f64,
    damping: f64,
    first: Vec<Complex<f64>>,
    second: Vec<Complex<f64>>,
    aa: f64,
    ab: f64,
    bb: f64,
}

impl Trial {
    fn new(window: &Window, hz: f64, damping: f64) -> Option<Trial> {
        let p = TAU * hz;
        let shape = |w: f64| Complex::new(p * p - w * w, 2.0 * damping * p * w).inv();
        let mut first: Vec<Complex<f64>> = window.w.iter().map(|&w| shape(w) * (p * p)).collect();
        let mut second: Vec<Complex<f64>> = window.w.iter().map(|&w| shape(w) * Complex::new(0.0, w * p)).collect();
        window.bare(&mut first);
        window.bare(&mut second);
        let (aa, ab, bb) = (dot(&first, &first), dot(&first, &second), dot(&second, &second));
        let det = aa * bb - ab * ab;
        (det > 1e-12 * aa * bb).then_some(Trial { hz, damping, first, second, aa, ab, bb })
    }

    /// The pair that fits bare data best, its strength against at least `floor` of variance.
    fn pair(&self, bare: &[Complex<f64>], floor: f64) -> Resonance {
        let (ya, yb, yy) = (dot(bare, &self.first), dot(bare, &self.second), dot(bare, bare));
        let det = self.aa * self.bb - self.ab * self.ab;
        let (a, b) = ((ya * self.bb - yb * self.ab) / det, (yb * self.aa - ya * self.ab) / det);
        let explained = a * ya + b * yb;
        let free = (2 * bare.len() - 8) as f64;
        let left = ((yy - explained).max(0.0) / free).max(floor);
        let p = TAU * self.hz;
        Resonance {
            hz: self.hz,
            damping: self.damping,
            height_db: f64::NAN,
            depth_db: f64::NAN,
            strength: 0.5 * explained / left,
            a: a * p * p,
            b: b * p,
        }
    }
}

fn dot(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// Trial frequencies with their windows and columns, made once for all rounds.
struct Comb(Vec<(Window, Vec<Trial>)>);

impl Comb {
    fn new(view: &ResponseView, hz: impl Iterator<Item = f64>) -> Comb {
        Comb(
            hz.filter_map(|hz| {
                let window = Window::around(view, hz)?;
                let trials = DAMPINGS.iter().filter_map(|d| Trial::new(&window, hz, *d)).collect();
                Some((window, trials))
            })
            .collect(),
        )
    }

    /// The trial that explains most.
    fn best(&self, ratio: &[Complex<f64>], floor: f64) -> Option<Resonance> {
        let mut best: Option<Resonance> = None;
        for (window, trials) in &self.0 {
            let here = &ratio[window.range.clone()];
            let mut y = window.relative(ratio, &window.background(here));
            window.bare(&mut y);
            for trial in trials {
                let pair = trial.pair(&y, floor);
                if best.is_none_or(|b| pair.strength > b.strength) {
                    best = Some(pair);
                }
            }
        }
        best
    }
}

/// The pairs of a response by rising frequency, between a little above the body and the end of the sweep.
///
/// Empty where nothing stands out of the noise.
pub fn resonances(view: &ResponseView, body: &BodyFit) -> Vec<Resonance> {
    let mut ratio = over_body(view, body);
    let floor = noise_variance(&ratio);
    let (Some(&first), Some(&last)) = (view.hz.first(), view.hz.last()) else { return Vec::new() };
    // Around its own natural frequency the body is what the fit has taken out.
    let natural = body.natural_frequency_hz();
    let low = (first * WINDOW.exp()).max(if natural.is_finite() { 1.8 * natural } else { 0.0 });
    let high = last * (-0.5 * WINDOW).exp();
    let count = ((high / low).ln() / STEP).ceil().max(0.0) as usize;
    let comb = Comb::new(view, (0..count).map(|i| low * (i as f64 * STEP).exp()));
    let mut found: Vec<Resonance> = Vec::new();
    for _ in 0..2 * MOST {
        let best = comb.best(&ratio, floor).and_then(|b| refined(view, &ratio, b, floor));
        let Some(best) = best.filter(|b| b.strength >= LEAST_STRENGTH && b.height_db.is_finite()) else { break };
        for (r, f) in ratio.iter_mut().zip(&view.hz) {
            *r /= best.at(TAU * f);
        }
        // What is left of a pair that is not quite of this shape is no pair of its own.
        let own = |f: &Resonance| (f.hz / best.hz).ln().abs() > 2.0 * f.damping.max(best.damping);
        if best.height_db - best.depth_db >= LEAST_SWING_DB && found.iter().all(own) {
            found.push(best);
        }
        if found.len() == MOST {
            break;
        }
    }
    found.sort_by(|x, y| x.hz.total_cmp(&y.hz));
    found
}

fn over_body(view: &ResponseView, body: &BodyFit) -> Vec<Complex<f64>> {
    view.hz.iter().zip(&view.value).map(|(f, g)| g * body.inverse_at(TAU * f)).collect()
}

/// The strongest pair within an eighth of `hz`, whether or not it stands out: what a known place of trouble shows.
pub(super) fn pair_near(view: &ResponseView, body: &BodyFit, hz: f64) -> Option<Resonance> {
    let ratio = over_body(view, body);
    let comb = Comb::new(view, (-6..=6).map(|i| hz * (STEP * f64::from(i)).exp()));
    comb.best(&ratio, noise_variance(&ratio)).map(Resonance::sized)
}

/// The pair with frequency and damping moved to where it explains most, in turns.
fn refined(view: &ResponseView, ratio: &[Complex<f64>], start: Resonance, floor: f64) -> Option<Resonance> {
    let mut best = start;
    for _ in 0..3 {
        // One window for all trials, so that their strengths compare; the background is that of the data less the pair.
        let window = Window::around(view, best.hz)?;
        let less: Vec<Complex<f64>> =
            ratio[window.range.clone()].iter().zip(&window.w).map(|(r, w)| r / best.at(*w)).collect();
        let mut y = window.relative(ratio, &window.background(&less));
        window.bare(&mut y);
        let pair = |hz: f64, damping: f64| Trial::new(&window, hz, damping).map(|t| t.pair(&y, floor));
        let loss = |hz: f64, damping: f64| pair(hz, damping).map_or(0.0, |p| -p.strength);
        let (hz, damping) = (best.hz, best.damping);
        let hz = hz * golden_section(|x| loss(hz * x.exp(), damping), -1.5 * STEP, 1.5 * STEP, 1e-4).x.exp();
        let wide = golden_section(|x| loss(hz, damping * x.exp()), -0.7, 0.7, 5e-3).x;
        best = pair(hz, (damping * wide.exp()).clamp(1e-3, 0.3))?;
    }
    Some(best.sized())
}

/// Variance per real number of the relative noise, from second differences of neighbours: what is smooth drops out.
pub(super) fn noise_variance(ratio: &[Complex<f64>]) -> f64 {
    let bend: Vec<f64> = ratio.windows(3).map(|r| ((r[0] - r[1] * 2.0 + r[2]) / r[1].norm()).norm_sqr()).collect();
    // 1 + 4 + 1 = 6 times the variance of both parts; the median of its exponential law is ln 2 of the mean.
    let v = median(&bend).unwrap_or(f64::NAN) / (12.0 * std::f64::consts::LN_2);
    // Files print five digits.
    if v.is_finite() { v.max(1e-10) } else { 1e-10 }
}
