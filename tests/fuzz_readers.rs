//! A short seeded run of changed files through every reader: no panic, no hang, nothing wrong accepted. The long one: `cargo bench --bench fuzz`.
#![allow(clippy::unwrap_used)]

use servotune_lab::{mutation::mutate, reader_mutations};
use std::path::PathBuf;
use std::time::Duration;

#[test]
fn changed_files_are_read_or_refused() {
    let scratch = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz_readers");
    // Slow builds on busy machines: the limit only tells an endless trial from one that ends.
    let all = reader_mutations(800, 1, &scratch, Duration::from_secs(120), &mut |_| {}).unwrap();
    assert!(all.len() == 12 && all.iter().map(|t| t.runs).sum::<usize>() >= 800);
    for t in &all {
        assert!(t.sound(), "{}: {:?} {:?} {:?}", t.reader, t.panics, t.hangs, t.wrong);
        // A change that nobody refuses, or that everybody does, would test nothing.
        assert!(t.refused > 0, "{}: {} runs, none refused", t.reader, t.runs);
        assert!(t.longest_refusal < 3000, "{}: {} characters", t.reader, t.longest_refusal);
    }
    assert!(all.iter().filter(|t| t.accepted > 0).count() >= 10, "{all:?}");
}

#[test]
fn a_change_is_made_again_by_its_seed() {
    use servotune::numeric::random::Random;
    let text = b"a\tb\n1.5\t2.5\n3\t4\n";
    for trial in 0..200 {
        let change = || mutate(text, true, &mut Random::stream(9, trial));
        assert_eq!(change(), change());
    }
}
