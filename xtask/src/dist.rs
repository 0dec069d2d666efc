//! The release archive: the command with its window, manual, completions, documentation, licences, software
//! bill of materials and a sample.
//!
//! Built for the current platform. The same sources and tools give the same bytes: files are sorted by name,
//! and all have the time of the last commit, or of `SOURCE_DATE_EPOCH`.

mod archive;
mod licences;
mod sbom;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use crate::{cargo, root};
use archive::Entry;

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

/// The default time of files: the earliest that zip can represent.
const EARLIEST_ZIP_TIME: u64 = 315_532_800;

/// Builds the program, packs the archive, and prints its path.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut folder, mut binary) = (None, None);
    let mut words = args.iter();
    while let Some(word) = words.next() {
        let place = match word.as_str() {
            "--out" => &mut folder,
            "--binary" => &mut binary,
            other => bail!("no option {other}: cargo xtask dist [--out FOLDER] [--binary FILE]"),
        };
        *place = Some(PathBuf::from(words.next().with_context(|| format!("{word} needs a path"))?));
    }
    let target = host()?;
    let metadata = metadata(&target)?;
    let version = metadata["packages"]
        .as_array()
        .and_then(|all| all.iter().find(|p| p["name"] == "lodsmith-cli"))
        .and_then(|p| p["version"].as_str())
        .context("cargo metadata knows no lodsmith-cli")?;
    let built = PathBuf::from(metadata["target_directory"].as_str().context("cargo names no target folder")?);
    let program = format!("lodsmith{}", std::env::consts::EXE_SUFFIX);
    let binary = match binary {
        Some(binary) => binary,
        None => build()?,
    };
    let name = format!("lodsmith-{version}-{target}");
    let time = time()?;
    let mut entries = contents(&binary, &program, &metadata, time)?;
    for entry in &mut entries {
        entry.name = format!("{name}/{}", entry.name);
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));

    let (file, bytes) = if cfg!(windows) {
        (format!("{name}.zip"), archive::zip(&entries, time)?)
    } else {
        (format!("{name}.tar.gz"), archive::tar_gz(&entries, time)?)
    };
    let folder = folder.unwrap_or_else(|| built.join("dist"));
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    write(&folder.join(&file), &bytes)?;
    let sum = hex(&Sha256::digest(&bytes));
    // The format of `sha256sum --check`.
    write(&folder.join(format!("{file}.sha256")), format!("{sum}  {file}\n").as_bytes())?;
    println!("{}: {} files, {:.1} MB", folder.join(&file).display(), entries.len(), bytes.len() as f64 / 1e6);
    println!("sha256 {sum}");
    Ok(())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}

/// Builds the command with its window; returns the path of the program.
fn build() -> Result<PathBuf> {
    let what = ["rustc", "--release", "--locked", "--package", "lodsmith-cli", "--bin", "lodsmith"];
    // Function names are a third of the size, and useless without the sources.
    let how =
        ["--features", "view", "--message-format", "json-render-diagnostics", "--", "-C", "strip=symbols"];
    let output = cargo().args(what).args(how).stderr(Stdio::inherit()).output().context("starting cargo")?;
    ensure!(output.status.success(), "cargo ended with {}", output.status);
    let told = String::from_utf8_lossy(&output.stdout);
    let mut artifacts = told.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let program = artifacts.find_map(|a| a["executable"].as_str().map(PathBuf::from));
    program.context("cargo names no program that it built")
}

/// Returns all entries, by their paths within the folder of the archive.
fn contents(binary: &Path, program: &str, metadata: &Value, time: u64) -> Result<Vec<Entry>> {
    let read = |path: &Path| std::fs::read(path).with_context(|| path.display().to_string());
    let entry = |name: String, bytes| Entry { name, bytes, is_program: false };
    let mut entries = vec![Entry { name: program.to_owned(), bytes: read(binary)?, is_program: true }];
    for name in included_files()? {
        let bytes = read(&root().join(&name))?;
        entries.push(entry(name, bytes));
    }
    entries.push(entry("THIRD-PARTY.txt".to_owned(), licences::text(metadata, "lodsmith-cli")?.into_bytes()));
    let lock = std::fs::read_to_string(root().join("Cargo.lock"))?;
    entries.push(entry(sbom::NAME.to_owned(), sbom::text(metadata, &lock, "lodsmith-cli", time)?));
    for (shell, name) in SHELLS {
        entries.push(entry(format!("completions/{name}"), output_of(binary, &["completions", shell])?));
    }
    let mut open = vec![Vec::new()];
    let mut seen = BTreeSet::new();
    while let Some(command) = open.pop() {
        let words: Vec<String> = command;
        let name =
            ["lodsmith".to_owned()].into_iter().chain(words.iter().cloned()).collect::<Vec<_>>().join("-");
        let joined = words.join(" ");
        let page = match joined.as_str() {
            "" => output_of(binary, &["man"])?,
            words => output_of(binary, &["man", words])?,
        };
        for below in pages_below(&String::from_utf8_lossy(&page), &name) {
            let next: Vec<String> = words.iter().cloned().chain([below]).collect();
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
    let words = page.lines().filter_map(|line| line.strip_prefix(&head)?.strip_suffix("(1)"));
    let plain = words.map(|word| word.replace("\\-", "-"));
    plain.filter(|word| word != "help" && !word.starts_with("help-")).collect()
}

/// Returns the output of a run of the program.
fn output_of(binary: &Path, words: &[&str]) -> Result<Vec<u8>> {
    let output = Command::new(binary).args(words).output().with_context(|| binary.display().to_string())?;
    let text = words.join(" ");
    ensure!(output.status.success(), "{} {text} ended with {}", binary.display(), output.status);
    ensure!(!output.stdout.is_empty(), "{} {text} says nothing", binary.display());
    Ok(output.stdout)
}

/// Returns cargo's metadata of the packages, as built for a platform.
fn metadata(target: &str) -> Result<Value> {
    let manifest = root().join("crates/cli/Cargo.toml");
    let mut command = cargo();
    command.args(["metadata", "--format-version", "1", "--locked", "--filter-platform", target]);
    let output = command.args(["--features", "view", "--manifest-path"]).arg(manifest).output()?;
    ensure!(output.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(serde_json::from_slice(&output.stdout)?)
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
    let told = git.ok().and_then(|out| String::from_utf8(out.stdout).ok()?.trim().parse().ok());
    Ok(told.unwrap_or(EARLIEST_ZIP_TIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_name_those_below() {
        let page = ".SH SUBCOMMANDS\n.TP\nlodsmith\\-lod(1)\nLevels\n.TP\nlodsmith\\-help(1)\nHelp\n";
        assert_eq!(pages_below(page, "lodsmith"), ["lod"]);
        let page = "lodsmith\\-progressive\\-build(1)\nlodsmith\\-lod(1)\n";
        assert_eq!(pages_below(page, "lodsmith-progressive"), ["build"]);
    }

    #[test]
    fn links_between_pages_that_go_along_hold() {
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
                assert!(inside || is_source, "{page} leads to {place}");
                links += 1;
            }
        }
        assert!(links > 20, "{links}");
    }
}
