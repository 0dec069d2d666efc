//! The archive of the command: the program with its window, manual, completions, documentation, licences, software bill
//! of materials and a sample.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::archive::Entry;
use super::{Goal, archive, licences, sbom};
use crate::{cargo, root};

/// Shells, and the names of their completion scripts.
const SHELLS: [(&str, &str); 5] = [
    ("bash", "lodsmith.bash"),
    ("elvish", "lodsmith.elv"),
    ("fish", "lodsmith.fish"),
    ("powershell", "_lodsmith.ps1"),
    ("zsh", "_lodsmith"),
];

/// Files and folders of the repository to include at the same paths, so that links between the pages work.
const INCLUDED_PATHS: [&str; 11] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "SECURITY.md",
    "docs",
    "testdata/ORIGIN.md",
    "testdata/finial.ply",
];

/// Builds the program, and returns the name and the bytes of the archive.
pub(super) fn archive(goal: &Goal, binary: Option<PathBuf>) -> Result<(String, Vec<u8>)> {
    let metadata = metadata(&goal.target)?;
    let is_windows = goal.target.contains("windows");
    let program = if is_windows { "lodsmith.exe" } else { "lodsmith" };
    let binary = match binary {
        Some(binary) => binary,
        None => build(goal.cross_target())?,
    };
    // A program for another platform cannot run here; its manual is the same.
    let native_binary = if goal.cross_target().is_some() { build(None)? } else { binary.clone() };
    let name = format!("lodsmith-{}-{}", goal.version, goal.target);
    let mut entries = contents(&binary, program, &native_binary, &metadata, goal.time)?;
    for entry in &mut entries {
        entry.name = format!("{name}/{}", entry.name);
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    if is_windows {
        Ok((format!("{name}.zip"), archive::zip(&entries, goal.time)?))
    } else {
        Ok((format!("{name}.tar.gz"), archive::tar_gz(&entries, goal.time)?))
    }
}

/// Builds the command with its window and FBX, for a target triple or this machine; returns the path of the program.
fn build(target: Option<&str>) -> Result<PathBuf> {
    let what = ["rustc", "--release", "--locked", "--package", "lodsmith-cli", "--bin", "lodsmith"];
    // Function names are a third of the size, and useless without the sources.
    let how = [
        "--features",
        "view,fbx",
        "--message-format",
        "json-render-diagnostics",
        "--",
        "-C",
        "strip=symbols",
    ];
    let mut command = cargo();
    command.args(what).args(target.map(|target| format!("--target={target}")));
    let output = command.args(how).stderr(Stdio::inherit()).output().context("starting cargo")?;
    ensure!(output.status.success(), "cargo ended with {}", output.status);
    let messages = String::from_utf8_lossy(&output.stdout);
    let mut artifacts = messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let program = artifacts.find_map(|a| a["executable"].as_str().map(PathBuf::from));
    program.context("cargo reported no executable")
}

/// Returns all entries, by their paths within the folder of the archive.
/// Completions and manual come from `native_binary`, the same program built for this machine.
fn contents(
    binary: &Path,
    program: &str,
    native_binary: &Path,
    metadata: &Value,
    time: u64,
) -> Result<Vec<Entry>> {
    let read = |path: &Path| std::fs::read(path).with_context(|| path.display().to_string());
    let entry = Entry::file;
    let mut entries = vec![Entry::program(program.to_owned(), read(binary)?)];
    for name in included_files()? {
        let bytes = read(&root().join(&name))?;
        entries.push(entry(name, bytes));
    }
    entries.push(entry("THIRD-PARTY.txt".to_owned(), licences::text(metadata, "lodsmith-cli")?.into_bytes()));
    let lock = std::fs::read_to_string(root().join("Cargo.lock"))?;
    entries.push(entry(sbom::NAME.to_owned(), sbom::text(metadata, &lock, "lodsmith-cli", time)?));
    for (shell, name) in SHELLS {
        entries
            .push(entry(format!("completions/{name}"), output_of(native_binary, &["completions", shell])?));
    }
    let mut open: Vec<Vec<String>> = vec![Vec::new()];
    let mut seen = BTreeSet::new();
    while let Some(command) = open.pop() {
        let name =
            ["lodsmith".to_owned()].into_iter().chain(command.iter().cloned()).collect::<Vec<_>>().join("-");
        let joined = command.join(" ");
        let page = match joined.as_str() {
            "" => output_of(native_binary, &["man"])?,
            name => output_of(native_binary, &["man", name])?,
        };
        for below in pages_below(&String::from_utf8_lossy(&page), &name) {
            let next: Vec<String> = command.iter().cloned().chain([below]).collect();
            if seen.insert(next.clone()) {
                open.push(next);
            }
        }
        entries.push(entry(format!("man/{name}.1"), page));
    }
    ensure!(seen.len() >= 5, "the manual names {} commands: it cannot be read", seen.len());
    Ok(entries)
}

/// Returns the files of the repository to include, by their paths in it.
fn included_files() -> Result<Vec<String>> {
    let mut open: Vec<String> = INCLUDED_PATHS.map(str::to_owned).into();
    let mut files = Vec::new();
    while let Some(name) = open.pop() {
        let path = root().join(&name);
        if path.is_dir() {
            for below in std::fs::read_dir(&path).with_context(|| name.clone())? {
                open.push(format!("{name}/{}", below?.file_name().to_string_lossy()));
            }
        } else {
            files.push(name);
        }
    }
    Ok(files)
}

/// Returns the commands that a manual page refers to: `lodsmith\-lod(1)` on the page of `lodsmith` is `lod`.
fn pages_below(page: &str, name: &str) -> Vec<String> {
    let head = format!("{}\\-", name.replace('-', "\\-"));
    let pages = page.lines().filter_map(|line| line.strip_prefix(&head)?.strip_suffix("(1)"));
    let plain = pages.map(|page| page.replace("\\-", "-"));
    plain.filter(|word| word != "help" && !word.starts_with("help-")).collect()
}

/// Returns the output of a run of the program.
fn output_of(binary: &Path, arguments: &[&str]) -> Result<Vec<u8>> {
    let output =
        Command::new(binary).args(arguments).output().with_context(|| binary.display().to_string())?;
    let text = arguments.join(" ");
    ensure!(output.status.success(), "{} {text} ended with {}", binary.display(), output.status);
    ensure!(!output.stdout.is_empty(), "{} {text} says nothing", binary.display());
    Ok(output.stdout)
}

/// Returns cargo's metadata of the packages, as built for a platform.
fn metadata(target: &str) -> Result<Value> {
    let manifest = root().join("crates/cli/Cargo.toml");
    let mut command = cargo();
    command.args(["metadata", "--format-version", "1", "--locked", "--filter-platform", target]);
    let output = command.args(["--features", "view,fbx", "--manifest-path"]).arg(manifest).output()?;
    ensure!(output.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(serde_json::from_slice(&output.stdout)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manual_pages_refer_to_their_subcommands() {
        let page = ".SH SUBCOMMANDS\n.TP\nlodsmith\\-lod(1)\nLevels\n.TP\nlodsmith\\-help(1)\nHelp\n";
        assert_eq!(pages_below(page, "lodsmith"), ["lod"]);
        let page = "lodsmith\\-progressive\\-build(1)\nlodsmith\\-lod(1)\n";
        assert_eq!(pages_below(page, "lodsmith-progressive"), ["build"]);
    }

    #[test]
    fn links_between_included_pages_work() {
        let files = included_files().unwrap();
        assert!(files.iter().any(|name| name == "docs/viewer.md"), "{files:?}");
        let pages = files.iter().filter(|name| name.ends_with(".md"));
        let mut links = 0;
        for page in pages {
            let text = std::fs::read_to_string(root().join(page)).unwrap();
            let folder = page.rfind('/').map_or("", |at| &page[..at]);
            for part in text.split("](").skip(1) {
                let target = part.split([')', '#', ' ']).next().unwrap();
                if target.is_empty() || target.contains(':') {
                    continue;
                }
                let mut steps: Vec<&str> = folder.split('/').filter(|s| !s.is_empty()).collect();
                for step in target.split('/') {
                    match step {
                        ".." => drop(steps.pop()),
                        "." | "" => {}
                        name => steps.push(name),
                    }
                }
                let place = steps.join("/");
                // Sources are not included.
                let is_source = ["crates/", "bindings/"].iter().any(|folder| place.starts_with(folder))
                    && root().join(&place).exists();
                let inside =
                    files.iter().any(|name| *name == place || name.starts_with(&format!("{place}/")));
                assert!(inside || is_source, "{page} links to {place}");
                links += 1;
            }
        }
        assert!(links > 20, "{links}");
    }
}
