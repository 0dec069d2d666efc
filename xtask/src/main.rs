//! Developer tasks of the workspace.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints to its standard streams")]

mod corpus;
mod dist;
mod faults;
mod files;
mod map;
mod pictures;
mod sample;
mod seeds;
mod tidy;
mod walk;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

const HELP: &str = "\
cargo xtask bench [rivals|attributes|cluster|cluster_lod|io_speed|memory|render|progressive|all] [OPTIONS]   compares Lodsmith with other libraries (needs a C++ compiler)
cargo xtask bench page [--models FOLDER] [--lab FOLDER]    writes the tables of docs/benchmarks.md anew; with --lab also those of accuracy
cargo xtask bench tolerance [--quick] [--models FOLDER] [--page] [FILE...]   runs bench/tolerance.py: the fewest triangles of each tool within a distance (needs Python)
cargo xtask bench accuracy FOLDER [--page FILE]            makes the tables of accuracy from the results of a benchmark lab
cargo xtask corpus [DIR...] [--limit SECONDS] [--only TEXT] [--largest FACES]   runs the release command on every model in the folders; does not measure errors of larger models
cargo xtask corpus [DIR...] --methods [--largest FACES] [...]   runs every method on every model of at most this size
cargo xtask dist [--out FOLDER] [--target TRIPLE] [--binary FILE] [command|python|c|js|blender]...   builds the release files: archives, wheel, packages
cargo xtask faults [--quick] [--strict] [--only NAME] [--binary FILE]   checks what the command leaves behind after full disks, kills, closed pipes
cargo xtask map [CRATE|FOLDER]                             prints the source files as a tree, each with the first sentence of its head
cargo xtask tidy                                           checks the rules of the repository; also part of `cargo test`
cargo xtask goldens [FILTER]                               rewrites the recorded outputs of tests and lists the changed files
cargo xtask walk [MODEL...] [--preset NAME]...             simplifies in steps with every preset; fails if a result with more triangles is less accurate
cargo xtask seeds [--binary FILE]                          writes the initial corpus of the fuzz targets to fuzz/corpus
cargo xtask sample                                         writes the sample model of the README
cargo xtask web [FOLDER]                                   builds the viewer as a static page (default: target/web/page)
cargo xtask pictures [finial|shadings|lod|viewer|methods|METHOD...]   renders the pictures of the README and of docs
";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (command, rest) = args.split_first().map_or(("help", &[][..]), |(c, rest)| (c.as_str(), rest));
    let done = match command {
        "bench" => bench(rest),
        "dist" => dist::run(rest),
        "corpus" => corpus::run(rest),
        "faults" => faults::run(rest),
        "map" => map::run(rest),
        "walk" => walk::run(rest),
        "tidy" => tidy::run(),
        "goldens" => goldens(rest),
        "seeds" => seeds::run(rest),
        "sample" => write_sample(),
        "pictures" => pictures::run(rest),
        "web" => web(rest),
        "help" | "--help" | "-h" => {
            print!("{HELP}");
            Ok(())
        }
        other => Err(anyhow::anyhow!("no command {other}\n\n{HELP}")),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Builds the viewer as a static page into a folder.
fn web(args: &[String]) -> Result<()> {
    ensure!(args.len() <= 1, "usage: cargo xtask web [FOLDER]");
    let status = Command::new("crates/web/build.sh").args(args).current_dir(root()).status()?;
    ensure!(status.success(), "crates/web/build.sh ended with {status}");
    Ok(())
}

/// Benchmark programs.
const BENCHES: &[&str] = &[
    "rivals",
    "accuracy",
    "attributes",
    "cluster",
    "cluster_lod",
    "io_speed",
    "memory",
    "render",
    "progressive",
    "indices",
];

/// Returns the root folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask is in a folder of the workspace")
}

/// Returns a cargo command in the root folder of the workspace.
fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// Returns what Cargo says of the workspace.
fn metadata() -> Result<Value> {
    let out = cargo().args(["metadata", "--no-deps", "--offline", "--format-version", "1"]).output()?;
    serde_json::from_slice(&out.stdout).context("cargo metadata")
}

/// Returns Cargo's target folder.
fn target_folder() -> Result<PathBuf> {
    Ok(metadata()?["target_directory"].as_str().context("no target folder")?.into())
}

/// Returns the arguments that select the packages that Cargo takes by default, and one more: then all that they share
/// has the features of the README's first command and is not built again.
fn selected_with(package: &str) -> Result<Vec<String>> {
    let all = metadata()?;
    let members = all["workspace_default_members"].as_array().context("no default members")?;
    let names = members.iter().filter_map(Value::as_str).chain([package]);
    Ok(names.flat_map(|name| ["--package".into(), name.into()]).collect())
}

/// Builds the command with the release profile; returns its path.
fn release_command() -> Result<PathBuf> {
    release_binary("lodsmith", &[])
}

