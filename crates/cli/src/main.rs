//! The command `lodsmith`. All code is in the library of this package, which is built in parallel with the
//! engine: docs/decisions/0019.

use std::process::ExitCode;

fn main() -> ExitCode {
    lodsmith_cli::run()
}
