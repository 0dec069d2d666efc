//! The command `lodsmith`: parses arguments, calls the libraries, prints the results.
//!
//! [`args`] defines the arguments, [`command`] has the subcommands, [`output`] does all printing, [`status`] defines
//! exit statuses, [`exit`] handles interrupts. Simplification, file formats and jobs on files are in the libraries.

mod args;
mod command;
mod exit;
mod file;
mod in_order;
mod memory;
mod memory_watch;
mod numbers;
mod output;
mod progress;
mod run_control;
mod sizes;
mod status;
mod validity;
mod warnings;

use std::process::ExitCode;

use clap::Parser as _;

use status::{Status, status_of};

/// Runs the program: parses the arguments of the process, runs the command, and returns its exit code.
pub fn run() -> ExitCode {
    exit::catch_interrupts();
    exit::shorten_panics();
    let cli = match args::Cli::try_parse() {
        Ok(cli) => cli,
        // Help and version arrive here too.
        Err(e) => {
            let status = u8::try_from(e.exit_code()).unwrap_or(2);
            return output::usage(&e).map_or_else(failed, |()| ExitCode::from(status));
        }
    };
    exit::guarded(|| command::run(cli)).map_or_else(failed, exit::code)
}

/// Prints an error, unless the user interrupted the run.
fn failed(error: anyhow::Error) -> ExitCode {
    let status = status_of(&error);
    if status != Status::Interrupted {
        output::error(&format!("{error:#}"));
    }
    exit::code(status)
}
