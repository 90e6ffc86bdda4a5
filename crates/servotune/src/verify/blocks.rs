//! A plant with roots of any kind as a chain of blocks of first and second order, for the write.
//!
//! In: a plant whose body is rational. Out: the rates and the output of a cascade. Each block is up/down of degree 1 or 2; one of equal degrees hands its input on, the last ones
//! do not. States of a second-order block are w/q and s/q, w² the size of its last coefficient, so that all are of one size.

use crate::lti::{Plant, Rational};
use nalgebra::{Complex, DMatrix, DVector};

/// up(s)/down(s), coefficients from the constant on; down is monic.
struct Block {
    up: Vec<f64>,
    down: Vec<f64>,
}

/// Blocks in a row.
pub(super) struct Chain {
    blocks: Vec<Block>,
    gain: f64,
}

/// Roots by groups: pairs by their polynomial, real ones.
fn groups(all: &[Complex<f64>]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let pairs = all.iter().filter(|r| r.im > 0.0).map(|r| vec![r.norm_sqr(), -2.0 * r.re, 1.0]).collect();
    (pairs, all.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect())
}

impl Chain {
    pub fn of(p: &Plant, r: &Rational) -> Chain {
        let quadratic = |w: f64, d: f64| vec![w * w, 2.0 * d * w, 1.0];
        let mut blocks: Vec<Block> = p
            .modes
            .iter()
            .map(|m| Block {
                up: quadratic(m.zero_rad_s, m.zero_damping_ratio),
                down: quadratic(m.pole_rad_s, m.pole_damping_ratio),
            })
            .collect();
        let (mut zero_pairs, mut zeros) = groups(&r.zeros);
        let (mut pole_pairs, mut poles) = groups(&r.poles);
        // The slowest poles come last: integrators stand behind all that is fast.
        poles.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let both = |a: f64, b: f64| vec![a * b, -(a + b), 1.0];
        while let Some(up) = zero_pairs.pop() {
            let down = pole_pairs.pop().or_else(|| Some(both(poles.pop()?, poles.pop()?)));
            // Fewer zeros than poles: there is always a pair of poles, complex or real, unless one of each kind is left.
            if let Some(down) = down {
                blocks.push(Block { up, down });
            }
        }
        while let Some(z) = zeros.pop() {
            if let Some(p) = poles.pop() {
                blocks.push(Block { up: vec![-z, 1.0], down: vec![-p, 1.0] });
            } else if let Some(down) = pole_pairs.pop() {
                let up = zeros.pop().map_or(vec![-z, 1.0], |y| both(y, z));
                blocks.push(Block { up, down });
            }
        }
        blocks.extend(pole_pairs.into_iter().map(|down| Block { up: vec![1.0], down }));
        blocks.extend(poles.into_iter().rev().map(|p| Block { up: vec![1.0], down: vec![-p, 1.0] }));
        Chain { blocks, gain: p.resonance_gain * r.gain }
    }

