//! `lodsmith completions`: prints completion scripts of shells.

use clap::CommandFactory as _;
use clap_complete::Shell;

use super::man::print_page;
use crate::args::Cli;
use crate::status::Status;

/// Prints the completion script of a shell.
pub(super) fn run(shell: Shell) -> anyhow::Result<Status> {
    let mut page = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "lodsmith", &mut page);
    print_page(&page)
}
