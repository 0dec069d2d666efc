//! The command `lodsmith`: parses arguments, calls the libraries, prints the results.
//!
//! [`args`] defines the arguments, [`command`] has one module for each subcommand, [`output`] does all
//! printing, [`status`] defines exit statuses, [`exit`] handles interrupts. Simplification and file formats are
//! in the libraries.

mod args;
mod call;
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

use std::sync::Arc;

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

/// A call of the command in the process of another program, such as an interpreter.
///
/// It does what the command does with the same arguments, and writes the same bytes, but it does not print, catches no
/// signals, and never ends the process: no thread watches the memory that the process holds (steps are still checked
/// before they begin), and time limits are for `simplify` and `lod` only. `-` for standard input and output, and `view`,
/// are not for calls. Several calls may run at once.
#[derive(Clone, Debug)]
pub struct Call(Arc<call::CallState>);

/// Outcome of a [`Call`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// Exit status that the command would have.
    pub status: u8,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Errors; empty after success, and after [`Call::cancel`].
    pub errors: Vec<String>,
    /// True if an argument is unknown, rather than wrong.
    pub is_unknown_argument: bool,
}

impl Default for Call {
    fn default() -> Self {
        Self::new()
    }
}

impl Call {
    /// Makes a call that has not begun.
    pub fn new() -> Self {
        Self(Arc::new(call::CallState::new()))
    }
    /// Asks the call to end soon, from any thread.
    pub fn cancel(&self) {
        self.0.cancel();
    }
    /// Runs the command with these arguments, the first of which is the name of the subcommand. It takes this thread
    /// until the end.
    pub fn run(&self, args: impl IntoIterator<Item = std::ffi::OsString>) -> Outcome {
        let before = call::current();
        call::enter(Some(self.0.clone()));
        let args = std::iter::once("lodsmith".into()).chain(args);
        let mut is_unknown_argument = false;
        let status = match args::Cli::try_parse_from(args) {
            Ok(cli) => exit::guarded(|| command::run(cli)).unwrap_or_else(|e| {
                let status = status_of(&e);
                if status != Status::Interrupted {
                    output::error(&format!("{e:#}"));
                }
                status
            }),
            Err(e) => {
                is_unknown_argument = e.kind() == clap::error::ErrorKind::UnknownArgument;
                output::error(&e.to_string());
                Status::Usage
            }
        };
        call::enter(before);
        let (errors, warnings): (Vec<_>, Vec<_>) = self.0.take_messages().into_iter().partition(|m| m.0);
        let texts = |messages: Vec<(bool, String)>| messages.into_iter().map(|m| m.1).collect();
        Outcome {
            status: status as u8,
            warnings: texts(warnings),
            errors: texts(errors),
            is_unknown_argument,
        }
    }
}

/// Prints an error, unless the user interrupted the run.
fn failed(error: anyhow::Error) -> ExitCode {
    let status = status_of(&error);
    if status != Status::Interrupted {
        output::error(&format!("{error:#}"));
    }
    exit::code(status)
}
