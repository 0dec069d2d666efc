//! Runs every model of a folder through the release command: reads it, simplifies it to 50, 10 and 1 %, and
//! reads the results again.
//!
//! The checks depend on the folder of a file:
//! * anywhere: no crash, no hang, no more memory than the limit, at most the requested triangles if the
//!   report says `reached`, and a readable result;
//! * clean manifold input: no more non-manifold or border edges, degenerate or duplicate faces than in the
//!   input;
//! * `dirty/` and `broken/`: success, or exit status 1 with one line of error, each in under a second and 200
//!   MB; [`EXPECTED_OUTCOMES`] lists the expected outcome if there is only one;
//! * unsupported formats: refused.
//!
//! With `--methods`, runs every method instead, see [`methods`].

mod methods;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::release_command;

/// The expected outcome for a damaged file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ExpectedOutcome {
    /// Success.
    Done,
    /// An error whose line contains all of these words.
    Refused(&'static [&'static str]),
    /// Either.
    Either,
}

/// Files, by name, with a fixed outcome; all others in `dirty/` must succeed.
const EXPECTED_OUTCOMES: &[(&str, ExpectedOutcome)] = &[
    ("all_degenerate.off", ExpectedOutcome::Either),
    ("bad_magic.glb", ExpectedOutcome::Refused(&[])),
    ("count_too_large.stl", ExpectedOutcome::Refused(&[])),
    ("inf_vertices.ply", ExpectedOutcome::Either),
    ("index_zero.obj", ExpectedOutcome::Refused(&["line"])),
    ("nan_vertex.obj", ExpectedOutcome::Either),
    ("near_duplicate_vertices.obj", ExpectedOutcome::Either),
    ("no_faces.ply", ExpectedOutcome::Refused(&[])),
    ("only_comments.obj", ExpectedOutcome::Refused(&[])),
    ("text_not_a_mesh.obj", ExpectedOutcome::Refused(&[])),
    ("truncated.glb", ExpectedOutcome::Refused(&[])),
    ("truncated.ply", ExpectedOutcome::Refused(&[])),
    ("truncated.stl", ExpectedOutcome::Refused(&[])),
    ("unused_and_bad_index.obj", ExpectedOutcome::Refused(&["line", "99"])),
    ("wrong_extension.off", ExpectedOutcome::Either),
    ("AllIndicesOutOfRange.gltf", ExpectedOutcome::Refused(&[])),
    ("OutOfMemory.off", ExpectedOutcome::Refused(&[])),
    ("empty.off", ExpectedOutcome::Refused(&[])),
    ("invalid.off", ExpectedOutcome::Refused(&[])),
    ("malformed.obj", ExpectedOutcome::Refused(&["line"])),
    ("number_formats.obj", ExpectedOutcome::Either),
];

/// Extensions of supported formats, and of known but unsupported ones.
const SUPPORTED_EXTENSIONS: &[&str] = &["obj", "off", "ply", "stl", "gltf", "glb", "3mf", "dae"];
/// (FBX is a feature of the build.)
const REFUSED_EXTENSIONS: &[&str] = &["fbx"];
/// Fractions of the triangles to keep.
const RATIOS: [f64; 3] = [0.5, 0.1, 0.01];
/// Limits for files that are damaged on purpose.
const DAMAGED_LIMIT: Limits = Limits { seconds: 1.0, megabytes: 200 };

#[derive(Clone, Copy)]
struct Limits {
    seconds: f64,
    megabytes: u64,
}

/// The outcome of a command.
struct Outcome {
    /// Exit status; `None` if it was killed by a signal or by this program.
    status: Option<i32>,
    seconds: f64,
    peak_kb: u64,
    stdout: String,
    stderr: String,
}

/// The checks of one file.
#[derive(Default)]
struct CorpusRow {
    name: String,
    faces: Option<u64>,
    /// Triangles after each ratio.
    left: Vec<String>,
    seconds: f64,
    peak_kb: u64,
    problems: Vec<String>,
    remark: String,
}

