//! Fault injection: full disks, read-only or removed folders, killed runs, inputs that change while they are read, and
//! pipes that close.
//!
//! Every fault is injected many times into runs of all commands that write files. In every case:
//! * an output has either its old content or the complete new content;
//! * a failing run prints one line and exits with status 1, and no run panics or crashes with a signal;
//! * inputs are unchanged;
//! * the next run into the same folder succeeds and leaves no temporary file.
//!
//! Random moments come from fixed seeds, but the state of a run at such a moment depends on the machine.

mod changed;
mod disk;
mod job;
mod kill;
mod stream;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use tempfile::TempDir;

use crate::release_command;
use job::{Job, RunOutcome};

/// Number of runs for each kill fault; `--quick` makes a tenth of them.
const KILL_RUNS: usize = 200;

/// The shared setup of all faults.
struct FaultSetup {
    program: PathBuf,
    folder: TempDir,
    jobs: Vec<Job>,
    /// Number of runs to make out of every thousand.
    share: usize,
}

impl FaultSetup {
    fn inputs(&self) -> PathBuf {
        self.folder.path().join("in")
    }

    /// Returns the number of runs to make out of `runs`, at least one.
    fn part_of(&self, runs: usize) -> usize {
        (runs * self.share / 1000).max(1)
    }

    /// Creates an empty folder of this name; an existing one is removed first.
    fn empty_folder(&self, name: &str) -> Result<PathBuf> {
        let folder = self.folder.path().join(name);
        if folder.exists() {
            std::fs::remove_dir_all(&folder)?;
        }
        std::fs::create_dir(&folder)?;
        Ok(folder)
    }
}

/// The results of one fault.
struct FaultRow {
    fault: &'static str,
    runs: usize,
    done: usize,
    failed: usize,
    ended: usize,
    /// Temporary files that runs left behind and the next runs removed.
    removed: usize,
    violations: Vec<String>,
}

impl FaultRow {
    fn new(fault: &'static str) -> Self {
        Self { fault, runs: 0, done: 0, failed: 0, ended: 0, removed: 0, violations: Vec::new() }
    }

    /// Counts the outcome of a run.
    fn count(&mut self, ended: &RunOutcome) {
        self.runs += 1;
        *match ended.status {
            Some(0) => &mut self.done,
            Some(1 | 2) => &mut self.failed,
            _ => &mut self.ended,
        } += 1;
    }

    fn add_violations(&mut self, job: &str, what: impl IntoIterator<Item = String>) {
        self.violations.extend(what.into_iter().map(|what| format!("{}: {job}: {what}", self.fault)));
    }

    fn print(&self) {
        println!(
            "| {} | {} | {} | {} | {} | {} | {} |",
            self.fault,
            self.runs,
            self.done,
            self.failed,
            self.ended,
            self.removed,
            self.violations.len()
        );
    }
}

/// The result of a fault, or the reason why it was skipped.
enum FaultResult {
    Done(FaultRow),
    Skipped(&'static str, String),
}

type Fault = fn(&FaultSetup) -> Result<FaultResult>;

const FAULTS: &[(&str, Fault)] = &[
    ("full", disk::full),
    ("read-only", disk::read_only),
    ("protected", disk::protected),
    ("removed", disk::removed),
    ("vanishing", disk::vanishing),
    ("kill", kill::at_any_moment),
    ("kill-writing", kill::while_writing),
    ("term", kill::terminated),
    ("changed", changed::while_read),
    ("cut-input", stream::truncated_input),
    ("closed-pipe", stream::closed_pipe),
    ("closed-pipe-text", stream::closed_pipe_of_text),
    ("full-device", stream::full_device),
    ("no-errors", stream::nobody_reads_errors),
];

/// Injects every fault, prints the table, and fails if a check fails.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut binary, mut only, mut share, mut is_strict) = (None::<PathBuf>, None::<&str>, 1000, false);
    let mut rest = args.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--quick" => share = 100,
            "--strict" => is_strict = true,
            "--binary" => binary = Some(rest.next().context("--binary needs a path")?.into()),
            "--only" => only = Some(rest.next().context("--only needs a name")?),
            other => bail!(
                "no option {other}: cargo xtask faults [--quick] [--strict] [--only NAME] [--binary FILE]"
            ),
        }
    }
    let names: Vec<&str> = FAULTS.iter().map(|(name, _)| *name).collect();
    ensure!(only.is_none_or(|only| names.contains(&only)), "--only takes one of {}", names.join(", "));
    let program = match binary {
        Some(binary) => std::path::absolute(binary)?,
        None => release_command()?,
    };
    let folder = TempDir::with_prefix("lodsmith-faults-")?;
    let inputs = folder.path().join("in");
    std::fs::create_dir(&inputs)?;
    job::write_inputs(&program, &inputs)?;
    let jobs = job::all(&program, &inputs)?;
    let setup = FaultSetup { program, folder, jobs, share };
    let inputs = job::folder_content(&setup.inputs())?;

    println!(
        "| fault | runs | done | failed with one line | killed | temporary files left, then removed | violations |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|");
    let (mut violations, mut skipped) = (Vec::new(), Vec::new());
    for (_, fault) in FAULTS.iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        match fault(&setup)? {
            FaultResult::Done(mut row) => {
                if job::folder_content(&setup.inputs())? != inputs {
                    row.add_violations("all", ["an input has changed".to_owned()]);
                }
                row.print();
                violations.append(&mut row.violations);
            }
            FaultResult::Skipped(fault, why) => {
                println!("| {fault} | SKIPPED | | | | | |");
                skipped.push(format!("SKIPPED {fault}: {why}"));
            }
        }
    }
    println!();
    for line in skipped.iter().chain(&violations) {
        println!("{line}");
    }
    ensure!(violations.is_empty(), "{} violations", violations.len());
    ensure!(
        !is_strict || skipped.is_empty(),
        "{} faults were skipped, and --strict requires all",
        skipped.len()
    );
    Ok(())
}

/// A random generator that gives the same numbers for the same seed (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `end`, which must be positive.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// Returns a number from 0 up to 1.
    fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Copies the files of a folder.
fn copy_all(from: &Path, to: &Path) -> Result<()> {
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        std::fs::copy(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_numbers_are_reproducible_and_evenly_distributed() {
        let draw = |seed| {
            let mut random = Random(seed);
            (0..1000).map(|_| random.below(10)).collect::<Vec<_>>()
        };
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
        for digit in 0..10 {
            assert!((60..150).contains(&draw(7).iter().filter(|&&d| d == digit).count()));
        }
        let mut random = Random(1);
        assert!((0..1000).map(|_| random.part()).all(|p| (0.0..1.0).contains(&p)));
    }
}
