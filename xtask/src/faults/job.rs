//! Command runs that write files: their expected outputs, and the checks after a fault.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

use super::FaultSetup;
use crate::sample;

/// Files of a folder by name.
pub(super) type FolderContent = BTreeMap<String, Vec<u8>>;

/// A run of the command that overwrites the outputs of an earlier run.
pub(super) struct Job {
    /// Arguments with placeholders: `IN` is the input folder, `OUT` the output folder, `N` the value that differs
    /// between the runs.
    template: &'static str,
    now: &'static str,
    /// Outputs of the earlier run.
    pub(super) old: FolderContent,
    /// Outputs of the run that overwrites them.
    pub(super) new: FolderContent,
    /// Duration of a run without a fault.
    pub(super) time: Duration,
}

/// Arguments, and the value of `N` in the earlier run and in the run with the fault.
const JOBS: &[(&str, &str, &str)] = &[
    ("simplify IN/finial.ply -o OUT/a.ply --ratio N", "0.5", "0.3"),
    ("simplify IN/finial.ply -o OUT/a.obj --ratio N", "0.5", "0.3"),
    ("simplify IN/arm.glb -o OUT/a.glb --ratio N", "0.5", "0.9"),
    ("simplify IN/finial.ply IN/arm.glb -O OUT --ratio N", "0.5", "0.3"),
    ("convert IN/N.ply OUT/a.stl", "half", "finial"),
    ("convert IN/N.ply OUT/a.obj.gz", "half", "finial"),
    ("convert IN/N.obj OUT/a.obj", "few", "tiles"),
    ("clean IN/N.ply -o OUT/a.ply", "half", "finial"),
    ("lod IN/finial.ply -O OUT --levels N", "0.5,0.2", "0.4,0.1"),
    ("lod IN/arm.glb -o OUT/a.glb --levels N", "0.5", "0.6,0.3"),
    ("progressive build IN/N.ply -o OUT/a.lpm", "half", "finial"),
    ("progressive extract IN/finial.lpm -o OUT/a.ply --faces N", "1000", "9000"),
    ("render IN/finial.ply -o OUT/a.png --size N", "64x64", "160x120"),
    ("compare IN/N.ply IN/arm.glb --samples 1000 --heatmap OUT/a.ply", "half", "finial"),
    ("methods IN/arm.glb -O OUT --method quadric --method cluster --samples 1000 --ratio N", "0.5", "0.3"),
];

impl Job {
    /// Returns the name of the run for messages.
    pub(super) fn name(&self) -> &'static str {
        self.template
    }

    /// Returns the arguments of the run, for these folders.
    pub(super) fn arguments(&self, inputs: &Path, out: &Path) -> Vec<String> {
        arguments(self.template, self.now, inputs, out)
    }

    /// Returns the names of the input files.
    pub(super) fn inputs(&self) -> Vec<String> {
        let files = self.template.split(' ').filter_map(|word| word.strip_prefix("IN/"));
        let mut names: Vec<String> = files.map(|word| filled(word, self.now)).collect();
        if names.iter().any(|name| name.ends_with(".obj")) {
            names.extend(["tiles.mtl".to_owned(), "tiles.png".to_owned()]);
        }
        names
    }

    /// Returns the failed checks after a run.
    ///
    /// `before` is the content of the folder before the run.
    pub(super) fn check(
        &self,
        ended: &RunOutcome,
        before: &FolderContent,
        out: &Path,
    ) -> Result<Vec<String>> {
        let after = folder_content(out)?;
        let mut violations = ended.violations(self.new.len());
        for (name, bytes) in &after {
            if is_temporary_file(name) {
                // A killed run cannot clean up.
                if ended.status.is_some() {
                    violations.push(format!("left {name}"));
                }
            } else if before.get(name) != Some(bytes) && self.new.get(name) != Some(bytes) {
                violations.push(format!("{name} has neither the old nor the complete new content"));
            }
        }
        violations
            .extend(before.keys().filter(|n| !after.contains_key(*n)).map(|name| format!("{name} is gone")));
        match ended.status {
            Some(0) if after != self.new => violations.push("succeeded and did not write everything".into()),
            Some(1) if self.new.len() == 1 && after != *before => {
                violations.push("failed, and changed the output".into());
            }
            _ => {}
        }
        Ok(violations)
    }

    /// Runs again without a fault: returns the failed checks, and the number of temporary files removed.
    pub(super) fn run_again(&self, setup: &FaultSetup, out: &Path) -> Result<(Vec<String>, usize)> {
        let temporary_files = temporary_file_count(out)?;
        let ended = run(&setup.program, &self.arguments(&setup.inputs(), out))?;
        let mut violations = Vec::new();
        if ended.status != Some(0) {
            violations.push(format!("the next run ended with {:?}: {}", ended.status, ended.stderr.trim()));
        } else if folder_content(out)? != self.new {
            let names: Vec<String> = folder_content(out)?.into_keys().collect();
            violations.push(format!("after the next run there are {}", names.join(", ")));
        }
        Ok((violations, temporary_files))
    }
}

