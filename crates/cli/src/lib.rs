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
            output::usage(&e);
            return ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(2));
        }
    };
    let status = exit::guarded(|| command::run(cli)).unwrap_or_else(|e| {
        let status = exit::status_of(&e);
        if status != exit::Status::Interrupted {
            output::error(&format!("{e:#}"));
        }
        status
    });
    exit::code(status)
}
