//! A source of slots with a clock: how much of the threads' time goes into reading slots, or drawing made-up ones.

use servotune_fleet::{Loaded, SlotName, SlotSource};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Another source, timed.
pub(super) struct Clocked {
    source: Box<dyn SlotSource>,
    nanoseconds: AtomicU64,
}

impl Clocked {
    pub(super) fn of(source: Box<dyn SlotSource>) -> Clocked {
        Clocked { source, nanoseconds: AtomicU64::new(0) }
    }

    /// Time of all threads together spent in [`SlotSource::load`] (s).
    pub(super) fn seconds(&self) -> f64 {
        self.nanoseconds.load(Ordering::Relaxed) as f64 * 1e-9
    }
}

impl SlotSource for Clocked {
    fn count(&self) -> usize {
        self.source.count()
    }

    fn name(&self, index: usize) -> SlotName {
        self.source.name(index)
    }

    fn load(&self, index: usize) -> Loaded {
        let begun = Instant::now();
        let loaded = self.source.load(index);
        let spent = u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds.fetch_add(spent, Ordering::Relaxed);
        loaded
    }
}
