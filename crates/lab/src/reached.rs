//! What a reader came to with a changed file.

/// What a reader, and what stands behind it, made of a changed file.
#[derive(Clone, Debug, PartialEq)]
pub enum Reached {
    /// Read, and judged where that could be.
    Accepted,
    /// Refused with this message.
    Refused(String),
    /// Accepted, and it must not be: why.
    Wrong(String),
}
