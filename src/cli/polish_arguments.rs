//! How `servotune tune` polishes its candidates.

use crate::tune::PolishMethod;
use clap::{Args, ValueEnum};

/// Word for the polish.
#[derive(Debug, Args)]
pub(super) struct PolishArguments {
    /// Steps from each start to its optimum; convex-concave adds cone programmes over the PID gains of all machines together, before the quadratic
    /// steps and in turn with them, and keeps what is better
    #[arg(long = "polish", value_name = "METHOD", value_enum, default_value_t = Method::Quadratic)]
    method: Method,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Method {
    Quadratic,
    ConvexConcave,
}

impl PolishArguments {
    /// The method asked for.
    pub(super) fn method(&self) -> PolishMethod {
        match self.method {
            Method::Quadratic => PolishMethod::Quadratic,
            Method::ConvexConcave => PolishMethod::ConvexConcave,
        }
    }
}
