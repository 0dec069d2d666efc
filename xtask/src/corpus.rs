//! Runs every model of some folders through the release command: reads it, simplifies it to 50, 25, 10 and
//! 1 %, and reads the results again.
//!
//! The checks depend on the folder of a file:
//! * anywhere: no crash, no hang, no more memory than the limit, at most the requested triangles if the report says
//!   `reached`, and a readable result; the bounding box of `info` and the diagonal of the report agree with the
//!   rendered image; a model closed by its indices stays closed; two-sided sheets lose no more area than without
//!   their back sides; and reported errors are about as large as measured ones, see [`errors`];
//! * clean manifold input: no more non-manifold or border edges, degenerate or duplicate faces than in the
//!   input;
//! * `dirty/` and `broken/`: success, or exit status 1 with one line of error, each in under a second and 200
//!   MB; [`EXPECTED_OUTCOMES`] lists the expected outcome if there is only one;
//! * unsupported formats: refused.
//!
//! With `--methods`, runs every method instead, see [`methods`].

mod consistency;
mod errors;
mod methods;
mod references;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::{release_command, shared_models};
use consistency::Sheets;
use errors::PrintedErrors;

/// The expected outcome for a damaged file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ExpectedOutcome {
    /// Success.
    Done,
    /// An error message that contains all of these words.
    Refused(&'static [&'static str]),
    /// Either.
    Either,
}

/// Damaged files, by name, with a fixed outcome; all others must succeed.
const EXPECTED_OUTCOMES: &[(&str, ExpectedOutcome)] = &[
    ("all_degenerate.off", ExpectedOutcome::Either),
    ("badeffect.dae", ExpectedOutcome::Either),
    ("badgeom.dae", ExpectedOutcome::Either),
    ("badtarget_bind.dae", ExpectedOutcome::Either),
    ("bad_magic.glb", ExpectedOutcome::Refused(&[])),
    ("count_too_large.stl", ExpectedOutcome::Refused(&[])),
    ("inf_vertices.ply", ExpectedOutcome::Either),
    ("dae_nsdeep_1500.dae", ExpectedOutcome::Refused(&["0 faces"])),
    ("end_loop.stl", ExpectedOutcome::Either),
    ("index_zero.obj", ExpectedOutcome::Refused(&["line"])),
    ("latin1.dae", ExpectedOutcome::Either),
    ("nan_vertex.obj", ExpectedOutcome::Either),
    ("near_duplicate_vertices.obj", ExpectedOutcome::Either),
    ("normal_nan_ind.stl", ExpectedOutcome::Either),
    ("no_faces.ply", ExpectedOutcome::Refused(&[])),
    ("only_comments.obj", ExpectedOutcome::Refused(&[])),
    ("q_nul.glb", ExpectedOutcome::Either),
    ("text_not_a_mesh.obj", ExpectedOutcome::Refused(&[])),
    ("trimesh_cubevt.obj", ExpectedOutcome::Either),
    ("truncated.glb", ExpectedOutcome::Refused(&[])),
    ("truncated.ply", ExpectedOutcome::Refused(&[])),
    ("truncated.stl", ExpectedOutcome::Refused(&[])),
    ("unused_and_bad_index.obj", ExpectedOutcome::Refused(&["line", "99"])),
    ("vt_oob.obj", ExpectedOutcome::Either),
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
/// (FBX is an optional feature.)
const REFUSED_EXTENSIONS: &[&str] = &["fbx"];
/// Fractions of the triangles to keep.
const RATIOS: [f64; 4] = [0.5, 0.25, 0.1, 0.01];
/// Lowest ratio at which errors are measured and the area of sheets is checked: below, a model may have any shape.
const MIN_MEASURED_RATIO: f64 = 0.1;
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
    let (mut folders, mut limit, mut only) = (Vec::<PathBuf>::new(), 60.0, String::new());
    let (mut runs_methods, mut largest) = (false, methods::DEFAULT_MAX_FACES);
    let mut rest = args.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--limit" => limit = rest.next().context("--limit needs seconds")?.parse()?,
            "--only" => only.clone_from(rest.next().context("--only needs a text")?),
            "--methods" => runs_methods = true,
            "--largest" => largest = methods::count(rest.next())?,
            path if !path.starts_with('-') => folders.push(path.into()),
            other => bail!("unknown argument {other}"),
        }
    }
    if folders.is_empty() {
        let models = shared_models().context("which folders? cargo xtask corpus DIR...")?;
        folders = vec![models.clone(), models.with_file_name("found")];
    }
    for folder in &folders {
        ensure!(folder.is_dir(), "{} is not a folder", folder.display());
    }
    let command = release_command()?;
    let limits = Limits { seconds: limit, megabytes: 4000 };
    let mut corpus = Corpus { command, limits, largest, errors: PrintedErrors::default() };
    let (mut count, mut failed) = (0, 0);
    for folder in folders {
        let mut files = Vec::new();
        collect(&folder, &mut files)?;
        files.retain(|p| p.to_string_lossy().contains(&only));
        ensure!(!files.is_empty(), "{} has no model", folder.display());
        if runs_methods {
            let command = corpus.command.clone();
            methods::Sweep { command, folder, files, limits, largest }.run()?;
            continue;
        }
        println!(
            "| file | faces | 50 % | 25 % | 10 % | 1 % | s | peak MB | |\n|---|--:|--:|--:|--:|--:|--:|--:|---|"
        );
        count += files.len();
        for file in &files {
            let name = file.strip_prefix(&folder).unwrap_or(file).to_string_lossy().replace('\\', "/");
            let mut row = CorpusRow { name, ..CorpusRow::default() };
            corpus.check(file, &mut row)?;
            failed += usize::from(!row.problems.is_empty());
            row.print();
        }
    }
    if runs_methods {
        return Ok(());
    }
    println!("\n{count} files, {failed} with problems");
    let errors = corpus.errors.conclude();
    ensure!(failed == 0, "{failed} of {count} files have problems");
    errors
}

