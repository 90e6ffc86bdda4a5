//! The network: dense layers with ReLU between them and softmax at the end (section 2.8, eqs. (38) and (39)).
//!
//! In: normalised features. Out: logits, one a class. Weights lie one row an input (`weights[input * outputs + output]`), so that a
//! layer is a sum of rows and an input that ReLU has put to zero costs nothing. Spec: `specs/gate.md`.

use crate::numeric::random::Random;
use crate::numeric::wide::wide;

/// A network of dense layers.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// Nodes of each layer, inputs first, classes last.
    pub sizes: Vec<usize>,
    /// Layer after layer: weights, then biases.
    pub(super) values: Vec<f32>,
}

/// Columns that one pass of a kernel keeps in registers.
pub(super) const TILE: usize = 32;

/// Turns logits into probabilities, eq. (39); the largest logit is taken off first, which changes nothing but overflow.
pub fn softmax(z: &mut [f64]) {
    let top = z.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
    let mut sum = 0.0;
    for v in z.iter_mut() {
        *v = (*v - top).exp();
        sum += *v;
    }
    z.iter_mut().for_each(|v| *v /= sum);
}

/// Number of weights and biases of layers of these sizes.
///
/// ```
/// use servotune::gate::parameter_count;
/// // Section 2.8 and section 3.2 of the paper.
/// assert_eq!(parameter_count(&[10, 200, 500, 200, 4]), 203_704);
/// assert_eq!(parameter_count(&[5, 200, 384, 200, 4]), 156_188);
/// ```
pub fn parameter_count(sizes: &[usize]) -> usize {
    sizes.windows(2).map(|w| w[0] * w[1] + w[1]).sum()
}

impl Network {
    /// A network to start from: normal weights of variance 2/inputs (He et al. 2015, eq. (10)), biases zero.
    pub fn start(sizes: &[usize], random: &mut Random) -> Network {
        let mut values = Vec::with_capacity(parameter_count(sizes));
        for w in sizes.windows(2) {
            let deviation = (2.0 / w[0] as f64).sqrt();
            values.extend((0..w[0] * w[1]).map(|_| (deviation * random.normal()) as f32));
            values.extend(std::iter::repeat_n(0.0f32, w[1]));
        }
        Network { sizes: sizes.to_vec(), values }
    }

    /// A network of stored values; none where their number does not fit.
    pub fn from_values(sizes: Vec<usize>, values: Vec<f32>) -> Option<Network> {
        let fits = sizes.len() >= 2 && sizes.iter().all(|n| *n > 0) && parameter_count(&sizes) == values.len();
        fits.then_some(Network { sizes, values })
    }

    /// Weights and biases.
    pub fn parameters(&self) -> usize {
        self.values.len()
    }

    /// Layers of weights.
    pub fn layers(&self) -> usize {
        self.sizes.len() - 1
    }

    /// Every weight and bias, layer after layer.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Where the weights of a layer start.
    pub(super) fn offset(&self, layer: usize) -> usize {
        parameter_count(&self.sizes[..=layer])
    }

    /// Logits of `rows` rows of inputs.
    pub fn logits(&self, inputs: &[f32], workspace: &mut NetworkWorkspace) -> Vec<f64> {
        let (d, k) = (self.sizes[0], self.sizes[self.layers()]);
        let mut out = Vec::with_capacity(inputs.len() / d * k);
        for x in inputs.chunks(d * workspace.batch) {
            let rows = x.len() / d;
            workspace.activations[0][..x.len()].copy_from_slice(x);
            wide(|| self.forward(rows, workspace));
            out.extend(workspace.activations[self.layers()][..rows * k].iter().map(|v| f64::from(*v)));
        }
        out
    }

    /// Fills the workspace's activations from its inputs.
    #[inline(always)]
    pub(super) fn forward(&self, rows: usize, workspace: &mut NetworkWorkspace) {
        for l in 0..self.layers() {
            let (n, m) = (self.sizes[l], self.sizes[l + 1]);
            let at = self.offset(l);
            let (w, bias) = self.values[at..at + n * m + m].split_at(n * m);
            let (before, after) = workspace.activations.split_at_mut(l + 1);
            let last = l + 1 == self.layers();
            for r in 0..rows {
                let (x, y) = (&before[l][r * n..(r + 1) * n], &mut after[0][r * m..(r + 1) * m]);
                let mut live = 0;
                for (i, v) in x.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                    workspace.live[live] = (i * m, *v);
                    live += 1;
                }
                y.copy_from_slice(bias);
                let mut c = 0;
                while c + TILE <= m {
                    accumulate::<TILE>(&workspace.live[..live], w, c, &mut y[c..]);
                    c += TILE;
                }
                while c + 4 <= m {
                    accumulate::<4>(&workspace.live[..live], w, c, &mut y[c..]);
                    c += 4;
                }
                while c < m {
                    accumulate::<1>(&workspace.live[..live], w, c, &mut y[c..]);
                    c += 1;
                }
                if !last {
                    y.iter_mut().for_each(|v| *v = v.max(0.0));
                }
            }
        }
    }
}

/// Adds to `y` the rows of `w` that are live, each times its input, in N columns from `c` on.
#[inline(always)]
fn accumulate<const N: usize>(live: &[(usize, f32)], w: &[f32], c: usize, y: &mut [f32]) {
    let mut sum = [0.0f32; N];
    sum.copy_from_slice(&y[..N]);
    for &(row, x) in live {
        let w = &w[row + c..row + c + N];
        for j in 0..N {
            sum[j] += x * w[j];
        }
    }
    y[..N].copy_from_slice(&sum);
}

/// Room to compute in, made once for a network and a batch.
#[derive(Clone, Debug)]
pub struct NetworkWorkspace {
    pub(super) batch: usize,
    /// Values of each layer, inputs first, one row after the other.
    pub(super) activations: Vec<Vec<f32>>,
    /// Derivatives of the loss by the values of each layer before ReLU.
    pub(super) deltas: Vec<Vec<f32>>,
    pub(super) live: Vec<(usize, f32)>,
}

impl NetworkWorkspace {
    /// Room for `batch` rows.
    pub fn new(sizes: &[usize], batch: usize) -> NetworkWorkspace {
        let batch = batch.max(1);
        let widest = sizes.iter().copied().max().unwrap_or(0).max(batch);
        let room = || sizes.iter().map(|n| vec![0.0; n * batch]).collect::<Vec<Vec<f32>>>();
        NetworkWorkspace { batch, activations: room(), deltas: room(), live: vec![(0, 0.0); widest] }
    }
}
