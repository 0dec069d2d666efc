//! The command `lodsmith`. All of it is in the library beside, which is built while the engine is: docs/decisions/0019.

use std::process::ExitCode;

fn main() -> ExitCode {
    lodsmith_cli::run()
}
