//! Options of a run: threads, limits, what is printed.

use std::num::NonZeroU16;

use clap::Args;

use super::values;
use crate::in_order::available_threads;

/// Options of a run: threads, limits, verbosity.
#[derive(Args, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Run {
    /// Number of threads; the result is the same with any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroU16>,
    /// Stop after S seconds: simplify, lod and methods write the best result so far for each input; all other commands
    /// fail and write nothing
    #[arg(long, value_name = "S", value_parser = values::seconds)]
    pub(crate) time_limit: Option<f64>,
    /// Limit the memory of the process, such as 512M or 2G (powers of 1024); refuse what would take more [default:
    /// three quarters of what the machine or the container has]
    #[arg(long, value_name = "SIZE", value_parser = values::memory)]
    pub(crate) max_memory: Option<u64>,
    /// Print errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print details
    #[arg(short, long, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
}

impl Run {
    pub(crate) fn threads(&self) -> usize {
        self.threads.map_or_else(available_threads, |n| usize::from(n.get()))
    }
}

/// Reporting of a command that writes.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Ending {
    /// Print one line of JSON for each input
    #[arg(long)]
    pub(crate) json: bool,
    /// Exit with status 3 if a target is not reached or data are dropped
    #[arg(long)]
    pub(crate) strict: bool,
}