pub(crate) fn run(args: &[String]) -> Result<()> {
    let (mut folder, mut limit, mut only) = (None::<PathBuf>, 60.0, String::new());
    let (mut is_of_methods, mut largest) = (false, methods::DEFAULT_MAX_FACES);
    let mut words = args.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--limit" => limit = words.next().context("--limit needs seconds")?.parse()?,
            "--only" => only.clone_from(words.next().context("--only needs a text")?),
            "--methods" => is_of_methods = true,
            "--largest" => largest = methods::count(words.next())?,
            place if folder.is_none() && !place.starts_with('-') => folder = Some(place.into()),
            other => bail!("unknown argument {other}"),
        }
    }
    let folder = folder.context("which folder? cargo xtask corpus DIR")?;
    ensure!(folder.is_dir(), "{} is no folder: there is nothing to check", folder.display());

    let command = release_command()?;
    let limits = Limits { seconds: limit, megabytes: 4000 };

    let mut files = Vec::new();
    collect(&folder, &mut files)?;
    files.retain(|p| p.to_string_lossy().contains(&only));
    ensure!(!files.is_empty(), "{} has no model", folder.display());
    if is_of_methods {
        return methods::Sweep { command, folder, files, limits, largest }.run();
    }
    println!("| file | faces | 50 % | 10 % | 1 % | s | peak MB | |\n|---|--:|--:|--:|--:|--:|--:|---|");
    let mut failed = 0;
    for file in &files {
        let name = file.strip_prefix(&folder).unwrap_or(file).to_string_lossy().replace('\\', "/");
        let mut row = CorpusRow { name, ..CorpusRow::default() };
        check(&command, file, limits, &mut row)?;
        failed += usize::from(!row.problems.is_empty());
        row.print();
    }
    println!("\n{} files, {failed} with problems", files.len());
    ensure!(failed == 0, "{failed} of {} files have problems", files.len());
    Ok(())
}

impl CorpusRow {
    fn print(&self) {
        let left = |k: usize| self.left.get(k).map_or("-", String::as_str);
        let verdict = match self.problems.as_slice() {
            [] => self.remark.clone(),
            problems => format!("**FAILS**: {}", problems.join("; ")),
        };
        println!(
            "| {} | {} | {} | {} | {} | {:.2} | {} | {} |",
            self.name,
            self.faces.map_or("-".into(), |n| n.to_string()),
            left(0),
            left(1),
            left(2),
            self.seconds,
            self.peak_kb / 1024,
            verdict.replace('|', "\\|").replace('\n', " "),
        );
    }

    fn problem(&mut self, text: impl Into<String>) {
        self.problems.push(text.into());
    }
}

fn ending(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').map_or(String::new(), |(_, ending)| ending.to_owned())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    entries.sort();
    for path in entries {
        if path.is_dir() {
            collect(&path, files)?;
        } else if SUPPORTED_EXTENSIONS.contains(&&*ending(&path))
            || REFUSED_EXTENSIONS.contains(&&*ending(&path))
        {
            files.push(path);
        }
    }
    Ok(())
}

fn check(command: &Path, file: &Path, limits: Limits, row: &mut CorpusRow) -> Result<()> {
    let folder = row.name.split('/').next().unwrap_or_default();
    let file_name = file.file_name().unwrap_or_default().to_string_lossy();
    let damaged = matches!(folder, "dirty" | "broken");
    let wanted = if REFUSED_EXTENSIONS.contains(&&*ending(file)) {
        ExpectedOutcome::Refused(&[])
    } else if row.name.contains("/compressed/") {
        // An extension that needs a decoder: either decoded, or refused by name.
        ExpectedOutcome::Either
    } else {
        let listed = EXPECTED_OUTCOMES.iter().find(|(name, _)| damaged && *name == file_name);
        listed.map_or(ExpectedOutcome::Done, |&(_, wanted)| wanted)
    };
    let limits = if damaged { DAMAGED_LIMIT } else { limits };

    let info = call(command, &["info".as_ref(), file.as_os_str(), "--json".as_ref()], limits)?;
    row.note(&info, "info", limits);
    let before = value(&info);
    match (&before, info.status) {
        (Some(before), Some(0)) => row.faces = before["faces"].as_u64(),
        (None, Some(0)) => row.problem("info: no JSON"),
        _ if wanted == ExpectedOutcome::Done => row.problem(format!("info: {}", one_line(&info))),
        _ => {}
    }

    let out_folder = tempfile::tempdir()?;
    for ratio in RATIOS {
        // The format of the input, if it holds everything in one file.
        let ending = ending(file);
        let ending = if SUPPORTED_EXTENSIONS.contains(&&*ending) {
            // COLLADA is only read.
            ending.replace("gltf", "glb").replace("dae", "glb")
        } else {
            "ply".into()
        };
        let out = out_folder.path().join(format!("out {ratio}.{ending}"));
        let text = ratio.to_string();
        let args = [
            "simplify".as_ref(),
            file.as_os_str(),
            "--ratio".as_ref(),
            text.as_ref(),
            "-o".as_ref(),
            out.as_os_str(),
        ];
        let args = [args.as_slice(), &["--json".as_ref()]].concat();
        let outcome = call(command, &args, limits)?;
        let what = format!("to {ratio}");
        row.note(&outcome, &what, limits);
        match (outcome.status, wanted) {
            (Some(0), ExpectedOutcome::Refused(_)) => {
                row.problem(format!("{what}: done, but should be refused"))
            }
            (Some(0), _) => result(command, &before, &outcome, &out, limits, &what, row)?,
            (Some(1), ExpectedOutcome::Done) => row.problem(format!("{what}: {}", one_line(&outcome))),
            (Some(1), ExpectedOutcome::Refused(words)) => {
                for word in words.iter().filter(|w| !outcome.stderr.contains(**w)) {
                    row.problem(format!("the error does not say \"{word}\": {}", one_line(&outcome)));
                }
                row.remark = one_line(&outcome);
            }
            (Some(1), ExpectedOutcome::Either) => row.remark = one_line(&outcome),
            // Other exit statuses have been noted.
            _ => {}
        }
        if outcome.status != Some(0) {
            if out.exists() {
                row.problem(format!("{what}: failed and left a file"));
            }
            // The other ratios would fail in the same way.
            break;
        }
    }
    row.problems.dedup();
    Ok(())
}

