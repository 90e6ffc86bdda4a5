//! The digest that ties a result to the exact bytes it was made from.

use sha2::{Digest, Sha256};

/// SHA-256 of the bytes, 64 lower-case hexadecimal digits (FIPS 180-4).
///
/// ```
/// // The digest of the empty message, printed in the standard's examples.
/// assert!(servotune::document::sha256_hex(b"").starts_with("e3b0c44298fc1c14"));
/// ```
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}
