//! The files of the repository.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;

use crate::root;

/// Returns every file below a folder, sorted, without build outputs and the files of Git.
pub(crate) fn files_under(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    if !folder.is_dir() {
        return Ok(files);
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !matches!(&*name, ".git" | "target" | "corpus" | "artifacts" | "coverage") {
                files.extend(files_under(&path)?);
            }
        } else {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Returns all files that Git tracks or would track; without Git, all files.
pub(crate) fn tree() -> Result<Vec<PathBuf>> {
    let git = Command::new("git")
        .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        .current_dir(root())
        .output();
    match git {
        Ok(out) if out.status.success() => {
            let names = String::from_utf8(out.stdout)?;
            Ok(names.split_terminator('\0').map(|n| root().join(n)).filter(|p| p.is_file()).collect())
        }
        _ => files_under(root()),
    }
}

/// Returns every Rust source below a folder of the workspace.
pub(crate) fn sources(folder: &str) -> Result<Vec<PathBuf>> {
    let mut files = files_under(&root().join(folder))?;
    files.retain(|p| p.extension().is_some_and(|e| e == "rs"));
    Ok(files)
}

/// Returns a path relative to the root of the workspace, with slashes.
pub(crate) fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string().replace('\\', "/")
}
