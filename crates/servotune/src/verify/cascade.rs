//! The plant as a cascade of first- and second-order states, and its loop stepped from one controller sample to the next.
//!
//! In: plant without partial fractions, sections. Out: positions under held commands. The transitions are matrix exponentials of twice the precision,
//! rounded once, so that every coefficient is right to its last digit.

use super::blocks::Chain;
use crate::controller::Controller;
use crate::lti::{Body, Plant, Section};
use crate::numeric::twofold::exponential;
use nalgebra::{DMatrix, DVector};

/// The continuous plant without its delay: x' = A x + B u, y = C x.
pub(super) struct Cascade {
    /// [[A, B], [0, 0]].
    pub rates: DMatrix<f64>,
    pub output: DVector<f64>,
}

impl Cascade {
    /// Every pair of resonances is 1 + (b1 s + b0)/q(s); its states are w/q and s/q, so that all are of one size.
    pub fn of(p: &Plant) -> Cascade {
        let p = &p.paired();
        if let Body::Rational(r) = &p.body {
            let (rates, output) = Chain::of(p, r).cascade();
            return Cascade { rates, output };
        }
        let n = 2 * (p.modes.len() + 1);
        let mut rates = DMatrix::zeros(n + 1, n + 1);
        let mut output = DVector::zeros(n);
        // What enters the present pair: the input, and a row over the states before.
        let mut entering = DVector::zeros(n);
        for (i, m) in p.modes.iter().enumerate() {
            let (a, b, w) = (2 * i, 2 * i + 1, m.pole_rad_s);
            rates[(a, b)] = w;
            rates[(b, a)] = -w;
            rates[(b, b)] = -2.0 * m.pole_damping_ratio * w;
            rates[(b, n)] = 1.0;
            for j in 0..a {
                rates[(b, j)] += entering[j];
            }
            entering[a] = (m.zero_rad_s - w) * (m.zero_rad_s + w) / w;
            entering[b] = 2.0 * (m.zero_damping_ratio * m.zero_rad_s - m.pole_damping_ratio * w);
        }
        let (a, b) = (n - 2, n - 1);
        match p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
                rates[(a, b)] = w;
                rates[(b, a)] = -w;
                rates[(b, b)] = -2.0 * damping_ratio * w;
                output[a] = p.resonance_gain * dc_gain * w;
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                rates[(a, b)] = 1.0;
                rates[(b, b)] = -viscous_rate_per_s;
                output[a] = p.resonance_gain * acceleration_gain;
            }
            // Taken above.
            Body::Rational(_) => {}
        }
        rates[(b, n)] = 1.0;
        for j in 0..a {
            rates[(b, j)] += entering[j];
        }
        Cascade { rates, output }
    }
}

/// The closed loop between two controller samples.
pub(super) struct Loop<'a> {
    pub cascade: Cascade,
    pub sections: &'a [Section],
    /// State and input to the state when the delayed command changes.
    pub first: (DMatrix<f64>, DVector<f64>),
    /// From there to the next controller sample.
    pub second: (DMatrix<f64>, DVector<f64>),
    /// Dead time: whole samples, and what is left (s).
    pub whole: usize,
    pub rest: f64,
    /// output A^m/m! for m = 0, 1, ...: how the position goes on, Taylor.
    pub onward: Vec<DVector<f64>>,
}

/// What the loop remembers.
#[derive(Clone)]
pub(super) struct State {
    pub x: DVector<f64>,
    pub memory: Vec<[f64; 2]>,
    pub held: Vec<f64>,
}

/// Terms of the Taylor series of a reading.
const TERMS: usize = 48;

impl<'a> Loop<'a> {
    pub fn of(plant: &Plant, sections: &'a [Section], c: &Controller) -> Loop<'a> {
        let cascade = Cascade::of(plant);
        let t = c.sample_time_s;
        let samples = plant.delay_s / t;
        let nearest = samples.round();
        let whole = if (samples - nearest).abs() < 1e-9 { nearest } else { samples.floor() };
        let rest = (plant.delay_s - whole * t).max(0.0);
        let n = cascade.output.len();
        let rows: Vec<Vec<f64>> = cascade.rates.row_iter().map(|r| r.iter().copied().collect()).collect();
        let step = |h: f64| {
            let e = exponential(&rows, h);
            (DMatrix::from_fn(n, n, |i, j| e[i][j].value()), DVector::from_fn(n, |i, _| e[i][n].value()))
        };
        let (first, second) = (step(rest), step(t - rest));
        let mut onward = vec![cascade.output.clone().insert_row(n, 0.0)];
        for m in 1..TERMS {
            onward.push(cascade.rates.tr_mul(&onward[m - 1]) / m as f64);
        }
        Loop { cascade, sections, first, second, whole: whole as usize, rest, onward }
    }

    pub fn at_rest(&self) -> State {
        State {
            x: DVector::zeros(self.cascade.output.len()),
            memory: vec![[0.0; 2]; self.sections.len()],
            held: vec![0.0; self.whole + 2],
        }
    }

    /// The law's answer to an error.
    pub fn law(&self, state: &mut State, error: f64) -> f64 {
        let mut signal = error;
        // Direct form I/II differ in rounding only; here each section keeps its own states w.
        for (s, m) in self.sections.iter().zip(&mut state.memory) {
            let w = signal - s.a1 * m[0] - s.a2 * m[1];
            signal = s.b0 * w + s.b1 * m[0] + s.b2 * m[1];
            *m = [w, m[0]];
        }
        signal
    }

    /// Holds `input` from now on. Out: the state when the delayed input changes, and the inputs before and after.
    pub fn hold(&self, state: &mut State, input: f64) -> (DVector<f64>, f64, f64) {
        state.held.rotate_right(1);
        state.held[0] = input;
        let (now, before) = (state.held[self.whole], state.held[self.whole + 1]);
        (&self.first.0 * &state.x + &self.first.1 * before, before, now)
    }

    /// Goes on from that state to the next controller sample.
    pub fn advance(&self, state: &mut State, middle: &DVector<f64>, now: f64) {
        state.x = &self.second.0 * middle + &self.second.1 * now;
    }

    /// The row that reads the position `h` seconds after a state, its last entry for the input.
    pub fn reading(&self, h: f64) -> DVector<f64> {
        self.onward.iter().rev().fold(DVector::zeros(self.cascade.output.len() + 1), |sum, row| sum * h + row)
    }
}
