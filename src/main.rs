//! The `servotune` program. Everything it does lives in the library; this file only starts it.

use std::process::ExitCode;

fn main() -> ExitCode {
    servotune::cli::main()
}