impl CorpusRow {
    /// Records time and memory of a run, and its violations of general rules.
    fn note(&mut self, outcome: &Outcome, what: &str, limits: Limits) {
        self.seconds = self.seconds.max(outcome.seconds);
        self.peak_kb = self.peak_kb.max(outcome.peak_kb);
        match outcome.status {
            Some(0) => {}
            Some(1) => {
                let lines: Vec<&str> = outcome.stderr.lines().collect();
                if !(lines.len() == 1 && lines[0].starts_with("error:")) {
                    self.problem(format!("{what}: status 1 with {} lines of error, not one", lines.len()));
                }
            }
            Some(status) => self.problem(format!("{what}: status {status}: {}", one_line(outcome))),
            None => {
                self.problem(format!("{what}: ended after {:.1} s: {}", outcome.seconds, one_line(outcome)))
            }
        }
        if outcome.seconds > limits.seconds {
            self.problem(format!("{what}: {:.2} s of at most {} s", outcome.seconds, limits.seconds));
        }
        if outcome.peak_kb / 1024 > limits.megabytes {
            self.problem(format!("{what}: {} MB of at most {} MB", outcome.peak_kb / 1024, limits.megabytes));
        }
    }
}

/// Checks the output of a successful run.
fn result(
    command: &Path,
    before: &Option<Value>,
    outcome: &Outcome,
    out: &Path,
    limits: Limits,
    what: &str,
    row: &mut CorpusRow,
) -> Result<()> {
    let Some(report) = value(outcome) else {
        row.problem(format!("{what}: no JSON"));
        return Ok(());
    };
    let info = call(command, &["info".as_ref(), out.as_os_str(), "--json".as_ref()], limits)?;
    let Some(after) = value(&info).filter(|_| info.status == Some(0)) else {
        row.problem(format!("{what}: the result does not read back: {}", one_line(&info)));
        return Ok(());
    };
    let count = |v: &Value, key: &str| v[key].as_u64();
    let faces = count(&after, "faces").unwrap_or(u64::MAX);
    row.left.push(format!("{faces}{}", if report["reached"] == true { "" } else { "*" }));
    // `info` does not count the instances of an extension yet; a run does.
    let given = before.as_ref().and_then(|v| count(v, "faces")).filter(|&n| n > 0);
    let instances = given.and_then(|n| Some(count(&report["input"], "faces")? / n)).unwrap_or(1).max(1);
    if report["output"]["faces"].as_u64() != faces.checked_mul(instances) {
        row.problem(format!("{what}: {faces} faces written, {} reported", report["output"]["faces"]));
    }
    if report["reached"] != true && report["refusals"].as_object().is_none_or(serde_json::Map::is_empty) {
        row.problem(format!("{what}: not reached, and no reason"));
    }
    if count(&after, "non_finite_vertices") != Some(0) {
        row.problem(format!("{what}: vertices that are no numbers"));
    }
    let Some(before) = before else { return Ok(()) };
    if count(before, "faces").is_some_and(|input| faces > input) {
        row.problem(format!("{what}: more faces than before"));
    }
    let clean = before["manifold"] == true
        && ["degenerate_faces", "duplicate_faces", "non_finite_vertices"].iter().all(|k| before[*k] == 0);
    for key in ["non_manifold_edges", "border_edges", "degenerate_faces", "duplicate_faces"] {
        let (was, is) = (count(before, key), count(&after, key));
        match (was, is) {
            (Some(was), Some(is)) if is > was => {
                let text = format!("{what}: {key} {was} -> {is}");
                if clean { row.problem(text) } else { row.remark = text }
            }
            (Some(_), Some(_)) => {}
            _ => row.problem(format!("info does not tell {key}")),
        }
    }
    Ok(())
}