/// The outcome of a run of the command.
pub(super) struct RunOutcome {
    /// Exit status; `None` if a signal ended it.
    pub(super) status: Option<i32>,
    pub(super) stderr: String,
}

impl RunOutcome {
    /// Checks general rules: a failing run prints a message, but at most one line per output; no run panics.
    pub(super) fn violations(&self, outputs: usize) -> Vec<String> {
        let mut violations = Vec::new();
        let lines: Vec<&str> = self.stderr.lines().collect();
        let message = || self.stderr.trim().replace('\n', " / ");
        if self.stderr.contains("internal error") || self.stderr.contains("panicked") {
            violations.push(format!("panicked: {}", message()));
        }
        match self.status {
            Some(0) if !lines.is_empty() => violations.push(format!("succeeded and printed: {}", message())),
            Some(1)
                if lines.is_empty()
                    || lines.len() > outputs
                    || lines.iter().any(|l| !l.starts_with("error: ")) =>
            {
                violations.push(format!("failed with {} lines: {}", lines.len(), message()));
            }
            Some(status) if !matches!(status, 0 | 1 | 143) => {
                violations.push(format!("ended with status {status}: {}", message()));
            }
            _ => {}
        }
        violations
    }
}

fn filled(word: &str, value: &str) -> String {
    match word {
        "N" => value.to_owned(),
        word => word.replace("N.", &format!("{value}.")),
    }
}

fn arguments(template: &str, value: &str, inputs: &Path, out: &Path) -> Vec<String> {
    let word = |word: &str| match word.split_once('/') {
        Some(("IN", name)) => inputs.join(filled(name, value)).display().to_string(),
        Some(("OUT", name)) => out.join(name).display().to_string(),
        _ if word == "OUT" => out.display().to_string(),
        _ => filled(word, value),
    };
    template.split(' ').map(word).chain(["--quiet".to_owned()]).collect()
}

/// Starts the command; captures standard error.
pub(super) fn start(program: &Path, arguments: &[String], stdin: Stdio, stdout: Stdio) -> Result<Child> {
    let mut command = Command::new(program);
    command.args(arguments).env_remove("RUST_BACKTRACE").stdin(stdin).stdout(stdout).stderr(Stdio::piped());
    command.spawn().with_context(|| program.display().to_string())
}

pub(super) fn finish(child: Child) -> Result<RunOutcome> {
    let output = child.wait_with_output()?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    Ok(RunOutcome { status: output.status.code(), stderr })
}

/// Runs the command to its end.
pub(super) fn run(program: &Path, arguments: &[String]) -> Result<RunOutcome> {
    finish(start(program, arguments, Stdio::null(), Stdio::null())?)
}

/// Returns all files of a folder.
pub(super) fn folder_content(folder: &Path) -> Result<FolderContent> {
    let mut state = FolderContent::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let entry = entry?;
        state.insert(entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path())?);
    }
    Ok(state)
}

