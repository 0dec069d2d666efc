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

use crate::args::{Cli, Command};
use crate::exit;
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
