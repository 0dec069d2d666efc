//! The command `lodsmith`: reads arguments, calls the libraries, prints what they say.
//!
//! [`args`] is what can be typed, [`command`] has one module for each subcommand, [`output`] is the only place that
//! prints, [`exit`] says how a run ends. Nothing here knows how a mesh is simplified or how a format is laid out.

mod args;
mod care;
mod command;
mod exit;
mod file;
mod images;
mod in_order;
mod memory;
mod need;
mod normals;
mod numbers;
mod orient;
mod output;
mod palettes;
mod picture;
mod plan;
mod progress;
mod proposals;
mod validity;
mod watch;

use std::process::ExitCode;

use clap::Parser as _;

/// The whole program: reads the arguments of the process, carries them out, and gives the status that it ends with.
pub fn run() -> ExitCode {
    exit::catch_interrupts();
    exit::hush_panics();
    let cli = match args::Cli::try_parse() {
        Ok(cli) => cli,
        // Help and version come here too.
        Err(e) => {
            let status = u8::try_from(e.exit_code()).unwrap_or(2);
            return output::usage(&e).map_or_else(failed, |()| ExitCode::from(status));
        }
    };
    exit::guarded(|| command::run(cli)).map_or_else(failed, exit::code)
}

/// Tells what went wrong, unless the user ended it.
fn failed(error: anyhow::Error) -> ExitCode {
    let status = exit::status_of(&error);
    if status != exit::Status::Interrupted {
        output::error(&format!("{error:#}"));
    }
    exit::code(status)
}
