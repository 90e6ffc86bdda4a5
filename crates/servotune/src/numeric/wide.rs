//! Kernels in the widest registers that the processor has.
//!
//! In: a computation whose loops the compiler can spread over lanes. Out: the same numbers, sooner. No sum changes its order and nothing
//! is fused but what the code itself writes as `mul_add`, so that the result has the same bits on every processor. (A processor without
//! fused products, x86 from before 2013, computes `mul_add` in software: the same bits, slowly.)

use pulp::{Arch, NullaryFnOnce};

/// Runs `f` compiled for the processor at hand; what `f` calls gains only where it is inlined.
pub fn wide<T>(f: impl FnOnce() -> T) -> T {
    Arch::new().dispatch(f)
}

/// A computation that is compiled for the processor as a whole: `compute`, and what it calls, are `#[inline(always)]`.
pub trait Wide {
    /// What comes out.
    type Output;
    /// The computation.
    fn compute(self) -> Self::Output;
}

/// Like [`wide`], for a computation so large that the compiler would not inline a closure.
pub fn widest<W: Wide>(computation: W) -> W::Output {
    struct Call<W>(W);
    impl<W: Wide> NullaryFnOnce for Call<W> {
        type Output = W::Output;

        #[inline(always)]
        fn call(self) -> W::Output {
            self.0.compute()
        }
    }
    Arch::new().dispatch(Call(computation))
}
