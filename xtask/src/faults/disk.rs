//! Faults: disks that fill up, folders that are read-only, missing or removed.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::job::{FolderContent, finish, put, run, start};
use super::{FaultResult, FaultRow, FaultSetup, Random};

/// The allocation unit of tmpfs, in bytes.
const PAGE: usize = 4096;
/// Disk size with enough space for the outputs of any run, in bytes.
const AMPLE_DISK_BYTES: usize = 64 << 20;

/// A disk in memory (tmpfs), unmounted on drop.
struct Disk {
    folder: PathBuf,
}

impl Disk {
    fn new(folder: PathBuf, bytes: usize) -> Result<Self> {
        let size = format!("size={bytes}");
        mount(&["-t", "tmpfs", "-o", &size, "tmpfs"], &folder)?;
        Ok(Self { folder })
    }

    /// Remounts it with other options; the files stay.
    fn change(&self, options: &str) -> Result<()> {
        mount(&["-o", &format!("remount,{options}")], &self.folder)
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // A disk that stays mounted is harmless.
        let _ = Command::new("umount").arg(&self.folder).stderr(Stdio::null()).status();
    }
}

fn mount(arguments: &[&str], folder: &Path) -> Result<()> {
    let output = Command::new("mount").args(arguments).arg(folder).output().context("there is no mount")?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(())
}

/// Returns the reason if no disk in memory can be mounted.
fn no_disk(setup: &FaultSetup) -> Result<Option<String>> {
    let folder = setup.empty_folder("disk")?;
    Ok(Disk::new(folder, PAGE).err().map(|error| format!("no disk in memory (it needs root): {error}")))
}

/// Returns the disk space of files in whole pages, in bytes.
fn size(state: &FolderContent) -> usize {
    state.values().map(|bytes| bytes.len().next_multiple_of(PAGE)).sum()
}

/// Outputs to a disk with too little space.
pub(super) fn full(setup: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "output on a disk that fills up";
    if let Some(why) = no_disk(setup)? {
        return Ok(FaultResult::Skipped(FAULT, why));
    }
    let mut row = FaultRow::new(FAULT);
    let mut random = Random(11);
    for round in 0..setup.part_of(10) {
        for job in &setup.jobs {
            let before = if round.is_multiple_of(2) { FolderContent::new() } else { job.old.clone() };
            // At least one page: a size of 0 means no limit.
            let bytes = size(&before) + PAGE + random.below(size(&job.new));
            let disk = Disk::new(setup.empty_folder("disk")?, bytes)?;
            put(&before, &disk.folder)?;
            let ended = run(&setup.program, &job.arguments(&setup.inputs(), &disk.folder))?;
            row.count(&ended);
            row.add_violations(job.name(), job.check(&ended, &before, &disk.folder)?);
            disk.change(&format!("size={AMPLE_DISK_BYTES}"))?;
            let (violations, removed) = job.run_again(setup, &disk.folder)?;
            row.add_violations(job.name(), violations);
            row.removed += removed;
        }
    }
    Ok(FaultResult::Done(row))
}

/// Outputs to a read-only folder.
pub(super) fn read_only(setup: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "output into a read-only file system";
    if let Some(why) = no_disk(setup)? {
        return Ok(FaultResult::Skipped(FAULT, why));
    }
    let mut row = FaultRow::new(FAULT);
    for before_is_empty in [true, false] {
        for job in &setup.jobs {
            let disk = Disk::new(setup.empty_folder("disk")?, AMPLE_DISK_BYTES)?;
            let before = if before_is_empty { FolderContent::new() } else { job.old.clone() };
            put(&before, &disk.folder)?;
            disk.change("ro")?;
            let ended = run(&setup.program, &job.arguments(&setup.inputs(), &disk.folder))?;
            row.count(&ended);
            if ended.status == Some(0) {
                row.add_violations(job.name(), ["ended well".to_owned()]);
            }
            row.add_violations(job.name(), job.check(&ended, &before, &disk.folder)?);
            disk.change("rw")?;
            row.add_violations(job.name(), job.run_again(setup, &disk.folder)?.0);
        }
    }
    Ok(FaultResult::Done(row))
}

/// Outputs over write-protected files.
pub(super) fn protected(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("output over a write-protected file");
    for job in &setup.jobs {
        let out = setup.empty_folder("out")?;
        put(&job.old, &out)?;
        let protect = |yes: bool| -> Result<()> {
            for name in job.old.keys() {
                let path = out.join(name);
                if path.is_file() {
                    let mut permissions = path.metadata()?.permissions();
                    permissions.set_readonly(yes);
                    std::fs::set_permissions(&path, permissions)?;
                }
            }
            Ok(())
        };
        protect(true)?;
        let ended = run(&setup.program, &job.arguments(&setup.inputs(), &out))?;
        row.count(&ended);
        if ended.status == Some(0) {
            row.add_violations(job.name(), ["ended well".to_owned()]);
        }
        row.add_violations(job.name(), job.check(&ended, &job.old, &out)?);
        protect(false)?;
        row.add_violations(job.name(), job.run_again(setup, &out)?.0);
    }
    Ok(FaultResult::Done(row))
}

/// The output folder is missing when the run starts; commands that create their folder may do so.
pub(super) fn removed(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("output into a folder that was removed");
    for job in &setup.jobs {
        let out = setup.empty_folder("out")?;
        std::fs::remove_dir(&out)?;
        let arguments = job.arguments(&setup.inputs(), &out);
        let ended = run(&setup.program, &arguments)?;
        row.count(&ended);
        let makes_it = arguments.iter().any(|word| word == "-O");
        if !out.exists() {
            std::fs::create_dir(&out)?;
        } else if !makes_it {
            row.add_violations(job.name(), ["created the folder".to_owned()]);
        }
        if makes_it != (ended.status == Some(0)) {
            row.add_violations(job.name(), [format!("ended with {:?}", ended.status)]);
        }
        row.add_violations(job.name(), job.check(&ended, &FolderContent::new(), &out)?);
        row.add_violations(job.name(), job.run_again(setup, &out)?.0);
    }
    Ok(FaultResult::Done(row))
}

/// The output folder is removed during the run.
pub(super) fn vanishing(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("folder of the output removed at a random moment");
    let mut random = Random(13);
    for _ in 0..setup.part_of(10) {
        for job in &setup.jobs {
            let out = setup.empty_folder("out")?;
            put(&job.old, &out)?;
            let child =
                start(&setup.program, &job.arguments(&setup.inputs(), &out), Stdio::null(), Stdio::null())?;
            std::thread::sleep(Duration::from_secs_f64(job.time.as_secs_f64() * random.part()));
            // A file created during the removal keeps the folder; the next round removes it.
            while out.exists() {
                let _ = std::fs::remove_dir_all(&out);
            }
            let ended = finish(child)?;
            row.count(&ended);
            // Earlier outputs are gone with the folder: only the messages can be checked.
            row.add_violations(job.name(), ended.violations(job.new.len()));
            if out.exists() {
                std::fs::remove_dir_all(&out)?;
            }
            std::fs::create_dir(&out)?;
            row.add_violations(job.name(), job.run_again(setup, &out)?.0);
        }
    }
    Ok(FaultResult::Done(row))
}
