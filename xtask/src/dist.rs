//! Files for distribution: the command, and the packages for other languages, all with the same version.
//!
//! Archives are reproducible: files are sorted by name, and their time is `SOURCE_DATE_EPOCH`, or
//! the time of the last commit.

mod archive;
mod command;
mod licences;
mod packages;
mod sbom;

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use sha2::{Digest as _, Sha256};

use crate::root;

/// The default time of files: the earliest time that ZIP can represent.
const EARLIEST_ZIP_TIME: u64 = 315_532_800;

/// The parts, in build order.
const PARTS: [&str; 5] = ["command", "python", "c", "js", "blender"];

/// Settings that all parts of one run share.
struct Goal {
    /// The version of the workspace, which all parts have.
    version: String,
    /// The target triple to build for.
    target: String,
    /// The target triple of this machine.
    host: String,
    /// The time stamp of all files, in seconds since 1970.
    time: u64,
}

impl Goal {
    /// Returns the target triple if it differs from the host.
    fn cross_target(&self) -> Option<&str> {
        (self.target != self.host).then_some(&*self.target)
    }
}

/// Builds the named parts, or all of them, and prints the path and the checksum of each.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut folder, mut binary, mut target) = (None, None, None);
    let mut parts = Vec::new();
    let mut rest = args.iter();
    while let Some(argument) = rest.next() {
        let value = match argument.as_str() {
            "--out" => &mut folder,
            "--binary" => &mut binary,
            "--target" => &mut target,
            part if PARTS.contains(&part) => {
                parts.push(part);
                continue;
            }
            other => bail!(
                "no option or part {other}: cargo xtask dist [--out FOLDER] [--target TRIPLE] [--binary FILE] [{}]...",
                PARTS.join("|")
            ),
        };
        *value = Some(rest.next().with_context(|| format!("{argument} needs a value"))?);
    }
    if parts.is_empty() {
        parts.extend(PARTS);
    }
    let host = host()?;
    let target = target.cloned().unwrap_or_else(|| host.clone());
    let goal = Goal { version: version()?, target, host, time: time()? };
    let folder = folder.map_or_else(|| root().join("target/dist"), PathBuf::from);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    for part in parts {
        let (file, bytes) = match part {
            "command" => command::archive(&goal, binary.map(PathBuf::from))?,
            "c" => packages::c(&goal)?,
            other => packages::scripted(other, &goal)?,
        };
        ensure!(
            file.contains(&goal.version),
            "the version of {file} differs from the version of the workspace, {}",
            goal.version
        );
        write(&folder.join(&file), &bytes)?;
        let sum = hex(&Sha256::digest(&bytes));
        // The format of `sha256sum --check`.
        write(&folder.join(format!("{file}.sha256")), format!("{sum}  {file}\n").as_bytes())?;
        println!("{}: {:.1} MB\nsha256 {sum}", folder.join(&file).display(), bytes.len() as f64 / 1e6);
    }
    Ok(())
}

/// Returns the version of the workspace.
fn version() -> Result<String> {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml"))?;
    let line = manifest.lines().find_map(|line| line.strip_prefix("version = \"")?.strip_suffix('"'));
    Ok(line.context("Cargo.toml has no version")?.to_owned())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// Returns the target triple of this platform.
fn host() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("-vV").current_dir(root()).output().context("starting rustc")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc -vV names no host")?.to_owned())
}

/// Returns the time stamp of all files, in seconds since 1970.
fn time() -> Result<u64> {
    if let Ok(text) = std::env::var("SOURCE_DATE_EPOCH") {
        return text.trim().parse().with_context(|| format!("SOURCE_DATE_EPOCH is {text}"));
    }
    let git = Command::new("git").args(["log", "-1", "--format=%ct"]).current_dir(root()).output();
    let commit_time = git.ok().and_then(|out| String::from_utf8(out.stdout).ok()?.trim().parse().ok());
    Ok(commit_time.unwrap_or(EARLIEST_ZIP_TIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_packages_have_the_version_of_the_workspace() {
        // (The wheel and the C archive take theirs from the workspace.)
        for path in ["bindings/js/package.json", "bindings/blender/lodsmith_blender/blender_manifest.toml"] {
            let text = std::fs::read_to_string(root().join(path)).unwrap();
            let own = text.lines().find_map(|line| {
                let line = line.trim().trim_end_matches(',');
                line.strip_prefix("\"version\": ").or_else(|| line.strip_prefix("version = "))
            });
            assert_eq!(own, Some(&*format!("\"{}\"", version().unwrap())), "{path}");
        }
    }
}
