//! Faults: runs that are killed or terminated.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

use super::job::{FolderContent, Job, finish, is_temporary_file, put, start};
use super::{FaultResult, FaultRow, FaultSetup, KILL_RUNS, Random};

/// A function that waits for a moment and then ends a run.
type EndRun = fn(&mut Random, &Job, &mut Child, &Path) -> Result<()>;

/// SIGKILL, which cannot be caught, at a random moment between the start and slightly after the usual end.
pub(super) fn at_any_moment(setup: &FaultSetup) -> Result<FaultResult> {
    let end: EndRun = |random, job, child, _| {
        wait(job.time.as_secs_f64() * 1.1 * random.part());
        Ok(child.kill()?)
    };
    rounds(setup, "SIGKILL at a random moment", KILL_RUNS, 17, end)
}

/// SIGKILL soon after a temporary file has appeared.
pub(super) fn while_writing(setup: &FaultSetup) -> Result<FaultResult> {
    let end: EndRun = |random, _, child, out| {
        // Small files are written within this time; the number of remaining temporary files shows whether the delay is
        // short enough.
        const MAX_DELAY_SECONDS: f64 = 0.001;
        let is_writing = || {
            let mut entries = std::fs::read_dir(out).into_iter().flatten().flatten();
            entries.any(|entry| is_temporary_file(&entry.file_name().to_string_lossy()))
        };
        while !is_writing() && child.try_wait()?.is_none() {}
        wait(MAX_DELAY_SECONDS * random.part());
        Ok(child.kill()?)
    };
    rounds(setup, "SIGKILL while an output is written", KILL_RUNS, 19, end)
}

/// SIGTERM at a random moment: the run ends itself and cleans up.
pub(super) fn terminated(setup: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "SIGTERM at a random moment";
    if !cfg!(unix) {
        return Ok(FaultResult::Skipped(FAULT, "there are no signals here".into()));
    }
    let end: EndRun = |random, job, child, _| {
        wait(job.time.as_secs_f64() * 1.1 * random.part());
        if child.try_wait()?.is_none() {
            let id = child.id().to_string();
            // The shell's built-in `kill`: the program does not exist everywhere.
            let killed =
                Command::new("sh").args(["-c", "kill -TERM \"$0\"", &id]).stderr(Stdio::null()).status()?;
            ensure!(killed.success() || child.try_wait()?.is_some(), "kill -TERM {id} ended with {killed}");
        }
        Ok(())
    };
    rounds(setup, FAULT, KILL_RUNS, 23, end)
}

fn wait(seconds: f64) {
    // A single long sleep is too coarse for moments within a few milliseconds.
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    while Instant::now() < end {
        std::thread::sleep(Duration::from_micros(50));
    }
}

fn rounds(
    setup: &FaultSetup,
    fault: &'static str,
    runs: usize,
    seed: u64,
    end: EndRun,
) -> Result<FaultResult> {
    let mut row = FaultRow::new(fault);
    let mut random = Random(seed);
    for (number, job) in setup.jobs.iter().cycle().take(setup.part_of(runs)).enumerate() {
        // One round of all runs into empty folders, then one over existing outputs.
        let before = if (number / setup.jobs.len()).is_multiple_of(2) {
            FolderContent::new()
        } else {
            job.old.clone()
        };
        let out = setup.empty_folder("out")?;
        put(&before, &out)?;
        let arguments = job.arguments(&setup.inputs(), &out);
        let mut child = start(&setup.program, &arguments, Stdio::null(), Stdio::null())?;
        end(&mut random, job, &mut child, &out)?;
        let ended = finish(child)?;
        row.count(&ended);
        row.add_violations(job.name(), job.check(&ended, &before, &out)?);
        let (violations, removed) = job.run_again(setup, &out)?;
        row.add_violations(job.name(), violations);
        row.removed += removed;
    }
    Ok(FaultResult::Done(row))
}
