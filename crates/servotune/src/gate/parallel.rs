//! Work split over threads: results in the order of the work, the same for any number of threads.

use rayon::prelude::*;

/// What `f` gives for 0 to `n`, in order.
pub(super) fn each<T: Send>(n: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    (0..n).into_par_iter().map(&f).collect()
}
