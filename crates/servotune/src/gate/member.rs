//! One judge of the gate: a network and a discriminant on the same features.
//!
//! In: a row. Out: the leads of the classes. The two are added, each in its own unit, in shares that rows held out from both have
//! chosen: a network that has learned little from few rows counts for little. The gate has one judge for each fold and one of the
//! published training; the mean of their leads gives its probabilities. Spec: `specs/gate.md`.

use super::GateError;
use super::calibrate::{Calibration, Logits, calibrate, calibration_error, log_loss, probabilities};
use super::conformal::top;
use super::discriminant::{Discriminant, steadied};
use super::network::{Network, NetworkWorkspace};
use super::scale::{Scale, median};
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

/// How the network's and the discriminant's word are added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ensemble {
    /// Share of the network.
    pub network_share: f64,
    /// How far the discriminant's scores typically reach.
    pub linear_unit: f64,
    /// The sum is divided by this.
    pub temperature: f64,
    /// Log loss of the network alone on held-out rows, calibrated (nat).
    pub network_loss: f64,
    /// Log loss of the discriminant alone on the same rows, calibrated (nat).
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
    pub(super) fn say(&self, inputs: &[f32], workspace: &mut NetworkWorkspace) -> Vec<Said> {
        let classes = self.network.sizes[self.network.layers()];
        let raw = self.network.logits(inputs, workspace);
        let both = |(z, x): (&[f64], &[f32])| {
            let x: Vec<f64> = x.iter().copied().map(f64::from).collect();
            Said { network: Logits { raw: z.to_vec(), unit: self.unit }, linear: self.linear.scores(&x) }
        };
        raw.chunks(classes).zip(inputs.chunks(self.network.sizes[0])).map(both).collect()
    }
}

/// Shares tried: 0 to 1 in as many steps.
const STEPS: usize = 20;

impl Ensemble {
    /// Learns shares and temperature from rows that neither had seen.
    pub(super) fn of(said: &[Said], class: &[usize]) -> (Ensemble, Calibration) {
        let lead = |s: &Said| {
            let best = top(&s.linear);
            let others = s.linear.iter().enumerate().filter(|(k, _)| *k != best);
            s.linear[best] - others.fold(f64::NEG_INFINITY, |m, (_, v)| m.max(*v))
        };
        let linear_unit = median(said.iter().map(lead)).max(1e-3);
        let mix = |network_share| Ensemble {
            network_share,
            linear_unit,
            temperature: 1.0,
            network_loss: 0.0,
            linear_loss: 0.0,
        };
        let tried: Vec<Calibration> = (0..=STEPS)
            .map(|i| {
                let m = mix(i as f64 / STEPS as f64);
                let sum: Vec<Logits> = said.iter().map(|s| Logits { raw: m.leads(s), unit: 1.0 }).collect();
                calibrate(&sum, class)
            })
            .collect();
        // Of equals the one nearest to even shares.
        let order = |i: &usize, j: &usize| {
            let from_even = |i: usize| (2 * i).abs_diff(STEPS);
            tried[*i].loss_after.total_cmp(&tried[*j].loss_after).then(from_even(*i).cmp(&from_even(*j)))
        };
        let best = (0..=STEPS).min_by(order).unwrap_or(STEPS);
        let found = Ensemble {
            temperature: tried[best].temperature,
            network_loss: tried[STEPS].loss_after,
            linear_loss: tried[0].loss_after,
            ..mix(best as f64 / STEPS as f64)
        };
        // Before: the networks by themselves, as they stand.
        let raw: Vec<Vec<f64>> = said.iter().map(|s| probabilities(&s.network.raw, 1.0)).collect();
        let before = Calibration {
            error_before: calibration_error(&raw, class),
            loss_before: log_loss(&raw, class),
            ..tried[best].clone()
        };
        (found, before)
    }

    /// Leads of the classes before the temperature.
    fn leads(&self, said: &Said) -> Vec<f64> {
        let w = self.network_share;
        let n = &said.network;
        n.raw.iter().zip(&said.linear).map(|(n_, l)| w * n_ / n.unit + (1.0 - w) * l / self.linear_unit).collect()
    }

    /// The sum, as logits.
    pub(super) fn logits(&self, said: &Said) -> Vec<f64> {
        self.leads(said).into_iter().map(|z| z / self.temperature).collect()
    }

    /// The sum's probability of each class.
    pub(super) fn probabilities(&self, said: &Said) -> Vec<f64> {
        probabilities(&self.logits(said), 1.0)
    }

    pub(super) fn sound(&self) -> bool {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        (0.0..=1.0).contains(&self.network_share) && positive(self.temperature) && positive(self.linear_unit)
    }
}

/// Mean of several judges' logits.
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
        let (mix, c) = Ensemble::of(&said, &class);
        // The entropy of one in ten is 0.325 nat.
        assert!(mix.network_share < 0.1 && c.loss_after < 0.34, "{mix:?} {c:?}");
    }
}
