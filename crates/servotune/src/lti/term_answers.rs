//! The plant's answer to one input, kept term by term: a plant that shares most of its terms is then answered for at the price of
//! the terms that moved.
//!
//! A term's state under the bare input, s[k+1] = λ s[k] + u[k], depends on its pole alone. Residue, gain and delay only weigh it:
//! y[k] = Σ Re(now s[k-D] + before s[k-D-1]).

use super::DiscretePlant;
use crate::numeric::wide::wide;

/// States of every term of a plant under one input, from rest.
#[derive(Clone, Debug)]
pub struct TermAnswers {
    input: Vec<f64>,
    terms: Vec<Term>,
}

#[derive(Clone, Debug)]
struct Term {
    lambda: [f64; 2],
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Term {
    fn of(lambda: [f64; 2], input: &[f64]) -> Term {
        let [lr, li] = lambda;
        let (mut a, mut b) = (0.0, 0.0);
        let mut term = Term { lambda, re: Vec::with_capacity(input.len()), im: Vec::with_capacity(input.len()) };
        for u in input {
            term.re.push(a);
            term.im.push(b);
            (a, b) = (lr * a - li * b + u, li * a + lr * b);
        }
        term
    }

    /// Adds Re(now s[k-D] + before s[k-D-1]); the state at the first sample is 0.
    #[inline(always)]
    fn add(&self, now: [f64; 2], before: [f64; 2], whole: usize, out: &mut [f64]) {
        let n = out.len().min(self.re.len() + whole);
        if whole + 1 >= n {
            return;
        }
        let m = n - whole - 1;
        let (re, im) = (&self.re[..m + 1], &self.im[..m + 1]);
        let (re_now, re_before, im_now, im_before) = (&re[1..], &re[..m], &im[1..], &im[..m]);
        if before == [0.0; 2] {
            for (k, y) in out[whole + 1..n].iter_mut().enumerate() {
                *y += now[0] * re_now[k] - now[1] * im_now[k];
            }
            return;
        }
        for (k, y) in out[whole + 1..n].iter_mut().enumerate() {
            *y += (now[0] * re_now[k] - now[1] * im_now[k]) + (before[0] * re_before[k] - before[1] * im_before[k]);
        }
    }
}

impl TermAnswers {
    /// The terms of `plant` under an input held over each sample.
    pub fn of(plant: &DiscretePlant, input: &[f64]) -> TermAnswers {
        let lambda = plant.lambda_re.iter().zip(&plant.lambda_im).map(|(r, i)| [*r, *i]);
        TermAnswers { terms: lambda.map(|l| Term::of(l, input)).collect(), input: input.to_vec() }
    }

    /// Adds `share` times the answer of a plant to the input, from rest; its terms need not be the same.
    pub fn add(&self, plant: &DiscretePlant, share: f64, out: &mut [f64]) {
        for i in 0..plant.lambda_re.len() {
            let lambda = [plant.lambda_re[i], plant.lambda_im[i]];
            let now = [share * plant.now_re[i], share * plant.now_im[i]];
            let before = [share * plant.before_re[i], share * plant.before_im[i]];
            let kept = self.terms.get(i).filter(|t| t.lambda == lambda);
            match kept.or_else(|| self.terms.iter().find(|t| t.lambda == lambda)) {
                Some(term) => wide(|| term.add(now, before, plant.whole, out)),
                None => Term::of(lambda, &self.input).add(now, before, plant.whole, out),
            }
        }
        plant.add_rigid(&self.input, share, out);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{Body, Mode, Plant};
    use crate::numeric::random::Random;

    fn plant(body: Body, pole_hz: f64, delay_s: f64) -> DiscretePlant {
        let w = std::f64::consts::TAU * pole_hz;
        let mode =
            |w: f64| Mode { pole_rad_s: w, pole_damping_ratio: 0.02, zero_rad_s: 0.9 * w, zero_damping_ratio: 0.03 };
        let plant = Plant {
            position_unit: "track".into(),
            command_unit: "V".into(),
            body,
            delay_s,
            resonance_gain: 1.0,
            modes: vec![mode(w), mode(1.9e4)],
            physics: Vec::new(),
        };
        DiscretePlant::of(&plant, 4e-5).unwrap()
    }

    #[test]
    fn another_plants_answer_is_the_simulated_one() {
        let mut random = Random::new(5);
        let input: Vec<f64> = (0..400).map(|_| random.normal()).collect();
        let bodies = [
            Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
            Body::FreeInertia { acceleration_gain: 1e5, viscous_rate_per_s: 3.0 },
            Body::FreeInertia { acceleration_gain: 1e5, viscous_rate_per_s: 0.0 },
        ];
        for body in bodies {
            let kept = TermAnswers::of(&plant(body.clone(), 700.0, 9e-5), &input);
            // The same pole with other delays, and a pole that moved.
            for (pole, delay) in [(700.0, 9e-5), (700.0, 0.0), (700.0, 2e-4), (731.0, 1.3e-4), (700.0, 0.03)] {
                let other = plant(body.clone(), pole, delay);
                let (mut found, mut simulated) = (vec![0.5; 400], vec![0.0; 400]);
                kept.add(&other, 2.0, &mut found);
                other.add_response(&input, &mut simulated);
                let size = simulated.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                for (a, b) in found.iter().zip(&simulated) {
                    assert!((a - 0.5 - 2.0 * b).abs() <= 1e-12 * size, "{a} {b}");
                }
            }
        }
    }
}
