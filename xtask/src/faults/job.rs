//! Runs of the command that write files: their expected outputs, and the checks after a fault.

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
    /// Arguments with `IN` for the input folder, `OUT` for the output folder, `N` for the value that differs
    /// between the runs.
    words: &'static str,
    now: &'static str,
    /// Outputs of the earlier run, and of the run that overwrites them.
    pub(super) old: FolderContent,
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
    /// Returns its name for messages.
    pub(super) fn name(&self) -> &'static str {
        self.words
    }

    /// Returns the arguments of the run, for these folders.
    pub(super) fn arguments(&self, inputs: &Path, out: &Path) -> Vec<String> {
        arguments(self.words, self.now, inputs, out)
    }

    /// Returns the names of the input files.
    pub(super) fn inputs(&self) -> Vec<String> {
        let words = self.words.split(' ').filter_map(|word| word.strip_prefix("IN/"));
        let mut names: Vec<String> = words.map(|word| filled(word, self.now)).collect();
        if names.iter().any(|name| name.ends_with(".obj")) {
            names.extend(["tiles.mtl".to_owned(), "tiles.png".to_owned()]);
        }
        names
    }

    /// Returns the failed checks after a run.
    ///
    /// `before` is the content of the folder before it.
    pub(super) fn check(
        &self,
        ended: &RunOutcome,
        before: &FolderContent,
        out: &Path,
    ) -> Result<Vec<String>> {
        let after = folder_content(out)?;
        let mut breaches = ended.breaches(self.new.len());
        for (name, bytes) in &after {
            if is_part(name) {
                // A killed run cannot clean up.
                if ended.status.is_some() {
                    breaches.push(format!("left {name}"));
                }
            } else if before.get(name) != Some(bytes) && self.new.get(name) != Some(bytes) {
                breaches.push(format!("{name} is neither as it was nor whole"));
            }
        }
        breaches
            .extend(before.keys().filter(|n| !after.contains_key(*n)).map(|name| format!("{name} is gone")));
        match ended.status {
            Some(0) if after != self.new => breaches.push("ended well and did not write everything".into()),
            Some(1) if self.new.len() == 1 && after != *before => {
                breaches.push("failed, and changed the output".into());
            }
            _ => {}
        }
        Ok(breaches)
    }

    /// Runs again without a fault: returns the failed checks, and the number of temporary files removed.
    pub(super) fn run_again(&self, ground: &FaultSetup, out: &Path) -> Result<(Vec<String>, usize)> {
        let parts = parts(out)?;
        let ended = run(&ground.program, &self.arguments(&ground.inputs(), out))?;
        let mut breaches = Vec::new();
        if ended.status != Some(0) {
            breaches.push(format!("the next run ended with {:?}: {}", ended.status, ended.stderr.trim()));
        } else if folder_content(out)? != self.new {
            let names: Vec<String> = folder_content(out)?.into_keys().collect();
            breaches.push(format!("after the next run there are {}", names.join(", ")));
        }
        Ok((breaches, parts))
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
    pub(super) fn breaches(&self, outputs: usize) -> Vec<String> {
        let mut breaches = Vec::new();
        let lines: Vec<&str> = self.stderr.lines().collect();
        let told = || self.stderr.trim().replace('\n', " / ");
        if self.stderr.contains("a fault of this program") || self.stderr.contains("panicked") {
            breaches.push(format!("panicked: {}", told()));
        }
        match self.status {
            Some(0) if !lines.is_empty() => breaches.push(format!("ended well and said: {}", told())),
            Some(1)
                if lines.is_empty()
                    || lines.len() > outputs
                    || lines.iter().any(|l| !l.starts_with("error: ")) =>
            {
                breaches.push(format!("failed with {} lines: {}", lines.len(), told()));
            }
            Some(status) if !matches!(status, 0 | 1 | 143) => {
                breaches.push(format!("ended with status {status}: {}", told()));
            }
            _ => {}
        }
        breaches
    }
}

fn filled(word: &str, amount: &str) -> String {
    match word {
        "N" => amount.to_owned(),
        word => word.replace("N.", &format!("{amount}.")),
    }
}

fn arguments(words: &str, amount: &str, inputs: &Path, out: &Path) -> Vec<String> {
    let word = |word: &str| match word.split_once('/') {
        Some(("IN", name)) => inputs.join(filled(name, amount)).display().to_string(),
        Some(("OUT", name)) => out.join(name).display().to_string(),
        _ if word == "OUT" => out.display().to_string(),
        _ => filled(word, amount),
    };
    words.split(' ').map(word).chain(["--quiet".to_owned()]).collect()
}

