//! Training: gradients of the cross-entropy and Adam's step, in one pass over the weights.
//!
//! In: a network, rows of inputs and their classes. Out: the weights of the epoch with the least validation loss, and the curve of losses.
//! Adam is algorithm 1 of Kingma & Ba (2015) with epsilon 1e-7. Moments and derivatives too
//! small to matter are put to zero: numbers below 1e-38 cost a processor many times as much as others. Spec: `specs/gate.md`.

use super::network::{Network, NetworkWorkspace, TILE, softmax};
use super::settings::FitSettings;
use super::split::shuffle;
use crate::numeric::random::Random;
use crate::numeric::wide::wide;
use serde::Serialize;

/// Losses and accuracies of one epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Epoch {
    /// Mean cross-entropy of the steps (nat).
    pub loss: f64,
    /// Share of rows whose class was the most probable one.
    pub accuracy: f64,
    /// The same over the validation rows, after the epoch.
    pub validation_loss: f64,
    /// The same over the validation rows, after the epoch.
    pub validation_accuracy: f64,
}

/// A trained network.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// With the weights of the best epoch.
    pub network: Network,
    /// Each epoch.
    pub history: Vec<Epoch>,
    /// The best one, counted from 0.
    pub best: usize,
}

/// Rows as the network takes them.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// One row of inputs after the other.
    pub inputs: &'a [f32],
    /// Class of each row.
    pub class: &'a [usize],
}

/// Decay of the first and of the second moment (Kingma & Ba 2015).
const BETA1: f32 = 0.9;
const BETA2: f32 = 0.999;
const EPSILON: f32 = 1e-7;
/// Derivatives below this move a weight by less than 1e-8 of a step; their squares stay normal numbers.
const LEAST_GRADIENT: f32 = 1e-15;
const LEAST_FIRST: f32 = 1e-20;
const LEAST_SECOND: f32 = 1e-32;

/// What is done with one row of derivatives: the row's place among the weights and its weights come with it.
trait Sink {
    /// `live` holds place in `deltas` and activation of each row of the batch that reaches these weights.
    fn row(&mut self, at: usize, live: &[(usize, f32)], deltas: &[f32], weights: &mut [f32]);
}

/// Adam's moments.
struct Adam {
    first: Vec<f32>,
    second: Vec<f32>,
    rate: f32,
    step: f32,
    root: f32,
    time: i32,
}

impl Adam {
    fn new(parameters: usize, rate: f64) -> Adam {
        Adam {
            first: vec![0.0; parameters],
            second: vec![0.0; parameters],
            rate: rate as f32,
            step: 0.0,
            root: 1.0,
            time: 0,
        }
    }

    /// Begins the next step: both bias corrections of the paper.
    fn tick(&mut self) {
        self.time = self.time.saturating_add(1);
        self.step = self.rate / (1.0 - BETA1.powi(self.time));
        self.root = (1.0 - BETA2.powi(self.time)).sqrt().recip();
    }
}

#[inline(always)]
fn quiet(x: f32, least: f32) -> f32 {
    if x.abs() < least { 0.0 } else { x }
}

/// Derivatives of N weights from column `c` on, then their step.
#[inline(always)]
fn step<const N: usize>(
    a: &Adam,
    live: &[(usize, f32)],
    d: &[f32],
    c: usize,
    m: &mut [f32],
    v: &mut [f32],
    w: &mut [f32],
) {
    let mut g = [0.0f32; N];
    for &(row, x) in live {
        let d = &d[row + c..row + c + N];
        for j in 0..N {
            g[j] += x * d[j];
        }
    }
    let (m, v, w) = (&mut m[c..c + N], &mut v[c..c + N], &mut w[c..c + N]);
    for j in 0..N {
        let g = quiet(g[j], LEAST_GRADIENT);
        m[j] = quiet(BETA1 * m[j] + (1.0 - BETA1) * g, LEAST_FIRST);
        v[j] = quiet(BETA2 * v[j] + (1.0 - BETA2) * (g * g), LEAST_SECOND);
        w[j] -= a.step * m[j] / (v[j].sqrt() * a.root + EPSILON);
    }
}

