//! Five inner products of one signal with two others and their past: what a backward pass makes of a section.

/// Samples side by side: two registers.
const LANES: usize = 8;

/// Slopes in b0, b1, b2, a1, a2 of a section from the adjoint at its output, its input and its output.
///
/// `adjoint` has one entry a sample; `input` and `output` begin two samples earlier.
#[inline(always)]
pub(super) fn correlate(adjoint: &[f64], input: &[f64], output: &[f64]) -> [f64; 5] {
    let n = adjoint.len();
    let back = |x, lag: usize| -> &[f64] {
        let x: &[f64] = x;
        &x[2 - lag..2 - lag + n]
    };
    let of = [back(input, 0), back(input, 1), back(input, 2), back(output, 1), back(output, 2)];
    let (blocks, rest) = adjoint.as_chunks::<LANES>();
    let chunks = of.map(|x| x.as_chunks::<LANES>().0);
    let mut sum = [[0.0; LANES]; 5];
    for (i, w) in blocks.iter().enumerate() {
        for (sum, x) in sum.iter_mut().zip(&chunks) {
            let x = &x[i];
            for j in 0..LANES {
                sum[j] = w[j].mul_add(x[j], sum[j]);
            }
        }
    }
    let from = blocks.len() * LANES;
    let mut slopes = [0.0; 5];
    for ((slope, sum), x) in slopes.iter_mut().zip(&sum).zip(&of) {
        let tail: f64 = rest.iter().zip(&x[from..]).map(|(w, x)| w * x).sum();
        let half: [f64; 4] = std::array::from_fn(|j| sum[j] + sum[j + 4]);
        *slope = (half[0] + half[1]) + (half[2] + half[3]) + tail;
    }
    [slopes[0], slopes[1], slopes[2], -slopes[3], -slopes[4]]
}

/// Sum of products, in eight running sums.
#[inline(always)]
pub(super) fn inner(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let ((a8, a1), (b8, b1)) = (a[..n].as_chunks::<LANES>(), b[..n].as_chunks::<LANES>());
    let mut sum = [0.0; LANES];
    for (a, b) in a8.iter().zip(b8) {
        for j in 0..LANES {
            sum[j] = a[j].mul_add(b[j], sum[j]);
        }
    }
    let rest: f64 = a1.iter().zip(b1).map(|(a, b)| a * b).sum();
    let half: [f64; 4] = std::array::from_fn(|j| sum[j] + sum[j + 4]);
    (half[0] + half[1]) + (half[2] + half[3]) + rest
}
