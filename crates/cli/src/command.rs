//! One module for each subcommand.

mod clean;
mod compare;
mod completions;
mod doctor;
mod info;
mod job;
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
    if let Some(limits) = cli.command.limits() {
        let limit = memory::set_limit(limits.max_memory);
        if !is_call {
            memory_watch::start(limit)?;
        }
    }
    if let Some(job) = cli.command.job() {
        return job::run(&job);
    }
    match cli.command {
        Command::Compare(args) => compare::run(&args),
        Command::Methods(args) => methods::run(&args),
        Command::Progressive(action) => progressive::run(&action),
        Command::Render(args) => render::run(&args),
        Command::View(args) => view::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions { shell } => completions::run(shell),
        Command::Man { command } => man::run(command.as_deref()),
        _ => unreachable!("it is a job"),
    }
}