impl Sink for Adam {
    #[inline(always)]
    fn row(&mut self, at: usize, live: &[(usize, f32)], deltas: &[f32], w: &mut [f32]) {
        let n = w.len();
        let mut first = std::mem::take(&mut self.first);
        let mut second = std::mem::take(&mut self.second);
        let (m, v) = (&mut first[at..at + n], &mut second[at..at + n]);
        let mut c = 0;
        while c + TILE <= n {
            step::<TILE>(self, live, deltas, c, m, v, w);
            c += TILE;
        }
        while c + 4 <= n {
            step::<4>(self, live, deltas, c, m, v, w);
            c += 4;
        }
        while c < n {
            step::<1>(self, live, deltas, c, m, v, w);
            c += 1;
        }
        (self.first, self.second) = (first, second);
    }
}

/// Loss (sum over rows, nat) and rows right, with the derivatives of the mean loss left in the last delta.
#[inline(always)]
fn output(network: &Network, class: &[usize], workspace: &mut NetworkWorkspace) -> (f64, usize) {
    let last = network.layers();
    let k = network.sizes[last];
    let (mut loss, mut right) = (0.0, 0);
    let mut p = [0.0f64; 64];
    let p = &mut p[..k];
    for (r, &y) in class.iter().enumerate() {
        let z = &workspace.activations[last][r * k..(r + 1) * k];
        p.iter_mut().zip(z).for_each(|(p, z)| *p = f64::from(*z));
        let (own, top) = (p[y], p.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v)));
        right += usize::from(own >= top);
        softmax(p);
        // The logarithm of a probability that rounds to zero is taken from the logits.
        loss -= if p[y] > 1e-300 { p[y].ln() } else { own - top };
        for (j, d) in workspace.deltas[last][r * k..(r + 1) * k].iter_mut().enumerate() {
            let e = p[j] - f64::from(u8::from(j == y));
            *d = quiet((e / class.len() as f64) as f32, LEAST_GRADIENT);
        }
    }
    (loss, right)
}

/// Derivatives through all layers, the last first; each row of weights is used for the layer below and then handed to the sink.
#[inline(always)]
fn backward(network: &mut Network, rows: usize, workspace: &mut NetworkWorkspace, sink: &mut impl Sink) {
    for l in (0..network.layers()).rev() {
        let (n, m) = (network.sizes[l], network.sizes[l + 1]);
        let at = network.offset(l);
        let values = &mut network.values[at..at + n * m + m];
        let (below, above) = workspace.deltas.split_at_mut(l + 1);
        let (below, deltas) = (&mut below[l], &above[0]);
        let x = &workspace.activations[l];
        for i in 0..n {
            let w = &mut values[i * m..(i + 1) * m];
            let mut live = 0;
            for r in 0..rows {
                let a = x[r * n + i];
                let reaches = a != 0.0;
                if l > 0 {
                    below[r * n + i] =
                        if reaches { quiet(dot(&deltas[r * m..(r + 1) * m], w), LEAST_GRADIENT) } else { 0.0 };
                }
                if reaches {
                    workspace.live[live] = (r * m, a);
                    live += 1;
                }
            }
            sink.row(at + i * m, &workspace.live[..live], deltas, w);
        }
        for r in 0..rows {
            workspace.live[r] = (r * m, 1.0);
        }
        sink.row(at + n * m, &workspace.live[..rows], deltas, &mut values[n * m..]);
    }
}

