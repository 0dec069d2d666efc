//! The subcommands. `job` does all jobs on files, whose results `simplify`, `lod`, `clean` and `info` print; each other
//! subcommand has a module.

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
use crate::status::Status;
use crate::{memory, memory_watch};

/// Runs the command.
pub(crate) fn run(cli: Cli) -> anyhow::Result<Status> {
    let _alarm = cli.command.hard_limit_secs().map(exit::end_after).transpose()?;
    if let Some(limits) = cli.command.limits() {
        memory_watch::start(memory::set_limit(limits.max_memory))?;
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