/// Returns the object on standard output.
fn value(outcome: &Outcome) -> Option<Value> {
    serde_json::from_str(outcome.stdout.trim()).ok().filter(Value::is_object)
}

fn one_line(outcome: &Outcome) -> String {
    let line = outcome.stderr.lines().next().unwrap_or("nothing said");
    line.chars().take(160).collect()
}

/// Runs the command and measures its time, and its peak memory if the system reports it.
fn call(command: &Path, args: &[&std::ffi::OsStr], limits: Limits) -> Result<Outcome> {
    // A hanging run is given more time than allowed, so that the table shows by how much it exceeds the
    // limit.
    let patience = Duration::from_secs_f64(limits.seconds * 2.0 + 1.0);
    let (stdout, stderr) = (tempfile::tempfile()?, tempfile::tempfile()?);
    let began = Instant::now();
    let mut child = Command::new(command)
        .args(args)
        .stdin(Stdio::null())
        .stdout(stdout.try_clone()?)
        .stderr(stderr.try_clone()?)
        .spawn()
        .with_context(|| format!("starting {}", command.display()))?;
    let mut peak_kb = 0;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status.code();
        }
        peak_kb = peak_kb.max(resident_peak_kb(child.id()).unwrap_or(0));
        let greedy = peak_kb / 1024 > limits.megabytes * 2;
        if began.elapsed() > patience || greedy {
            child.kill()?;
            child.wait()?;
            break None;
        }
        // Memory grows by a few megabytes at most between two samples.
        std::thread::sleep(Duration::from_millis(1));
    };
    let seconds = began.elapsed().as_secs_f64();
    Ok(Outcome { status, seconds, peak_kb, stdout: text(stdout)?, stderr: text(stderr)? })
}

fn text(mut file: std::fs::File) -> Result<String> {
    use std::io::{Read, Seek};
    file.rewind()?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Returns the peak of resident memory of a running process. Linux only.
fn resident_peak_kb(id: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(status: Option<i32>, stderr: &str) -> Outcome {
        Outcome { status, seconds: 0.1, peak_kb: 1024, stdout: String::new(), stderr: stderr.into() }
    }

    #[test]
    fn a_refusal_is_one_line() {
        for (status, stderr, good) in [
            (Some(0), "", true),
            (Some(1), "error: a.obj: line 3: no\n", true),
            (Some(1), "warning: x\nerror: y\n", false),
            (Some(1), "", false),
            (Some(101), "thread 'main' panicked", false),
            (None, "", false),
        ] {
            let mut row = CorpusRow::default();
            row.note(&outcome(status, stderr), "info", DAMAGED_LIMIT);
            assert_eq!(row.problems.is_empty(), good, "{status:?} {stderr}");
        }
    }

    #[test]
    fn limits_are_held() {
        let mut row = CorpusRow::default();
        row.note(
            &Outcome { seconds: 1.5, peak_kb: 300 << 10, ..outcome(Some(0), "") },
            "info",
            DAMAGED_LIMIT,
        );
        assert_eq!(row.problems.len(), 2, "{:?}", row.problems);
    }

    #[test]
    fn endings_look_through_compression() {
        assert_eq!(ending(Path::new("a/b.PLY.gz")), "ply");
        assert_eq!(ending(Path::new("README.md")), "md");
    }

    #[test]
    fn a_missing_folder_fails() {
        let error = run(&["no such folder".into()]).unwrap_err().to_string();
        assert!(error.contains("no such folder"), "{error}");
        assert!(run(&[]).is_err());
    }
}
