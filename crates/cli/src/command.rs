//! One module for each subcommand.

mod bake;
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
use crate::status::{Status, usage};
use crate::{call, memory, memory_watch};

/// Runs the command.
pub(crate) fn run(cli: Cli) -> anyhow::Result<Status> {
    cli.command.check()?;
    // A call must not end the process of its caller.
    let is_call = call::current().is_some();
    if let Some(seconds) = cli.command.hard_limit_secs() {
        if is_call {
            return Err(usage(
                "a time limit is for simplify and lod here: nothing else has a result before its end",
            ));
        }
        exit::end_after(seconds)?;
    }
    if let Some(run) = cli.command.run() {
        let limit = memory::set_limit(run.max_memory);
        if !is_call {
            memory_watch::start(limit)?;
        }
    }
    match cli.command {
        Command::Simplify(args) => simplify::run(&args),
        Command::Lod(args) => lod::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Clean(args) => clean::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Methods(args) => methods::run(&args),
        Command::Progressive(action) => progressive::run(&action),
        Command::Render(args) => render::run(&args),
        Command::View(args) => view::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions { shell } => completions::run(shell),
        Command::Man { command } => man::run(command.as_deref()),
    }
}
