//! Calibration: probabilities that mean what they say.
//!
//! In: logits of rows that the network was not trained on, and their classes. Out: one temperature, and the expected calibration error
//! before and after. Temperature scaling (Guo et al. 2017); targets after Platt (1999), so that no error among n rows is not read as
//! a probability of error of zero. Spec: `specs/gate.md`.

use super::network::softmax;
use crate::numeric::golden::golden_section;
use serde::{Deserialize, Serialize};

/// What calibration did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Leads are divided by it.
    pub temperature: f64,
    /// Rows it was learned from.
    pub rows: usize,
    /// Expected calibration error with temperature 1.
    pub error_before: f64,
    /// Expected calibration error on the same rows with this temperature.
    pub error_after: f64,
    /// Mean negative log likelihood with temperature 1 (nat).
    pub loss_before: f64,
    /// Mean negative log likelihood with this temperature (nat).
    pub loss_after: f64,
}

/// What a network says of a row, and how far its logits typically reach.
#[derive(Clone, Debug, PartialEq)]
pub struct Logits {
    /// One a class.
    pub raw: Vec<f64>,
    /// The network's own unit.
    pub unit: f64,
}

/// Doubt that a table without any error leaves, at most: 1/(n + 2) of a handful of rows would forbid every dear decision.
const MOST_DOUBT: f64 = 0.005;
/// Bins of the calibration error.
const BINS: usize = 10;

/// Probabilities of one row of logits at a temperature.
pub fn probabilities(logits: &[f64], temperature: f64) -> Vec<f64> {
    let mut p: Vec<f64> = logits.iter().map(|z| z / temperature).collect();
    softmax(&mut p);
    p
}

/// Expected calibration error: ten even bins of the top probability; the mean distance of confidence from accuracy.
pub fn calibration_error(p: &[Vec<f64>], class: &[usize]) -> f64 {
    let mut bins = [[0.0f64; 2]; BINS];
    for (p, &y) in p.iter().zip(class) {
        let (best, top) = p.iter().enumerate().fold((0, 0.0), |b, (i, &v)| if v > b.1 { (i, v) } else { b });
        let bin = &mut bins[((top * BINS as f64) as usize).min(BINS - 1)];
        bin[0] += top;
        bin[1] += f64::from(u8::from(best == y));
    }
    bins.iter().map(|[confidence, right]| (confidence - right).abs()).sum::<f64>() / class.len().max(1) as f64
}

/// Mean negative log likelihood (nat), no probability counted below 1e-12.
pub fn log_loss(p: &[Vec<f64>], class: &[usize]) -> f64 {
    p.iter().zip(class).map(|(p, &y)| -p[y].max(1e-12).ln()).sum::<f64>() / class.len().max(1) as f64
}

/// Finds the temperature, in each network's own unit.
pub fn calibrate(logits: &[Logits], class: &[usize]) -> Calibration {
    let raw = logits.iter().map(|z| probabilities(&z.raw, 1.0)).collect::<Vec<_>>();
    let scaled: Vec<Vec<f64>> = logits.iter().map(|z| z.raw.iter().map(|v| v / z.unit).collect()).collect();
    let n = class.len() as f64;
    let doubt = (1.0 / (n + 2.0)).min(MOST_DOUBT);
    let score = |log_t: f64| {
        let t = log_t.exp();
        let of = |z: &Vec<f64>, y: usize| {
            let top = z.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
            let sum = z.iter().map(|v| ((v - top) / t).exp()).sum::<f64>().ln();
            let loss = |k: usize| sum - (z[k] - top) / t;
            let others = (z.len() - 1).max(1) as f64;
            (0..z.len()).map(|k| loss(k) * if k == y { 1.0 - doubt } else { doubt / others }).sum::<f64>()
        };
        scaled.iter().zip(class).map(|(z, &y)| of(z, y)).sum::<f64>()
    };
    // In units of the typical lead: from a probability of 1 - e^-400 at that lead to no lead at all.
    let temperature = golden_section(score, -6.0, 6.0, 1e-6).x.exp();
    let after: Vec<Vec<f64>> = scaled.iter().map(|z| probabilities(z, temperature)).collect();
    let before = raw;
    Calibration {
        temperature,
        rows: class.len(),
        error_before: calibration_error(&before, class),
        error_after: calibration_error(&after, class),
        loss_before: log_loss(&before, class),
        loss_after: log_loss(&after, class),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn a_known_temperature_is_found() {
        // Labels drawn from the softmax of z; the network claims 3 z, so the temperature is 3.
        let mut random = Random::new(5);
        let (mut logits, mut class) = (Vec::new(), Vec::new());
        for _ in 0..20_000 {
            let z: Vec<f64> = (0..3).map(|_| 1.5 * random.normal()).collect();
            let p = probabilities(&z, 1.0);
            let u = random.uniform();
            class.push(if u < p[0] {
                0
            } else if u < p[0] + p[1] {
                1
            } else {
                2
            });
            logits.push(Logits { raw: z.iter().map(|v| 3.0 * v).collect(), unit: 1.0 });
        }
        let c = calibrate(&logits, &class);
        // The standard error of ln T is about 1/sqrt(n) = 0.7 %; five of them.
        assert!((c.temperature / 3.0 - 1.0).abs() < 0.035, "{c:?}");
        assert!(c.error_before > 0.1 && c.error_after < 0.015, "{c:?}");
    }
}