impl CorpusRow {
    fn print(&self) {
        let left = |k: usize| self.left.get(k).map_or("-", String::as_str);
        let verdict = match self.problems.as_slice() {
            [] => self.remark.clone(),
            problems => format!("**FAILS**: {}", problems.join("; ")),
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {:.2} | {} | {} |",
            self.name,
            self.faces.map_or("-".into(), |n| n.to_string()),
            left(0),
            left(1),
            left(2),
            left(3),
            self.seconds,
            self.peak_kb / 1024,
            verdict.replace('|', "\\|").replace('\n', " "),
        );
    }

    fn problem(&mut self, text: impl Into<String>) {
        self.problems.push(text.into());
    }
}

fn extension(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').map_or(String::new(), |(_, extension)| extension.to_owned())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    entries.sort();
    for path in entries {
        if path.is_dir() {
            collect(&path, files)?;
        } else if SUPPORTED_EXTENSIONS.contains(&&*extension(&path))
            || REFUSED_EXTENSIONS.contains(&&*extension(&path))
        {
            files.push(path);
        }
    }
    Ok(())
}

/// A run over all models.
struct Corpus {
    command: PathBuf,
    limits: Limits,
    /// The errors of models with more triangles are not measured.
    largest: u64,
    errors: PrintedErrors,
}

/// A model of the corpus, and its figures before simplification.
struct CheckedModel<'a> {
    info: &'a Value,
    drawn_diagonal: Option<f64>,
    sheets: Option<Sheets>,
    /// False if the output format splits vertices that the input format does not.
    is_kept_by_index: bool,
    limits: Limits,
}

