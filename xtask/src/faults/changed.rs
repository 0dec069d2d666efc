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
pub(super) fn while_read(ground: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("input changed at a random moment");
    let mut chance = Random(29);
    for round in 0..ground.part_of(20) {
        for (number, job) in ground.jobs.iter().enumerate() {
            let (inputs, out) = (ground.empty_folder("changing")?, ground.empty_folder("out")?);
            copy_all(&ground.inputs(), &inputs)?;
            put(&job.old, &out)?;
            let names = job.inputs();
            let name = &names[chance.below(names.len())];
            let words = job.arguments(&inputs, &out);
            let child = start(&ground.program, &words, Stdio::null(), Stdio::null())?;
            // Reading comes first and is the smaller part of a run.
            std::thread::sleep(Duration::from_secs_f64(job.time.as_secs_f64() * 0.3 * chance.part()));
            change(&inputs.join(name), (round + number) % CHANGES, &mut chance)?;
            let ended = finish(child)?;
            row.count(&ended);
            row.breach(job.name(), check_run(ground, job, &ended, &out)?);
            // The same folder, with the original inputs.
            let again = job::run(&ground.program, &job.arguments(&ground.inputs(), &out))?;
            if again.status != Some(0) || job::parts(&out)? > 0 {
                row.breach(job.name(), [format!("the next run: {:?} {}", again.status, again.stderr.trim())]);
            }
        }
    }
    Ok(FaultResult::Done(row))
}

fn change(path: &Path, way: usize, chance: &mut Random) -> Result<()> {
    let bytes = fs::read(path)?;
    let at = chance.below(bytes.len());
    let open = || File::options().write(true).open(path);
    match way {
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

/// The content that such a run read is unknown: either it fails and leaves the outputs unchanged, or they are
/// readable.
fn check_run(ground: &FaultSetup, job: &Job, ended: &RunOutcome, out: &Path) -> Result<Vec<String>> {
    let mut breaches = Vec::new();
    let after = folder_content(out)?;
    // Partially read input may cause warnings; failures are one line each.
    if ended.status != Some(0) {
        breaches.extend(ended.breaches(job.new.len()));
    }
    if ended.status.is_none() {
        breaches.push("ended by a signal".into());
    }
    if ended.status == Some(1) && job.new.len() == 1 && after != job.old {
        breaches.push("failed, and changed the output".into());
    }
    for (name, bytes) in &after {
        if job::is_part(name) {
            breaches.push(format!("left {name}"));
        }
        let is_new = job.old.get(name) != Some(bytes);
        let is_mesh = [".ply", ".obj", ".gz", ".stl", ".glb", ".lpm"].iter().any(|e| name.ends_with(e));
        if is_new && is_mesh {
            let words = ["info".to_owned(), out.join(name).display().to_string()];
            let read = job::run(&ground.program, &words)?;
            if read.status != Some(0) {
                breaches.push(format!("{name} cannot be read: {}", read.stderr.trim()));
            }
        }
    }
    Ok(breaches)
}
