//! One judge of the gate: a network and a discriminant on the same features.
//!
//! In: a row. Out: the probability of each class. The two are mixed in shares that rows held out from both have chosen: a network
//! that has learned little from few rows counts for little. The gate has one judge for each fold and one of the published training;
//! its probabilities are their mean. Spec: `specs/gate.md`.

use super::GateError;
use super::calibrate::{Calibration, Logits, calibrate, calibration_error, log_loss, probabilities};
use super::discriminant::{Discriminant, steadied};
use super::network::{Desk, Network};
use super::scale::Scale;
use super::table::Column;
use serde::{Deserialize, Serialize};

/// A network and a discriminant on the same features.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Statistics of the features.
    pub scale: Scale,
    /// The network.
    pub network: Network,
    /// How far its logits typically reach.
    pub unit: f64,
    /// The discriminant on normalised values.
    pub linear: Discriminant,
}

/// How the network's and the discriminant's word are mixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mix {
    /// Share of the network's probabilities.
    pub network_share: f64,
    /// The network's logits are divided by this, in its own unit.
    pub network_temperature: f64,
    /// The discriminant's scores are divided by this.
    pub linear_temperature: f64,
    /// Log loss of the calibrated network on held-out rows (nat).
    pub network_loss: f64,
    /// Log loss of the calibrated discriminant on the same rows (nat).
    pub linear_loss: f64,
}

/// What both said of one row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Said {
    pub network: Logits,
    pub linear: Vec<f64>,
}

impl Member {
    pub(super) fn of(
        scale: Scale,
        network: Network,
        unit: f64,
        columns: &[&Column],
        rows: &[usize],
        class: &[usize],
        classes: usize,
    ) -> Result<Member, GateError> {
        let x: Vec<f64> = scale.inputs(columns, rows).into_iter().map(f64::from).collect();
        let class: Vec<usize> = rows.iter().map(|&r| class[r]).collect();
        let linear = steadied(&x, columns.len(), &class, classes)?;
        Ok(Member { scale, network, unit, linear })
    }

    /// What both say of each row of inputs.
    pub(super) fn say(&self, inputs: &[f32], desk: &mut Desk) -> Vec<Said> {
        let classes = self.network.sizes[self.network.layers()];
        let raw = self.network.logits(inputs, desk);
        let both = |(z, x): (&[f64], &[f32])| {
            let x: Vec<f64> = x.iter().copied().map(f64::from).collect();
            Said { network: Logits { raw: z.to_vec(), unit: self.unit }, linear: self.linear.scores(&x) }
        };
        raw.chunks(classes).zip(inputs.chunks(self.network.sizes[0])).map(both).collect()
    }
}

/// Steps of the mixing share's fixed point; each raises the likelihood.
const STEPS: usize = 200;

impl Mix {
    /// Learns temperatures and shares from rows that neither had seen.
    pub(super) fn of(said: &[Said], class: &[usize]) -> (Mix, Calibration) {
        let network: Vec<Logits> = said.iter().map(|s| s.network.clone()).collect();
        let linear: Vec<Logits> = said.iter().map(|s| Logits { raw: s.linear.clone(), unit: 1.0 }).collect();
        let (a, b) = (calibrate(&network, class), calibrate(&linear, class));
        let mut mix = Mix {
            network_share: 0.5,
            network_temperature: a.temperature,
            linear_temperature: b.temperature,
            network_loss: a.loss_after,
            linear_loss: b.loss_after,
        };
        let both: Vec<[f64; 2]> = said.iter().zip(class).map(|(s, &y)| mix.parts(s).map(|p| p[y].max(1e-12))).collect();
        // The likelihood of a mixture is concave in its share: expectation and maximisation climb it. One row for each side is
        // counted besides, so that a handful of rows does not silence either.
        for _ in 0..STEPS {
            let w = mix.network_share;
            let sum: f64 = both.iter().map(|[n, l]| w * n / (w * n + (1.0 - w) * l)).sum();
            mix.network_share = (sum + 1.0) / (both.len() as f64 + 2.0);
        }
        let p: Vec<Vec<f64>> = said.iter().map(|s| mix.probabilities(s)).collect();
        let after = Calibration { error_after: calibration_error(&p, class), loss_after: log_loss(&p, class), ..a };
        (mix, after)
    }

    fn parts(&self, said: &Said) -> [Vec<f64>; 2] {
        let n = &said.network;
        [probabilities(&n.raw, self.network_temperature * n.unit), probabilities(&said.linear, self.linear_temperature)]
    }

    /// The mixture's probability of each class.
    pub(super) fn probabilities(&self, said: &Said) -> Vec<f64> {
        let [n, l] = self.parts(said);
        let w = self.network_share;
        n.iter().zip(&l).map(|(n, l)| w * n + (1.0 - w) * l).collect()
    }

    pub(super) fn sound(&self) -> bool {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        (0.0..=1.0).contains(&self.network_share)
            && positive(self.network_temperature)
            && positive(self.linear_temperature)
    }
}

/// Mean of several judges' probabilities.
pub(super) fn mean(p: &[Vec<f64>]) -> Vec<f64> {
    let n = p.len().max(1) as f64;
    let k = p.first().map_or(0, Vec::len);
    (0..k).map(|j| p.iter().map(|p| p[j]).sum::<f64>() / n).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_that_knows_nothing_is_not_asked() {
        // The discriminant is right in nine rows of ten and says so; the network's logits have nothing to do with the class.
        let class: Vec<usize> = (0..400).map(|i| i % 2).collect();
        let row = |(i, &y): (usize, &usize)| {
            let right = if i % 10 < 9 { 1.1 } else { -1.1 };
            let sign = if y == 0 { right } else { -right };
            let odd = if (i / 2) % 2 == 0 { 3.0 } else { -3.0 };
            Said { network: Logits { raw: vec![odd, -odd], unit: 1.0 }, linear: vec![sign, -sign] }
        };
        let said: Vec<Said> = class.iter().enumerate().map(row).collect();
        let (mix, c) = Mix::of(&said, &class);
        // The entropy of one in ten is 0.325 nat.
        assert!(mix.network_share < 0.1 && c.loss_after < 0.36, "{mix:?} {c:?}");
    }
}
