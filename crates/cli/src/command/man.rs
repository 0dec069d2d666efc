//! `lodsmith man`: prints manual pages, for package maintainers.

use clap::CommandFactory as _;
use clap_mangen::Man;

use crate::args::Cli;
use crate::output::Output;
use crate::status::{Status, usage};

/// Prints the page of a command, or the overview.
pub(super) fn run(command: Option<&str>) -> anyhow::Result<Status> {
    let mut root = Cli::command();
    root.build();
    let page_of = match command {
        None => root,
        // `build` has set the full names of subcommands, such as `lodsmith-simplify`.
        Some(name) => {
            let found = name.split(' ').try_fold(&root, |command, word| command.find_subcommand(word));
            found.cloned().ok_or_else(|| usage(format!("there is no command {name}")))?
        }
    };
    let mut page = Vec::new();
    Man::new(page_of).render(&mut page)?;
    print_page(&page)
}

/// Prints a page.
pub(super) fn print_page(page: &[u8]) -> anyhow::Result<Status> {
    let out = Output::plain();
    out.result(&String::from_utf8_lossy(page));
    out.finish(Status::Done)
}
