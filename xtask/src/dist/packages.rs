//! The packages for other languages: each is built by a script in its folder below `bindings`.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::archive::Entry;
use super::{Goal, archive};
use crate::root;

/// Installs the C library into a new folder; returns the name and the bytes of its archive.
pub(super) fn c(goal: &Goal) -> Result<(String, Vec<u8>)> {
    let folder = tempfile::tempdir()?;
    script("bindings/c/install.sh", folder.path(), goal)?;
    let name = format!("lodsmith-c-{}-{}", goal.version, goal.target);
    let mut entries = Vec::new();
    collect(folder.path(), &name, &mut entries)?;
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    Ok((format!("{name}.tar.gz"), archive::tar_gz(&entries, goal.time)?))
}

/// Returns the name and the bytes of the single file that the script of a package makes.
pub(super) fn scripted(part: &str, goal: &Goal) -> Result<(String, Vec<u8>)> {
    let folder = tempfile::tempdir()?;
    let path = format!("bindings/{part}/package.sh");
    script(&path, folder.path(), goal)?;
    let files = std::fs::read_dir(folder.path())?.collect::<std::io::Result<Vec<_>>>()?;
    ensure!(files.len() == 1, "{path} made {} files instead of one", files.len());
    let name = files[0].file_name().to_string_lossy().into_owned();
    Ok((name, std::fs::read(files[0].path())?))
}

/// Runs a script that writes its output into a folder.
fn script(path: &str, folder: &Path, goal: &Goal) -> Result<()> {
    let mut command = Command::new("bash");
    command.arg(path).arg(folder).current_dir(root()).env("SOURCE_DATE_EPOCH", goal.time.to_string());
    if let Some(target) = goal.cross_target() {
        command.env("LODSMITH_TARGET", target);
    }
    let status = command.status().with_context(|| format!("starting bash for {path}"))?;
    ensure!(status.success(), "{path} ended with {status}");
    Ok(())
}

/// Adds the files and links of a folder and its subfolders.
fn collect(folder: &Path, name: &str, entries: &mut Vec<Entry>) -> Result<()> {
    for below in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let below = below?;
        let path = below.path();
        let name = format!("{name}/{}", below.file_name().to_string_lossy());
        let kind = below.file_type()?;
        if kind.is_dir() {
            collect(&path, &name, entries)?;
        } else if kind.is_symlink() {
            let target = std::fs::read_link(&path)?.to_string_lossy().into_owned();
            entries.push(Entry::link(name, target));
        } else {
            entries.push(Entry::file(name, std::fs::read(&path)?));
        }
    }
    Ok(())
}
