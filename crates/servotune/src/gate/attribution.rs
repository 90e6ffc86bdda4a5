//! Why the network said so: what each feature added.
//!
//! In: a network, one row, the row of training medians. Out: for each feature its share of the lead of the class over the runner-up.
//! Integrated gradients (Sundararajan, Taly & Yan 2017, eq. (1)) from the medians to the row; the shares sum to the change of the lead.
//! Spec: `specs/gate.md`.

use super::network::{Network, NetworkWorkspace};
use serde::Serialize;

/// What one feature had to say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decided {
    /// Its name.
    pub feature: String,
    /// Its value; none where it is missing.
    pub value: Option<f64>,
    /// Its median over the training rows.
    pub training_median: f64,
    /// Where the value lies.
    pub direction: Direction,
    /// Its part of the lead of the class over the runner-up (logits; negative speaks against the class).
    pub share: f64,
}

/// Where a value lies against the training median.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Above it.
    Above,
    /// Below it.
    Below,
    /// On it, or missing and put there.
    Equal,
}

/// Steps of the path; the error of the midpoint rule is far below a percent of the lead for ReLU networks of this size.
pub(super) const STEPS: usize = 32;

/// Share of each input in `logit[class] - logit[other]`, on the straight path from `from` to `to`.
pub fn shares(
    network: &Network,
    from: &[f32],
    to: &[f32],
    class: usize,
    other: usize,
    workspace: &mut NetworkWorkspace,
) -> Vec<f64> {
    let (d, last) = (network.sizes[0], network.layers());
    let k = network.sizes[last];
    let mut sum = vec![0.0f64; d];
    for first in (0..STEPS).step_by(workspace.batch) {
        let rows = workspace.batch.min(STEPS - first);
        for r in 0..rows {
            let at = ((first + r) as f32 + 0.5) / STEPS as f32;
            for j in 0..d {
                workspace.activations[0][r * d + j] = from[j] + at * (to[j] - from[j]);
            }
        }
        crate::numeric::wide::wide(|| network.forward(rows, workspace));
        for r in 0..rows {
            let top = &mut workspace.deltas[last][r * k..(r + 1) * k];
            top.fill(0.0);
            top[class] += 1.0;
            top[other] -= 1.0;
            for l in (0..last).rev() {
                let (n, m) = (network.sizes[l], network.sizes[l + 1]);
                let w = &network.values[network.offset(l)..];
                let (below, above) = workspace.deltas.split_at_mut(l + 1);
                let above = &above[0][r * m..(r + 1) * m];
                for i in 0..n {
                    // ReLU passes nothing where its value is zero; the inputs themselves have no ReLU.
                    let passes = l == 0 || workspace.activations[l][r * n + i] > 0.0;
                    below[l][r * n + i] = if passes { super::adam::dot(above, &w[i * m..(i + 1) * m]) } else { 0.0 };
                }
            }
            sum.iter_mut().zip(&workspace.deltas[0][r * d..(r + 1) * d]).for_each(|(s, g)| *s += f64::from(*g));
        }
    }
    sum.iter().zip(from.iter().zip(to)).map(|(g, (a, b))| g / STEPS as f64 * f64::from(b - a)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn shares_sum_to_the_change_of_the_lead() {
        let mut random = Random::new(6);
        let network = Network::start(&[6, 40, 30, 3], &mut random);
        let mut workspace = NetworkWorkspace::new(&network.sizes, 10);
        for _ in 0..20 {
            let x: Vec<f32> = (0..6).map(|_| random.normal() as f32).collect();
            let zero = [0.0; 6];
            let lead = |z: Vec<f64>| z[1] - z[2];
            let change = lead(network.logits(&x, &mut workspace)) - lead(network.logits(&zero, &mut workspace));
            let total: f64 = shares(&network, &zero, &x, 1, 2, &mut workspace).iter().sum();
            // Completeness (proposition 1 of the source); the midpoint rule meets kinks, each costs at most a step of its slope.
            assert!((total - change).abs() < 0.03 * (1.0 + change.abs()), "{total} {change}");
        }
    }
}