impl Corpus {
    fn check(&mut self, file: &Path, row: &mut CorpusRow) -> Result<()> {
        let folder = row.name.split('/').next().unwrap_or_default();
        let file_name = file.file_name().unwrap_or_default().to_string_lossy();
        let damaged = matches!(folder, "dirty" | "broken");
        let expected = if REFUSED_EXTENSIONS.contains(&&*extension(file)) {
            ExpectedOutcome::Refused(&[])
        } else if row.name.contains("/compressed/") {
            // A glTF extension that needs a decoder: either decoded, or refused by name.
            ExpectedOutcome::Either
        } else {
            let listed = EXPECTED_OUTCOMES.iter().find(|(name, _)| *name == file_name);
            listed.map_or(ExpectedOutcome::Done, |&(_, expected)| expected)
        };
        let limits = if damaged { DAMAGED_LIMIT } else { self.limits };

        let info = call(&self.command, &["info".as_ref(), file.as_os_str(), "--json".as_ref()], limits)?;
        row.note(&info, "info", limits);
        let before = value(&info);
        match (&before, info.status) {
            (Some(before), Some(0)) => row.faces = before["faces"].as_u64(),
            (None, Some(0)) => row.problem("info: no JSON"),
            _ if expected == ExpectedOutcome::Done => row.problem(format!("info: {}", one_line(&info))),
            _ => {}
        }

        let out_folder = tempfile::tempdir()?;
        // The format of the input if it is a single file; COLLADA can only be read.
        let extension = match &*extension(file) {
            "gltf" | "dae" => "glb".to_owned(),
            known if SUPPORTED_EXTENSIONS.contains(&known) => known.to_owned(),
            _ => "ply".to_owned(),
        };
        // COLLADA has one index for each attribute. PLY files may have texture coordinates per corner, which are
        // written per vertex.
        let has_uvs =
            |info: &Value| info["attributes"].as_array().is_some_and(|all| all.contains(&"uvs".into()));
        let is_kept_by_index = |info: &Value| match info["format"].as_str() {
            Some("dae") => false,
            Some("ply") => !has_uvs(info),
            _ => true,
        };
        let model = match before.as_ref().filter(|info| info["faces"].as_u64().is_some_and(|n| n > 0)) {
            Some(info) if !damaged => {
                let drawn_diagonal = consistency::drawn_diagonal(&self.command, file, info, limits, row)?;
                let single = out_folder.path().join(format!("single.{extension}"));
                let sheets = Sheets::of(&self.command, file, info, single, limits, row)?;
                Some(CheckedModel {
                    info,
                    drawn_diagonal,
                    sheets,
                    is_kept_by_index: is_kept_by_index(info),
                    limits,
                })
            }
            info => info.map(|info| {
                let is_kept_by_index = is_kept_by_index(info);
                CheckedModel { info, drawn_diagonal: None, sheets: None, is_kept_by_index, limits }
            }),
        };
        let is_measured = !damaged && row.faces.is_some_and(|n| n <= self.largest);
        for ratio in RATIOS {
            let out = out_folder.path().join(format!("out {ratio}.{extension}"));
            let text = ratio.to_string();
            let mut args = vec!["simplify".as_ref(), file.as_os_str(), "--ratio".as_ref(), text.as_ref()];
            args.extend(["-o".as_ref(), out.as_os_str(), "--json".as_ref()]);
            if is_measured && ratio >= MIN_MEASURED_RATIO {
                args.push("--measure".as_ref());
            }
            let outcome = call(&self.command, &args, limits)?;
            let what = format!("to {ratio}");
            row.note(&outcome, &what, limits);
            match (outcome.status, expected) {
                (Some(0), ExpectedOutcome::Refused(_)) => {
                    row.problem(format!("{what}: done, but should be refused"));
                }
                (Some(0), _) => self.result(model.as_ref(), &outcome, (&out, ratio), row)?,
                (Some(1), ExpectedOutcome::Done) => row.problem(format!("{what}: {}", one_line(&outcome))),
                (Some(1), ExpectedOutcome::Refused(words)) => {
                    for word in words.iter().filter(|w| !outcome.stderr.contains(**w)) {
                        row.problem(format!("the error does not contain \"{word}\": {}", one_line(&outcome)));
                    }
                    row.remark = one_line(&outcome);
                }
                (Some(1), ExpectedOutcome::Either) => row.remark = one_line(&outcome),
                // `note` has recorded other exit statuses.
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
        row.problems.extend(references::problems(file, out_folder.path())?);
        row.problems.dedup();
        Ok(())
    }
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

impl Corpus {
    /// Checks the output of a successful run.
    fn result(
        &mut self,
        model: Option<&CheckedModel<'_>>,
        outcome: &Outcome,
        (out, ratio): (&Path, f64),
        row: &mut CorpusRow,
    ) -> Result<()> {
        let what = format!("to {ratio}");
        let Some(report) = value(outcome) else {
            row.problem(format!("{what}: no JSON"));
            return Ok(());
        };
        let limits = model.map_or(self.limits, |model| model.limits);
        let info = call(&self.command, &["info".as_ref(), out.as_os_str(), "--json".as_ref()], limits)?;
        let Some(after) = value(&info).filter(|_| info.status == Some(0)) else {
            row.problem(format!("{what}: the result does not read back: {}", one_line(&info)));
            return Ok(());
        };
        let count = |v: &Value, key: &str| v[key].as_u64();
        let faces = count(&after, "faces").unwrap_or(u64::MAX);
        row.left.push(format!("{faces}{}", if report["reached"] == true { "" } else { "*" }));
        if report["output"]["faces"].as_u64() != Some(faces) {
            row.problem(format!("{what}: {faces} faces written, {} reported", report["output"]["faces"]));
        }
        if report["reached"] != true && report["refusals"].as_object().is_none_or(serde_json::Map::is_empty) {
            row.problem(format!("{what}: not reached, and no reason"));
        }
        if count(&after, "non_finite_vertices") != Some(0) {
            row.problem(format!("{what}: vertices with non-finite coordinates"));
        }
        if let Some(problem) = self.errors.add(&format!("{} {what}", row.name), &report) {
            row.problem(format!("{what}: {problem}"));
        }
        let Some(CheckedModel { info: before, drawn_diagonal, sheets, is_kept_by_index, .. }) = model else {
            return Ok(());
        };
        if count(before, "faces").is_some_and(|input| faces > input) {
            row.problem(format!("{what}: more faces than before"));
        }
        if let Some(drawn) = drawn_diagonal {
            consistency::check_diagonal(*drawn, &report, &what, row);
        }
        if let Some(sheets) = sheets.as_ref().filter(|_| ratio >= MIN_MEASURED_RATIO) {
            sheets.check(&self.command, (ratio, &after), limits, row)?;
        }
        if is_closed(before) && after["closed_by_index"] == false && faces > 0 {
            let text = format!("{what}: no longer closed by its indices");
            if *is_kept_by_index { row.problem(text) } else { row.remark = text }
        }
        compare_defects(before, &after, &what, row);
        Ok(())
    }
}

/// Returns whether a model is closed by its indices; edges of four faces do not count as closed.
fn is_closed(info: &Value) -> bool {
    info["closed_by_index"] == true && info["manifold"] == true && info["non_finite_vertices"] == 0
}

/// Checks that a result of a clean model has no new defects.
fn compare_defects(before: &Value, after: &Value, what: &str, row: &mut CorpusRow) {
    let clean = before["manifold"] == true
        && ["degenerate_faces", "duplicate_faces", "non_finite_vertices"].iter().all(|k| before[*k] == 0);
    for key in ["non_manifold_edges", "border_edges", "degenerate_faces", "duplicate_faces"] {
        match (before[key].as_u64(), after[key].as_u64()) {
            (Some(was), Some(is)) if is > was => {
                let text = format!("{what}: {key} {was} -> {is}");
                if clean { row.problem(text) } else { row.remark = text }
            }
            (Some(_), Some(_)) => {}
            _ => row.problem(format!("info has no {key}")),
        }
    }
}

/// Returns the object on standard output.
fn value(outcome: &Outcome) -> Option<Value> {
    serde_json::from_str(outcome.stdout.trim()).ok().filter(Value::is_object)
}

fn one_line(outcome: &Outcome) -> String {
    let line = outcome.stderr.lines().next().unwrap_or("no message");
    line.chars().take(160).collect()
}

/// Runs the command and measures its time, and its peak memory if the system reports it.
fn call(command: &Path, args: &[&std::ffi::OsStr], limits: Limits) -> Result<Outcome> {
    // A slow run may exceed the limit before it is killed, so that the table shows by how much.
    let kill_after = Duration::from_secs_f64(limits.seconds * 2.0 + 1.0);
    let (stdout, stderr) = (tempfile::tempfile()?, tempfile::tempfile()?);
    let started = Instant::now();
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
        let exceeds_memory = peak_kb / 1024 > limits.megabytes * 2;
        if started.elapsed() > kill_after || exceeds_memory {
            child.kill()?;
            child.wait()?;
            break None;
        }
        // Memory grows by a few megabytes at most between two samples.
        std::thread::sleep(Duration::from_millis(1));
    };
    let seconds = started.elapsed().as_secs_f64();
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
        assert_eq!(extension(Path::new("a/b.PLY.gz")), "ply");
        assert_eq!(extension(Path::new("README.md")), "md");
    }

    #[test]
    fn a_missing_folder_fails() {
        let error = run(&["no such folder".into()]).unwrap_err().to_string();
        assert!(error.contains("no such folder"), "{error}");
    }
}
