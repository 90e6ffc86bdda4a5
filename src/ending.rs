//! How a command ended.

/// What a command that ran has to say by its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// 0: done, all accepted.
    Accepted,
    /// 1: done, and something was rejected, infeasible, abstained or failed.
    Rejected,
}
