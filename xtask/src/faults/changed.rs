//! Faults: inputs that change while they are read.

use std::fs::{self, File};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use anyhow::Result;

use super::job::{self, Job, RunOutcome, finish, folder_content, put, start};
use super::{FaultResult, FaultRow, FaultSetup, Random, copy_all};

/// Number of ways to change a file.
const CHANGES: usize = 5;

/// Truncates, overwrites in the middle, extends, replaces or removes an input while it is read.
pub(super) fn while_read(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("input changed at a random moment");
    let mut random = Random(29);
    for round in 0..setup.part_of(20) {
        for (number, job) in setup.jobs.iter().enumerate() {
            let (inputs, out) = (setup.empty_folder("changing")?, setup.empty_folder("out")?);
            copy_all(&setup.inputs(), &inputs)?;
            put(&job.old, &out)?;
            let names = job.inputs();
            let name = &names[random.below(names.len())];
            let arguments = job.arguments(&inputs, &out);
            let child = start(&setup.program, &arguments, Stdio::null(), Stdio::null())?;
            // Reading takes the first and smaller part of a run.
            std::thread::sleep(Duration::from_secs_f64(job.time.as_secs_f64() * 0.3 * random.part()));
            change(&inputs.join(name), (round + number) % CHANGES, &mut random)?;
            let ended = finish(child)?;
            row.count(&ended);
            row.add_violations(job.name(), check_run(setup, job, &ended, &out)?);
            // The same folder, with the original inputs.
            let again = job::run(&setup.program, &job.arguments(&setup.inputs(), &out))?;
            if again.status != Some(0) || job::temporary_file_count(&out)? > 0 {
                row.add_violations(
                    job.name(),
                    [format!("the next run: {:?} {}", again.status, again.stderr.trim())],
                );
            }
        }
    }
    Ok(FaultResult::Done(row))
}

fn change(path: &Path, kind: usize, random: &mut Random) -> Result<()> {
    let bytes = fs::read(path)?;
    let at = random.below(bytes.len());
    let open = || File::options().write(true).open(path);
    match kind {
        0 => open()?.set_len(at as u64)?,
        1 => {
            let mut file = open()?;
            file.seek(SeekFrom::Start(at as u64))?;
            file.write_all(&bytes[..bytes.len() - at])?;
        }
        2 => {
            let mut file = open()?;
            file.seek(SeekFrom::End(0))?;
            file.write_all(&bytes[at..])?;
        }
        3 => {
            let other = path.with_extension("other");
            fs::write(&other, &bytes[..at])?;
            fs::rename(other, path)?;
        }
        _ => fs::remove_file(path)?,
    }
    Ok(())
}

/// Returns the violations of a run. The content that it read is unknown: either it fails and leaves the outputs
/// unchanged, or the outputs are readable.
fn check_run(setup: &FaultSetup, job: &Job, ended: &RunOutcome, out: &Path) -> Result<Vec<String>> {
    let mut violations = Vec::new();
    let after = folder_content(out)?;
    // Partially read input may cause warnings; each failure is one line.
    if ended.status != Some(0) {
        violations.extend(ended.violations(job.new.len()));
    }
    if ended.status.is_none() {
        violations.push("ended by a signal".into());
    }
    if ended.status == Some(1) && job.new.len() == 1 && after != job.old {
        violations.push("failed, and changed the output".into());
    }
    for (name, bytes) in &after {
        if job::is_temporary_file(name) {
            violations.push(format!("left {name}"));
        }
        let is_new = job.old.get(name) != Some(bytes);
        let is_mesh = [".ply", ".obj", ".gz", ".stl", ".glb", ".lpm"].iter().any(|e| name.ends_with(e));
        if is_new && is_mesh {
            let arguments = ["info".to_owned(), out.join(name).display().to_string()];
            let read = job::run(&setup.program, &arguments)?;
            if read.status != Some(0) {
                violations.push(format!("{name} cannot be read: {}", read.stderr.trim()));
            }
        }
    }
    Ok(violations)
}
