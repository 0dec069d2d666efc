//! One module for each subcommand.

mod batch;
mod clean;
mod compare;
mod completions;
mod convert;
mod doctor;
mod info;
mod lod;
mod man;
mod methods;
mod progressive;
mod render;
mod simplify;
mod view;

use lodsmith_io::Warning;

use crate::args::{Cli, Command};
use crate::exit;
use crate::output::{self, Output};
use crate::status::Status;
use crate::{memory, memory_watch};

/// Runs the command.
pub(crate) fn run(cli: Cli) -> anyhow::Result<Status> {
    if let Some(seconds) = cli.command.hard_limit_secs() {
        exit::end_after(seconds)?;
    }
    if let Some(run) = cli.command.run() {
        memory_watch::start(memory::set_limit(run.max_memory))?;
    }
    match cli.command {
        Command::Simplify(args) => simplify::run(&args),
        Command::Lod(args) => lod::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Clean(args) => clean::run(&args),
        Command::Methods(args) => methods::run(&args),
        Command::Progressive(action) => progressive::run(&action),
        Command::Render(args) => render::run(&args),
        Command::View(args) => view::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions { shell } => completions::run(shell),
        Command::Man { command } => man::run(command.as_deref()),
    }
}

/// Shows the warnings of a file. With `strict`, lost data are shown as an error even if warnings are
/// silenced, and the result is `true`.
fn show_warnings(out: &Output, path: &str, warnings: &[Warning], strict: bool) -> bool {
    let mut is_fault = false;
    for warning in warnings {
        if strict && warning.data_lost {
            output::error(&format!("{path}: {warning}"));
            is_fault = true;
        } else {
            out.warning(&format!("{path}: {warning}"));
        }
    }
    is_fault
}

/// Returns the warnings that matter if a mesh is only viewed, not written.
fn viewing_warnings(warnings: &[Warning]) -> Vec<Warning> {
    warnings.iter().filter(|warning| !warning.of_scene).cloned().collect()
}

/// Returns the texts of warnings, for reports.
fn texts(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.text.as_str()).collect()
}