pub(super) fn put(state: &FolderContent, folder: &Path) -> Result<()> {
    for (name, bytes) in state {
        std::fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}

pub(super) fn is_temporary_file(name: &str) -> bool {
    name.starts_with(".lodsmith-") && name.ends_with(".part")
}

/// Counts the temporary files in a folder.
pub(super) fn temporary_file_count(folder: &Path) -> Result<usize> {
    Ok(folder_content(folder)?.keys().filter(|name| is_temporary_file(name)).count())
}

/// Writes the inputs of the runs.
pub(super) fn write_inputs(program: &Path, inputs: &Path) -> Result<()> {
    std::fs::copy(crate::root().join("testdata/arm.glb"), inputs.join("arm.glb"))?;
    std::fs::write(inputs.join("finial.ply"), sample::ply(&sample::finial()))?;
    for (name, tiles) in [("few", 4), ("tiles", 24)] {
        std::fs::write(inputs.join(format!("{name}.obj")), textured(tiles))?;
    }
    std::fs::write(inputs.join("tiles.mtl"), "newmtl tile\nmap_Kd tiles.png\n")?;
    std::fs::write(inputs.join("tiles.png"), picture(192)?)?;
    for template in [
        "simplify IN/finial.ply -o OUT/half.ply --ratio 0.5",
        "progressive build IN/finial.ply -o OUT/finial.lpm",
    ] {
        let ended = run(program, &arguments(template, "", inputs, inputs))?;
        ensure!(ended.status == Some(0), "{template}: {}", ended.stderr.trim());
    }
    Ok(())
}

/// Returns a bent sheet with texture coordinates and a material, as OBJ.
fn textured(tiles: u32) -> String {
    let mut text = String::from("mtllib tiles.mtl\nusemtl tile\n");
    for y in 0..=tiles {
        for x in 0..=tiles {
            let [u, v] = [x, y].map(|i| f64::from(i) / f64::from(tiles));
            let z = 0.1 * (9.0 * u).sin() * (7.0 * v).cos();
            writeln!(text, "v {u:.4} {v:.4} {z:.4}\nvt {u:.4} {v:.4}").expect("text grows");
        }
    }
    for y in 0..tiles {
        for x in 0..tiles {
            let a = y * (tiles + 1) + x + 1;
            let [b, c, d] = [a + 1, a + tiles + 1, a + tiles + 2];
            writeln!(text, "f {a}/{a} {b}/{b} {d}/{d}\nf {a}/{a} {d}/{d} {c}/{c}").expect("text grows");
        }
    }
    text
}

/// Returns an image of noise, which does not compress.
fn picture(side: u32) -> Result<Vec<u8>> {
    let mut random = super::Random(1);
    let pixels: Vec<u8> = (0..side * side).map(|_| random.below(256) as u8).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(bytes)
}

/// Returns all runs, with their outputs without a fault.
pub(super) fn all(program: &Path, inputs: &Path) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for &(template, earlier, now) in JOBS {
        let out = tempfile::tempdir()?;
        let mut written = Vec::new();
        let mut time = Duration::ZERO;
        // The third run checks that the second is deterministic.
        for value in [earlier, now, now] {
            let started = Instant::now();
            let ended = run(program, &arguments(template, value, inputs, out.path()))?;
            ensure!(ended.status == Some(0), "{template}: {:?}: {}", ended.status, ended.stderr.trim());
            time = started.elapsed();
            written.push(folder_content(out.path())?);
        }
        ensure!(written[1] == written[2], "{template}: two runs write different bytes");
        let [old, new, _]: [FolderContent; 3] = written.try_into().expect("there were three runs");
        ensure!(!old.is_empty() && old != new, "{template}: the runs must write different files");
        jobs.push(Job { template, now, old, new, time });
    }
    Ok(jobs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job() -> Job {
        let one = |bytes: &[u8]| FolderContent::from([("a.ply".to_owned(), bytes.to_vec())]);
        let (old, new) = (one(b"old"), one(b"new"));
        Job { template: "clean IN/N.ply -o OUT/a.ply", now: "y", old, new, time: Duration::ZERO }
    }

    fn violations(status: Option<i32>, stderr: &str, after: &[(&str, &str)]) -> Vec<String> {
        let out = tempfile::tempdir().unwrap();
        for (name, bytes) in after {
            std::fs::write(out.path().join(name), bytes).unwrap();
        }
        let job = job();
        job.check(&RunOutcome { status, stderr: stderr.into() }, &job.old, out.path()).unwrap()
    }

    #[test]
    fn folders_are_filled_in() {
        let arguments = job().arguments(Path::new("i"), Path::new("o"));
        let path = |folder: &str, name: &str| Path::new(folder).join(name).display().to_string();
        assert_eq!(arguments, ["clean", &path("i", "y.ply"), "-o", &path("o", "a.ply"), "--quiet"]);
        assert_eq!(job().inputs(), ["y.ply"]);
    }

    #[test]
    fn a_file_other_than_the_old_or_new_one_is_a_violation() {
        let (old, new) = (("a.ply", "old"), ("a.ply", "new"));
        let part = (".lodsmith-x.part", "ha");
        assert!(violations(Some(0), "", &[new]).is_empty());
        assert!(violations(Some(1), "error: no\n", &[old]).is_empty());
        assert!(violations(None, "", &[old, part]).is_empty() && violations(None, "", &[new]).is_empty());
        for (status, stderr, after) in [
            (Some(0), "", &[old][..]),
            (Some(0), "warning: x\n", &[new]),
            (Some(0), "", &[]),
            (Some(0), "", &[new, part]),
            (Some(0), "", &[new, ("b.ply", "b")]),
            (Some(1), "", &[old]),
            (Some(1), "error: a\nerror: b\n", &[old]),
            (Some(1), "error: internal error, please report it: x\n", &[old]),
            (Some(1), "error: a\n", &[new]),
            (Some(101), "", &[old]),
            (None, "", &[("a.ply", "ol")]),
            (None, "", &[]),
        ] {
            assert!(!violations(status, stderr, after).is_empty(), "{status:?} {stderr} {after:?}");
        }
    }
}
