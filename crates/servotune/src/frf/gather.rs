//! A long sweep gathered: where neighbours lie on one line, their mean stands for them.
//!
//! In: a response of more than [`GATHERED_ABOVE`] points. Out: one of some hundreds or thousands, with the deviation of every mean. A cell is at most [`WIDEST`] wide
//! in ln w; it is halved until the means of its thirds lie on a line within [`BENT`] or what its own noise lets them. What a cell's bend moves its mean by, three
//! eighths of that, stands in the deviation. Spec: `specs/identification.md`, "Long sweeps".

use super::Frf;
use nalgebra::Complex;

/// Sweeps of more points are gathered for a fit or a search; margins are judged over every point.
pub const GATHERED_ABOVE: usize = 4000;
/// Widest cell (ln w): a half of the step of a sweep of 100 points a decade.
const WIDEST: f64 = 0.01;
/// Bend (ln of the ratio) below which a cell is a line.
const BENT: f64 = 3e-4;
/// The same in standard deviations of the bend: a cell that is halved in vain costs a point more, one that is bent blunts a resonance.
const NOISY: f64 = 1.5;
/// Share of the bend of three thirds by which the mean is off the middle: y'' h²/24 of y'' (h/3)².
const SHARE: f64 = 0.375;
/// Fewest points of a cell; fewer stand for themselves.
const FEWEST: usize = 6;

/// A gathered sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Gathered {
    /// The means, each with its relative deviation.
    pub frf: Frf,
    /// Points that were gathered.
    pub points: usize,
}

/// Gathers a sweep; none where it is short enough as it is.
pub fn gathered(frf: &Frf) -> Option<Gathered> {
    let n = frf.len();
    if n <= GATHERED_ABOVE {
        return None;
    }
    let x: Vec<f64> = frf.w_rad_s().iter().map(|w| w.ln()).collect();
    let mut out = Cells { frf, x, w: Vec::new(), value: Vec::new(), std: Vec::new() };
    let mut from = 0;
    while from < n {
        let end = (from + out.x[from..].partition_point(|x| *x < out.x[from] + WIDEST)).max(from + 1);
        let noise = out.noise(from, end);
        out.cell(from, end, noise);
        from = end;
    }
    let frf = frf.alike(out.w, out.value, Some(out.std)).ok()?;
    Some(Gathered { frf, points: n })
}

struct Cells<'a> {
    frf: &'a Frf,
    x: Vec<f64>,
    w: Vec<f64>,
    value: Vec<Complex<f64>>,
    std: Vec<f64>,
}

impl Cells<'_> {
    /// Variance of one value (relative, both parts together) from second differences, which a line leaves at 6 of it; the file's own where it has one.
    fn noise(&self, from: usize, end: usize) -> f64 {
        if let Some(s) = self.frf.relative_std() {
            return s[from..end].iter().map(|s| s * s).sum::<f64>() / (end - from) as f64;
        }
        // A cell at a gap borrows points from both sides.
        let (low, high) = (from.saturating_sub(FEWEST), (end + FEWEST).min(self.x.len()));
        let v = &self.frf.value()[low..high];
        let mut all: Vec<f64> = v.windows(3).map(|v| (v[0] * v[2] / (v[1] * v[1])).ln().norm_sqr() / 6.0).collect();
        all.sort_by(f64::total_cmp);
        // The middle of an exponential law is ln 2 of its mean: resonances in a few points do not count.
        all.get(all.len() / 2).copied().unwrap_or(0.0) / std::f64::consts::LN_2
    }

    fn cell(&mut self, from: usize, end: usize, variance: f64) {
        let count = end - from;
        if count < FEWEST {
            for i in from..end {
                self.push(self.frf.w_rad_s()[i], self.frf.value()[i], variance.sqrt());
            }
            return;
        }
        let middle = self.frf.value()[from + count / 2];
        let ln: Vec<Complex<f64>> = self.frf.value()[from..end].iter().map(|v| (v / middle).ln()).collect();
        let mean = |a: usize, b: usize| ln[a..b].iter().sum::<Complex<f64>>() / (b - a) as f64;
        let at = |a: usize, b: usize| self.x[from + a..from + b].iter().sum::<f64>() / (b - a) as f64;
        let (a, b) = (count / 3, count - count / 3);
        let (x, y) = ([at(0, a), at(a, b), at(b, count)], [mean(0, a), mean(a, b), mean(b, count)]);
        // Off the line of the outer thirds, twice: the second difference of equal steps.
        let share = (x[1] - x[0]) / (x[2] - x[0]);
        let bend = 2.0 * (y[0] * (1.0 - share) + y[2] * share - y[1]).norm();
        // Variance of y0 - 2 y1 + y2 of thirds.
        let scatter = (18.0 * variance / count as f64).sqrt();
        if bend > BENT.max(NOISY * scatter) {
            let half = from + count / 2;
            self.cell(from, half, variance);
            self.cell(half, end, variance);
            return;
        }
        let off = SHARE * bend.min(BENT);
        let std = (variance / count as f64 + off * off).sqrt();
        self.push(at(0, count).exp(), middle * mean(0, count).exp(), std);
    }

    /// The deviation has a floor: a mean of noiseless values would be an infinite weight.
    fn push(&mut self, w: f64, value: Complex<f64>, std: f64) {
        self.w.push(w);
        self.value.push(value);
        self.std.push(std.max(1e-6));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    fn truth(w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        let pair =
            |wz: f64, wp: f64, d: f64| (s * s + 2.0 * d * wz * s + wz * wz) / (s * s + 2.0 * d * wp * s + wp * wp);
        1e7 / (s * s + 160.0 * s + 369.0 * 369.0)
            * pair(7400.0, 7600.0, 0.005)
            * pair(20_100.0, 20_000.0, 0.003)
            * Complex::from_polar(1.0, -w * 65e-6)
    }

    /// The closed form shares nothing with the gathering: every mean lies as near to it as its deviation says.
    #[test]
    fn means_lie_on_the_truth_within_their_deviation() {
        let mut random = Random::new(4);
        for noise in [0.0, 0.01] {
            let n = 60_000;
            let w: Vec<f64> = (0..n).map(|i| 250.0 + 31_000.0 * i as f64 / n as f64).collect();
            let value = w
                .iter()
                .map(|w| truth(*w) * (1.0 + Complex::new(noise * random.normal(), noise * random.normal())))
                .collect();
            let frf = Frf::new(w, value, None).unwrap().with_unstable_poles(1);
            let g = gathered(&frf).unwrap();
            assert_eq!(g.frf.unstable_poles(), 1, "the mean of a sweep is of the same plant");
            assert!(g.points == n && g.frf.len() < n / 10, "{}", g.frf.len());
            let std = g.frf.relative_std().unwrap();
            let score = |i: usize| (g.frf.value()[i] / truth(g.frf.w_rad_s()[i]) - 1.0).norm() / std[i];
            let mut all: Vec<f64> = (0..g.frf.len()).map(score).collect();
            all.sort_by(f64::total_cmp);
            let (middle, worst) = (all[all.len() / 2], all[all.len() - 1]);
            // |e|/σ of a complex normal: middle 0.83; one in 10^5 above 3.4, and the local noise is known to some tens of per cent.
            assert!(middle < 1.2 && worst < 6.0, "noise {noise}: {middle} {worst}");
        }
    }
}