    /// [[A, B], [0, 0]] and C.
    pub fn cascade(&self) -> (DMatrix<f64>, DVector<f64>) {
        let n: usize = self.blocks.iter().map(|b| b.down.len() - 1).sum();
        let mut rates = DMatrix::zeros(n + 1, n + 1);
        // What enters the present block: a row over the states before, and over the input.
        let mut entering = DVector::zeros(n + 1);
        entering[n] = 1.0;
        let mut gain = self.gain;
        let mut at = 0;
        for b in &self.blocks {
            let degree = b.down.len() - 1;
            let through = if b.up.len() > degree { 1.0 } else { 0.0 };
            let up = |k: usize| b.up.get(k).copied().unwrap_or_default();
            let mut leaving = &entering * through;
            if degree == 1 {
                // x = rate v/(s - p), the rate that of the pole where it has one.
                let p = -b.down[0];
                let rate = if p == 0.0 || through > 0.0 { 1.0 } else { p.abs() };
                rates[(at, at)] = p;
                for j in 0..=n {
                    rates[(at, j)] += rate * entering[j];
                }
                leaving[at] += if through > 0.0 { up(0) - b.down[0] } else { 1.0 };
                gain *= if through > 0.0 { 1.0 } else { up(0) / rate };
            } else {
                let w = if b.down[0] == 0.0 { b.down[1].abs().max(1.0) } else { b.down[0].abs().sqrt() };
                rates[(at, at + 1)] = w;
                rates[(at + 1, at)] = -b.down[0] / w;
                rates[(at + 1, at + 1)] = -b.down[1];
                for j in 0..=n {
                    rates[(at + 1, j)] += entering[j];
                }
                let scale = if through > 0.0 { 1.0 } else { w };
                // up - through down over q, in x = w/q and v = s/q; without a way through times w, so that its size is its input's.
                leaving[at] += (up(0) - through * b.down[0]) / w * if through > 0.0 { 1.0 } else { w };
                leaving[at + 1] += (up(1) - through * b.down[1]) * scale;
                gain /= scale;
            }
            entering = leaving;
            at += degree;
        }
        let output = DVector::from_fn(n, |j, _| gain * entering[j]);
        (rates, output)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, FrequencyResponse, Mode};
    use crate::verify::cascade::Cascade;

    #[test]
    fn the_chain_has_the_plants_response() {
        let c = |re: f64, im: f64| Complex::new(re, im);
        let mode = Mode { zero_rad_s: 6800.0, zero_damping_ratio: 0.02, pole_rad_s: 7000.0, pole_damping_ratio: 0.03 };
        let pair = |re: f64, im: f64| [c(re, im), c(re, -im)];
        type Roots = Vec<Complex<f64>>;
        let cases: [(Roots, Roots); 5] = [
            (vec![c(900.0, 0.0)], vec![c(0.0, 0.0), c(0.0, 0.0), c(-6e3, 0.0)]),
            (vec![], vec![c(250.0, 0.0), c(-250.0, 0.0), c(-6e3, 0.0)]),
            (vec![c(-30.0, 0.0), c(40.0, 0.0)], [pair(-80.0, 900.0), pair(20.0, 3e4)].concat()),
            (pair(-5.0, 700.0).to_vec(), vec![c(0.0, 0.0), c(-90.0, 0.0), c(-3e3, 0.0), c(-4e3, 0.0)]),
            (
                [pair(-5.0, 700.0).to_vec(), vec![c(-4.0, 0.0)]].concat(),
                [pair(30.0, 900.0).to_vec(), vec![c(-7.0, 0.0), c(0.0, 0.0)]].concat(),
            ),
        ];
        for (zeros, poles) in cases {
            let p = Plant {
                position_unit: "um".into(),
                command_unit: "A".into(),
                body: Body::Rational(Rational { gain: 3e9, zeros, poles }),
                delay_s: 0.0,
                resonance_gain: 0.8,
                modes: vec![mode],
                physics: vec![],
            };
            let cascade = Cascade::of(&p);
            let n = cascade.output.len();
            assert_eq!(n, p.order());
            for w in [3.0, 240.0, 3e3, 6.9e3, 4e4] {
                let m = DMatrix::from_fn(n, n, |i, j| {
                    let own = if i == j { c(0.0, w) } else { c(0.0, 0.0) };
                    own - cascade.rates[(i, j)]
                });
                let b = DVector::from_fn(n, |i, _| c(cascade.rates[(i, n)], 0.0));
                let x = m.lu().solve(&b).unwrap();
                let y: Complex<f64> = x.iter().zip(cascade.output.iter()).map(|(x, o)| x * *o).sum();
                // A handful of roundings under a conditioning of at most some thousand.
                assert!((y / p.at(w) - 1.0).norm() < 1e-10, "{w} {}", y / p.at(w));
            }
        }
    }
}
