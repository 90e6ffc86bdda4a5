//! A reader with limits: bytes in all, and bytes since the caller last said that a row has ended.
//!
//! In: any reader. Out: the same bytes, or an [`OverLimit`] inside the I/O error once a limit is passed: memory stays bounded whatever the file holds.

use std::cell::Cell;
use std::io::{self, Read};
use thiserror::Error;

/// Which limit a file passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum OverLimit {
    /// The whole.
    #[error("more than {limit} bytes, unpacked")]
    Whole { limit: u64 },
    /// One row.
    #[error("a row of more than {limit} bytes")]
    Row { limit: usize },
}

impl OverLimit {
    /// The limit that an I/O error speaks of, if it is one.
    pub fn of(error: &io::Error) -> Option<OverLimit> {
        error.get_ref().and_then(|e| e.downcast_ref::<OverLimit>()).copied()
    }
}

/// The reader.
pub struct BoundedReader<R> {
    inner: R,
    left: u64,
    limit: u64,
    row_limit: usize,
    row: Cell<usize>,
}

impl<R: Read> BoundedReader<R> {
    /// At most `limit` bytes, and at most about `row_limit` between two calls of [`BoundedReader::row_ended`].
    pub fn new(inner: R, limit: u64, row_limit: usize) -> BoundedReader<R> {
        BoundedReader { inner, left: limit, limit, row_limit, row: Cell::new(0) }
    }

    /// A row has been taken out: the next may be as long again. What a buffer above has read ahead is not counted twice.
    pub fn row_ended(&self) {
        self.row.set(0);
    }
}

impl<R: Read> Read for BoundedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.row.get() > self.row_limit {
            return Err(io::Error::other(OverLimit::Row { limit: self.row_limit }));
        }
        // One byte more than allowed tells a file that ends at the limit from one that goes on.
        let most = buffer.len().min(usize::try_from(self.left.saturating_add(1)).unwrap_or(usize::MAX));
        let read = self.inner.read(&mut buffer[..most])?;
        if read as u64 > self.left {
            return Err(io::Error::other(OverLimit::Whole { limit: self.limit }));
        }
        self.left -= read as u64;
        self.row.set(self.row.get().saturating_add(read));
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_limit_is_reached_and_not_passed() {
        let mut all = Vec::new();
        assert_eq!(BoundedReader::new(&[7u8; 100][..], 100, 1000).read_to_end(&mut all).unwrap(), 100);
        let e = BoundedReader::new(&[7u8; 101][..], 100, 1000).read_to_end(&mut all).unwrap_err();
        assert_eq!(OverLimit::of(&e), Some(OverLimit::Whole { limit: 100 }));
        let e = BoundedReader::new(io::repeat(7), u64::MAX, 1000).read_to_end(&mut all).unwrap_err();
        assert_eq!(OverLimit::of(&e), Some(OverLimit::Row { limit: 1000 }));
        assert!(all.len() < 100_000);
    }
}