/// Starts the command; captures standard error.
pub(super) fn start(program: &Path, words: &[String], stdin: Stdio, stdout: Stdio) -> Result<Child> {
    let mut command = Command::new(program);
    command.args(words).env_remove("RUST_BACKTRACE").stdin(stdin).stdout(stdout).stderr(Stdio::piped());
    command.spawn().with_context(|| program.display().to_string())
}

pub(super) fn finish(child: Child) -> Result<RunOutcome> {
    let output = child.wait_with_output()?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    Ok(RunOutcome { status: output.status.code(), stderr })
}

/// Runs the command to its end.
pub(super) fn run(program: &Path, words: &[String]) -> Result<RunOutcome> {
    finish(start(program, words, Stdio::null(), Stdio::null())?)
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

pub(super) fn is_part(name: &str) -> bool {
    name.starts_with(".lodsmith-") && name.ends_with(".part")
}

/// Counts the temporary files in a folder.
pub(super) fn parts(folder: &Path) -> Result<usize> {
    Ok(folder_content(folder)?.keys().filter(|name| is_part(name)).count())
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
    for words in [
        "simplify IN/finial.ply -o OUT/half.ply --ratio 0.5",
        "progressive build IN/finial.ply -o OUT/finial.lpm",
    ] {
        let ended = run(program, &arguments(words, "", inputs, inputs))?;
        ensure!(ended.status == Some(0), "{words}: {}", ended.stderr.trim());
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
    let mut chance = super::Random(1);
    let pixels: Vec<u8> = (0..side * side).map(|_| chance.below(256) as u8).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(bytes)
}

/// Returns all runs, with their outputs without a fault.
pub(super) fn all(program: &Path, inputs: &Path) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for &(words, earlier, now) in JOBS {
        let out = tempfile::tempdir()?;
        let mut written = Vec::new();
        let mut time = Duration::ZERO;
        // The third run checks that the second is deterministic.
        for amount in [earlier, now, now] {
            let began = Instant::now();
            let ended = run(program, &arguments(words, amount, inputs, out.path()))?;
            ensure!(ended.status == Some(0), "{words}: {:?}: {}", ended.status, ended.stderr.trim());
            time = began.elapsed();
            written.push(folder_content(out.path())?);
        }
        ensure!(written[1] == written[2], "{words}: two runs write different bytes");
        let [old, new, _]: [FolderContent; 3] = written.try_into().expect("there were three runs");
        ensure!(!old.is_empty() && old != new, "{words}: the runs are to write different files");
        jobs.push(Job { words, now, old, new, time });
    }
    Ok(jobs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job() -> Job {
        let one = |bytes: &[u8]| FolderContent::from([("a.ply".to_owned(), bytes.to_vec())]);
        let (old, new) = (one(b"old"), one(b"new"));
        Job { words: "clean IN/N.ply -o OUT/a.ply", now: "y", old, new, time: Duration::ZERO }
    }

    fn judged(status: Option<i32>, stderr: &str, after: &[(&str, &str)]) -> Vec<String> {
        let out = tempfile::tempdir().unwrap();
        for (name, bytes) in after {
            std::fs::write(out.path().join(name), bytes).unwrap();
        }
        let job = job();
        job.check(&RunOutcome { status, stderr: stderr.into() }, &job.old, out.path()).unwrap()
    }

    #[test]
    fn words_name_the_folders() {
        let words = job().arguments(Path::new("i"), Path::new("o"));
        let path = |folder: &str, name: &str| Path::new(folder).join(name).display().to_string();
        assert_eq!(words, ["clean", &path("i", "y.ply"), "-o", &path("o", "a.ply"), "--quiet"]);
        assert_eq!(job().inputs(), ["y.ply"]);
    }

    #[test]
    fn what_may_be_found_is_old_or_new() {
        let (old, new) = (("a.ply", "old"), ("a.ply", "new"));
        let part = (".lodsmith-x.part", "ha");
        assert!(judged(Some(0), "", &[new]).is_empty());
        assert!(judged(Some(1), "error: no\n", &[old]).is_empty());
        assert!(judged(None, "", &[old, part]).is_empty() && judged(None, "", &[new]).is_empty());
        for (status, stderr, after) in [
            (Some(0), "", &[old][..]),
            (Some(0), "warning: x\n", &[new]),
            (Some(0), "", &[]),
            (Some(0), "", &[new, part]),
            (Some(0), "", &[new, ("b.ply", "b")]),
            (Some(1), "", &[old]),
            (Some(1), "error: a\nerror: b\n", &[old]),
            (Some(1), "error: a fault of this program, please report it: x\n", &[old]),
            (Some(1), "error: a\n", &[new]),
            (Some(101), "", &[old]),
            (None, "", &[("a.ply", "ol")]),
            (None, "", &[]),
        ] {
            assert!(!judged(status, stderr, after).is_empty(), "{status:?} {stderr} {after:?}");
        }
    }
}