/// Builds a program of the selected packages with the release profile; returns its path.
fn release_binary(name: &str, selected: &[String]) -> Result<PathBuf> {
    succeed(cargo().args(["build", "--quiet", "--release", "--locked", "--bin", name]).args(selected))?;
    Ok(target_folder()?.join("release").join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}

fn succeed(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("starting {}", command.get_program().display()))?;
    ensure!(status.success(), "{} ended with {status}", command.get_program().display());
    Ok(())
}

/// Returns the folder of shared test models, if it exists next to the checkout.
fn shared_models() -> Option<PathBuf> {
    let folder = root().join("../shared/models");
    folder.is_dir().then_some(folder)
}

fn bench(args: &[String]) -> Result<()> {
    if let Some(("page", rest)) = args.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        return page(rest);
    }
    if let Some(("tolerance", rest)) = args.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        return tolerance(rest);
    }
    let (which, rest) = match args.split_first() {
        Some((first, rest)) if ["all"].iter().chain(BENCHES).any(|known| known == first) => {
            (first.as_str(), rest)
        }
        _ => ("rivals", args),
    };
    let names: &[&str] = match which {
        "all" => &["rivals", "io_speed"],
        _ => BENCHES.iter().find(|known| **known == which).map_or(&["rivals"], std::slice::from_ref),
    };
    for &name in names {
        let mut command = Command::new(release_binary(name, &selected_with("lodsmith-bench")?)?);
        command.current_dir(root());
        // With `all`, the options apply only to `rivals`.
        if which != "all" || name == "rivals" {
            command.args(rest.iter().map(|argument| absolute_path(argument)));
        }
        if name == "rivals" && !has_paths(rest) {
            let Some(models) = shared_models() else {
                bail!("no models: name files or folders (../shared/models does not exist)");
            };
            command.arg("--models").arg(models);
        }
        succeed(&mut command)?;
    }
    Ok(())
}

/// Runs the comparison of tools within a distance, with the Python of the environment.
fn tolerance(args: &[String]) -> Result<()> {
    let mut command = Command::new("python3");
    command.current_dir(root()).arg("bench/tolerance.py").arg("--lodsmith").arg(release_command()?);
    succeed(command.args(args.iter().map(|argument| absolute_path(argument))))
}

/// Writes the generated sections of docs/benchmarks.md: those of the lab, if its results are given, and those of
/// `rivals`.
fn page(args: &[String]) -> Result<()> {
    let to_page = ["--page".to_owned(), root().join("docs/benchmarks.md").to_string_lossy().into_owned()];
    let mut args = args.to_vec();
    if let Some(at) = args.iter().position(|argument| argument == "--lab") {
        ensure!(at + 1 < args.len(), "--lab needs a folder");
        let lab: Vec<String> = args.drain(at..at + 2).skip(1).collect();
        bench(&[&["accuracy".to_owned()][..], &lab, &to_page].concat())?;
    }
    bench(&[&["rivals".to_owned()][..], &args, &to_page].concat())
}

/// Returns whether the arguments of `rivals` name files or folders.
fn has_paths(args: &[String]) -> bool {
    let mut rest = args.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--models" => return true,
            "--only" | "--targets" | "--orders" | "--clock" | "--reps" | "--samples" | "--json"
            | "--page" => _ = rest.next(),
            path if !path.starts_with('-') => return true,
            _ => {}
        }
    }
    false
}

/// Returns an existing path as an absolute one, so that it is valid in any working directory.
fn absolute_path(path: &str) -> PathBuf {
    std::path::absolute(path).ok().filter(|p| !path.is_empty() && p.exists()).unwrap_or_else(|| path.into())
}

fn goldens(args: &[String]) -> Result<()> {
    let filter = args.first().map_or("golden", String::as_str);
    let mut tests = cargo();
    tests.args(["test", "--quiet", filter]);
    // The first variable updates the recorded outputs of this project, the second the snapshots of insta.
    succeed(tests.env("LODSMITH_GOLDENS", "write").env("INSTA_UPDATE", "always"))?;
    succeed(Command::new("git").args(["status", "--short"]).current_dir(root()))
}

fn write_sample() -> Result<()> {
    let sample = sample::finial();
    let bytes = sample::ply(&sample);
    for path in [sample::PATH, sample::PATH_IN_VIEWER] {
        std::fs::write(root().join(path), &bytes).with_context(|| format!("writing {path}"))?;
    }
    println!(
        "{}: {} vertices, {} triangles, {} bytes",
        sample::PATH,
        sample.positions.len(),
        sample.triangles.len(),
        bytes.len()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_distinguished_from_option_values() {
        let found = |args: &[&str]| has_paths(&args.iter().map(|&a| a.to_owned()).collect::<Vec<_>>());
        assert!(!found(&["--quick", "--only", "bunny", "--targets", "10%"]));
        assert!(!found(&["--page", "a.md"]));
        assert!(found(&["--quick", "a.ply"]));
        assert!(found(&["--models", "folder"]));
    }
}
