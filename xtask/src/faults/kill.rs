//! Faults: runs that are killed or terminated.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

use super::job::{FolderContent, Job, finish, is_part, put, start};
use super::{FaultResult, FaultRow, FaultSetup, KILL_RUNS, Random};

/// A function that ends a run, after waiting for its moment.
type EndRun = fn(&mut Random, &Job, &mut Child, &Path) -> Result<()>;

/// SIGKILL, which cannot be caught, at a random moment from the start to slightly after the usual end.
pub(super) fn at_any_moment(ground: &FaultSetup) -> Result<FaultResult> {
    let end: EndRun = |chance, job, child, _| {
        wait(job.time.as_secs_f64() * 1.1 * chance.part());
        Ok(child.kill()?)
    };
    rounds(ground, "SIGKILL at a random moment", KILL_RUNS, 17, end)
}

/// SIGKILL soon after a temporary file has appeared.
pub(super) fn while_writing(ground: &FaultSetup) -> Result<FaultResult> {
    let end: EndRun = |chance, _, child, out| {
        // Small files are written within this time; the number of remaining temporary files shows whether it
        // fits.
        const MAX_DELAY_SECONDS: f64 = 0.001;
        let is_writing = || {
            let mut entries = std::fs::read_dir(out).into_iter().flatten().flatten();
            entries.any(|entry| is_part(&entry.file_name().to_string_lossy()))
        };
        while !is_writing() && child.try_wait()?.is_none() {}
        wait(MAX_DELAY_SECONDS * chance.part());
        Ok(child.kill()?)
    };
    rounds(ground, "SIGKILL while an output is written", KILL_RUNS, 19, end)
}

/// SIGTERM at a random moment: the run ends itself and cleans up.
pub(super) fn terminated(ground: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "SIGTERM at a random moment";
    if !cfg!(unix) {
        return Ok(FaultResult::Skipped(FAULT, "there are no signals here".into()));
    }
    let end: EndRun = |chance, job, child, _| {
        wait(job.time.as_secs_f64() * 1.1 * chance.part());
        if child.try_wait()?.is_none() {
            let id = child.id().to_string();
            // The `kill` built into the shell: the separate program does not exist everywhere.
            let told =
                Command::new("sh").args(["-c", "kill -TERM \"$0\"", &id]).stderr(Stdio::null()).status()?;
            ensure!(told.success() || child.try_wait()?.is_some(), "kill -TERM {id} ended with {told}");
        }
        Ok(())
    };
    rounds(ground, FAULT, KILL_RUNS, 23, end)
}

fn wait(seconds: f64) {
    // A single long sleep is too coarse for moments within a few milliseconds.
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    while Instant::now() < end {
        std::thread::sleep(Duration::from_micros(50));
    }
}

fn rounds(
    ground: &FaultSetup,
    fault: &'static str,
    runs: usize,
    seed: u64,
    end: EndRun,
) -> Result<FaultResult> {
    let mut row = FaultRow::new(fault);
    let mut chance = Random(seed);
    for (number, job) in ground.jobs.iter().cycle().take(ground.part_of(runs)).enumerate() {
        // One round of all runs into empty folders, then one over existing outputs.
        let before = if (number / ground.jobs.len()).is_multiple_of(2) {
            FolderContent::new()
        } else {
            job.old.clone()
        };
        let out = ground.empty_folder("out")?;
        put(&before, &out)?;
        let words = job.arguments(&ground.inputs(), &out);
        let mut child = start(&ground.program, &words, Stdio::null(), Stdio::null())?;
        end(&mut chance, job, &mut child, &out)?;
        let ended = finish(child)?;
        row.count(&ended);
        row.breach(job.name(), job.check(&ended, &before, &out)?);
        let (breaches, swept) = job.run_again(ground, &out)?;
        row.breach(job.name(), breaches);
        row.swept += swept;
    }
    Ok(FaultResult::Done(row))
}
