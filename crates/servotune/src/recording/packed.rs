//! A file packed as the contract allows.

use flate2::{Compression, write::GzEncoder};
use std::io::{self, Read, Write};

/// gzip of everything that `from` gives; memory does not grow with it, beyond the packed bytes.
pub fn gzip(mut from: impl Read) -> io::Result<Vec<u8>> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    io::copy(&mut from, &mut packed)?;
    packed.flush()?;
    packed.finish()
}
