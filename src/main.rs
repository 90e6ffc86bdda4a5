//! The `servotune` program; everything it does lives in [`servotune`].

fn main() {}
