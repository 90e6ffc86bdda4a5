//! What the backward pass through a write read off the spectrum works in.
//!
//! In: the number of lines. Out: buffers of that width, kept from one pass to the next. Spec: `specs/tuning.md`, "The measured route".

/// Buffers of a backward pass; arrays over lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Adjoint {
    /// Slope of the figure in the folded line and in the folded density.
    pub g_re: Vec<f64>,
    pub g_im: Vec<f64>,
    pub density: Vec<f64>,
    /// W.
    pub w_re: Vec<f64>,
    pub w_im: Vec<f64>,
    /// Of the bins with a share in the figure: index, and the slopes in Re X, Im X and the power.
    pub bins: Vec<(usize, [f64; 3])>,
}