/// Scalar product in sixteen lanes: the order of the sum is fixed, and the compiler may use wide registers.
#[inline(always)]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 16];
    let (mut a, mut b) = (a.chunks_exact(16), b.chunks_exact(16));
    for (a, b) in (&mut a).zip(&mut b) {
        for j in 0..16 {
            lanes[j] += a[j] * b[j];
        }
    }
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut width = 8;
    while width > 0 {
        for j in 0..width {
            lanes[j] += lanes[j + width];
        }
        width /= 2;
    }
    lanes[0] + rest
}

/// Mean cross-entropy (nat) and accuracy over `rows`.
pub fn loss_and_accuracy(network: &Network, rows: Rows<'_>, workspace: &mut NetworkWorkspace) -> (f64, f64) {
    let d = network.sizes[0];
    let (mut loss, mut right) = (0.0, 0);
    for (x, y) in rows.inputs.chunks(d * workspace.batch).zip(rows.class.chunks(workspace.batch)) {
        workspace.activations[0][..x.len()].copy_from_slice(x);
        let (l, r) = wide(|| {
            network.forward(y.len(), workspace);
            output(network, y, workspace)
        });
        loss += l;
        right += r;
    }
    let n = rows.class.len().max(1) as f64;
    (loss / n, right as f64 / n)
}

