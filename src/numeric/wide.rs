//! Kernels in the widest registers that the processor has.
//!
//! In: a computation whose loops the compiler can spread over lanes. Out: the same numbers, sooner. No sum changes its order and nothing
//! is fused, so that the result has the same bits on every processor.

use pulp::Arch;

/// Runs `f` compiled for the processor at hand; what `f` calls gains only where it is inlined.
pub fn wide<T>(f: impl FnOnce() -> T) -> T {
    Arch::new().dispatch(f)
}