/// Trains a network of these sizes. Without validation rows the best epoch is the one with the least training loss.
pub fn fit(sizes: &[usize], train: Rows<'_>, validate: Rows<'_>, settings: &FitSettings, seed: u64) -> Fitted {
    let mut random = Random::stream(seed, 3);
    let mut network = Network::start(sizes, &mut random);
    let (d, batch) = (sizes[0], settings.batch.max(1));
    let mut workspace = NetworkWorkspace::new(sizes, batch);
    let mut adam = Adam::new(network.parameters(), settings.learning_rate);
    let mut order: Vec<usize> = (0..train.class.len()).collect();
    let mut class = vec![0; batch];
    let mut best = (f64::INFINITY, 0, network.values.clone());
    let mut history = Vec::with_capacity(settings.epochs);
    for epoch in 0..settings.epochs {
        shuffle(&mut order, &mut random);
        let (mut loss, mut right) = (0.0, 0);
        for rows in order.chunks(batch) {
            for (i, &r) in rows.iter().enumerate() {
                workspace.activations[0][i * d..(i + 1) * d].copy_from_slice(&train.inputs[r * d..(r + 1) * d]);
                class[i] = train.class[r];
            }
            adam.tick();
            let (l, n) = wide(|| {
                network.forward(rows.len(), &mut workspace);
                let judged = output(&network, &class[..rows.len()], &mut workspace);
                backward(&mut network, rows.len(), &mut workspace, &mut adam);
                judged
            });
            loss += l;
            right += n;
        }
        let n = order.len().max(1) as f64;
        let (loss, accuracy) = (loss / n, right as f64 / n);
        let (validation_loss, validation_accuracy) = if validate.class.is_empty() {
            (loss, accuracy)
        } else {
            loss_and_accuracy(&network, validate, &mut workspace)
        };
        history.push(Epoch { loss, accuracy, validation_loss, validation_accuracy });
        if validation_loss < best.0 {
            best = (validation_loss, epoch, std::mem::take(&mut best.2));
            best.2.copy_from_slice(&network.values);
        }
        if settings.patience.is_some_and(|p| epoch >= best.1 + p) {
            break;
        }
    }
    network.values = best.2;
    Fitted { network, history, best: best.1 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Keeps the derivatives instead of stepping.
    struct Keep(Vec<f32>);

    impl Sink for Keep {
        fn row(&mut self, at: usize, live: &[(usize, f32)], deltas: &[f32], w: &mut [f32]) {
            for (j, g) in self.0[at..at + w.len()].iter_mut().enumerate() {
                *g = live.iter().map(|&(row, x)| x * deltas[row + j]).sum();
            }
        }
    }

    /// The mean cross-entropy in double precision, written as the formulas stand.
    fn loss(sizes: &[usize], w: &[f64], x: &[f64], class: &[usize]) -> f64 {
        let one = |x: &[f64], y: usize| {
            let (mut a, mut at) = (x.to_vec(), 0);
            for (l, s) in sizes.windows(2).enumerate() {
                let sum =
                    |j: usize| (0..s[0]).map(|i| a[i] * w[at + i * s[1] + j]).sum::<f64>() + w[at + s[0] * s[1] + j];
                let z: Vec<f64> = (0..s[1]).map(sum).collect();
                a = if l + 2 == sizes.len() { z } else { z.iter().map(|v| v.max(0.0)).collect() };
                at += s[0] * s[1] + s[1];
            }
            softmax(&mut a);
            -a[y].ln()
        };
        x.chunks(sizes[0]).zip(class).map(|(x, &y)| one(x, y)).sum::<f64>() / class.len() as f64
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        // Widths that use every kernel: 32, 4 and 1 columns.
        let sizes = [5, 37, 41, 3];
        let mut random = Random::new(12);
        let network = Network::start(&sizes, &mut random);
        let rows = 7;
        let x: Vec<f32> = (0..rows * 5).map(|_| random.normal() as f32).collect();
        let class: Vec<usize> = (0..rows).map(|i| i % 3).collect();
        let mut workspace = NetworkWorkspace::new(&sizes, rows);
        workspace.activations[0].copy_from_slice(&x);
        let mut moved = network.clone();
        let mut keep = Keep(vec![0.0; network.parameters()]);
        let found = wide(|| {
            moved.forward(rows, &mut workspace);
            let found = output(&moved, &class, &mut workspace);
            backward(&mut moved, rows, &mut workspace, &mut keep);
            found.0 / rows as f64
        });
        let w: Vec<f64> = network.values.iter().map(|v| f64::from(*v)).collect();
        let x: Vec<f64> = x.iter().map(|v| f64::from(*v)).collect();
        // Single precision: seven digits, a few lost in sums of forty terms.
        assert!((found - loss(&sizes, &w, &x, &class)).abs() < 1e-5);
        let h = 1e-6;
        for i in (0..w.len()).step_by(7) {
            let at = |d: f64| {
                let mut w = w.clone();
                w[i] += d;
                loss(&sizes, &w, &x, &class)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (f64::from(keep.0[i]) - difference).abs() < 1e-5 * (1.0 + difference.abs()),
                "{i}: {} {difference}",
                keep.0[i]
            );
        }
    }

    #[test]
    fn the_first_steps_of_adam_by_hand() {
        // Adam's first step has the size of the rate whatever the derivative; the second after the same derivative too.
        let mut adam = Adam::new(1, 0.01);
        let mut w = [1.0f32];
        for k in 1..=2 {
            adam.tick();
            adam.row(0, &[(0, 1.0)], &[-0.37], &mut w);
            assert!((w[0] - 1.0 - 0.01 * k as f32).abs() < 1e-6, "{w:?}");
        }
    }

    #[test]
    fn a_circle_inside_a_ring_is_learned() {
        let mut random = Random::new(2);
        let mut draw = |n: usize| -> (Vec<f32>, Vec<usize>) {
            let class: Vec<usize> = (0..n).map(|i| i % 2).collect();
            let point = |&c: &usize| {
                let (angle, radius) = (random.between(0.0, 6.3), random.between(0.0, 1.0) + 1.5 * c as f64);
                [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32]
            };
            (class.iter().flat_map(point).collect(), class)
        };
        let ((x, y), (xv, yv)) = (draw(200), draw(100));
        let rows = |inputs, class| Rows { inputs, class };
        let settings = FitSettings { epochs: 60, batch: 10, learning_rate: 0.003, patience: None };
        let f = fit(&[2, 32, 32, 2], rows(&x, &y), rows(&xv, &yv), &settings, 1);
        assert!(f.history[f.best].validation_accuracy > 0.97, "{:?}", f.history[f.best]);
    }
}
