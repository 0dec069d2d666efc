//! Faults: standard streams that close early or are full.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};

use super::job::{FolderContent, RunOutcome, finish, folder_content, put, start};
use super::{FaultResult, FaultRow, FaultSetup, Random};

/// Runs that write a mesh or a picture to standard output.
const MESHES: &[&str] = &[
    "convert IN/finial.ply - --to obj",
    "convert IN/finial.ply - --to stl",
    "clean IN/finial.ply -o - --to ply",
    "simplify IN/finial.ply -o - --to glb --ratio 0.9",
    "lod IN/finial.ply -o - --to glb --levels 0.5",
    "progressive build IN/finial.ply -o -",
    "progressive extract IN/finial.lpm -o - --to ply --faces 9000",
    "render IN/finial.ply -o - --size 640x480",
];

/// Runs that print text.
const TEXTS: &[&str] = &[
    "info IN/finial.ply IN/arm.glb",
    "info --json IN/finial.ply IN/arm.glb",
    "compare IN/finial.ply IN/half.ply --samples 1000",
    "compare IN/finial.ply IN/half.ply --samples 1000 --json",
    "progressive info IN/finial.lpm",
    "simplify IN/finial.ply -o OUT/a.ply --ratio 0.5 --json",
    "methods IN/arm.glb --method quadric --samples 1000 --ratio 0.5",
    "completions bash",
    "man",
    "--help",
    "simplify --help",
    "--version",
];

/// Capacity of a pipe without a reader, in bytes (on Linux).
const PIPE_BYTES: usize = 1 << 16;

fn words(text: &str, ground: &FaultSetup, out: &Path) -> Vec<String> {
    let (inputs, out) = (ground.inputs().display().to_string(), out.display().to_string());
    text.split(' ').map(|word| word.replace("IN/", &format!("{inputs}/")).replace("OUT", &out)).collect()
}

/// Removes warnings and notes from the lines on standard error.
fn errors(ended: RunOutcome) -> RunOutcome {
    let lines: Vec<&str> = ended.stderr.lines().filter(|line| !is_note(line)).collect();
    RunOutcome { stderr: lines.join("\n"), ..ended }
}

fn is_note(line: &str) -> bool {
    ["warning: ", "note: "].iter().any(|head| line.starts_with(head))
}

/// Returns the complete output of a run.
fn whole(ground: &FaultSetup, words: &[String]) -> Result<Vec<u8>> {
    let output = Command::new(&ground.program).args(words).output()?;
    ensure!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(output.stdout)
}

/// Reads this many bytes and closes the pipe.
fn read_only(child: &mut Child, bytes: usize) -> Result<()> {
    let mut pipe = child.stdout.take().context("it has a pipe")?;
    let mut head = vec![0; bytes];
    pipe.read_exact(&mut head)?;
    Ok(())
}

/// The reader of a mesh closes the pipe before its end.
pub(super) fn closed_pipe(ground: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("pipe closed before all of a mesh or picture was read");
    let mut chance = Random(31);
    for text in MESHES {
        let words = words(text, ground, &ground.empty_folder("out")?);
        let length = whole(ground, &words)?.len();
        for round in 0..ground.part_of(20) {
            // The first time immediately.
            let read = if round == 0 { 0 } else { chance.below(length) };
            let quiet = [words.as_slice(), &["--quiet".to_owned()]].concat();
            let mut child = start(&ground.program, &quiet, Stdio::null(), Stdio::piped())?;
            read_only(&mut child, read)?;
            let ended = finish(child)?;
            row.count(&ended);
            // The last part, up to the pipe's capacity, may be written before it closes.
            if ended.status != Some(1) && length - read > PIPE_BYTES {
                row.breach(text, [format!("ended with {:?} after {read} of {length} bytes", ended.status)]);
            }
            row.breach(text, ended.breaches(1));
        }
    }
    Ok(FaultResult::Done(row))
}

/// The reader of a text closes the pipe early, which is not an error.
pub(super) fn closed_pipe_of_text(ground: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("pipe closed before all of a text was read");
    let mut chance = Random(37);
    for text in TEXTS {
        let words = words(text, ground, &ground.empty_folder("out")?);
        let length = whole(ground, &words)?.len();
        for round in 0..ground.part_of(10) {
            let read = if round == 0 { 0 } else { chance.below(length) };
            let mut child = start(&ground.program, &words, Stdio::null(), Stdio::piped())?;
            read_only(&mut child, read)?;
            let ended = errors(finish(child)?);
            row.count(&ended);
            if ended.status != Some(0) {
                row.breach(text, [format!("ended with {:?} after {read} of {length} bytes", ended.status)]);
            }
            row.breach(text, ended.breaches(1));
        }
    }
    Ok(FaultResult::Done(row))
}

/// Standard output is a full device.
pub(super) fn full_device(ground: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "standard output on a full device";
    if File::options().write(true).open("/dev/full").is_err() {
        return Ok(FaultResult::Skipped(FAULT, "there is no /dev/full".into()));
    }
    let mut row = FaultRow::new(FAULT);
    for text in MESHES.iter().chain(TEXTS) {
        let device = File::options().write(true).open("/dev/full")?;
        let words = words(text, ground, &ground.empty_folder("out")?);
        let ended = errors(finish(start(&ground.program, &words, Stdio::null(), device.into())?)?);
        row.count(&ended);
        if ended.status != Some(1) {
            row.breach(text, [format!("ended with {:?}", ended.status)]);
        }
        row.breach(text, ended.breaches(1));
    }
    Ok(FaultResult::Done(row))
}

/// A model on standard input is truncated.
pub(super) fn cut_input(ground: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("standard input cut short");
    let mut chance = Random(41);
    for name in ["finial.ply", "arm.glb"] {
        let bytes = std::fs::read(ground.inputs().join(name))?;
        for text in ["convert - OUT/a.stl", "simplify - -o OUT/a.stl --ratio 0.5", "clean - -o OUT/a.stl"] {
            for _ in 0..ground.part_of(20) {
                let out = ground.empty_folder("out")?;
                let before = FolderContent::from([("a.stl".to_owned(), b"what was there".to_vec())]);
                put(&before, &out)?;
                let mut words = words(text, ground, &out);
                words.push("--quiet".into());
                let mut child = start(&ground.program, &words, Stdio::piped(), Stdio::null())?;
                let mut pipe = child.stdin.take().context("it has a pipe")?;
                // The run may stop reading after an error.
                let _ = pipe.write_all(&bytes[..chance.below(bytes.len())]);
                drop(pipe);
                let ended = finish(child)?;
                row.count(&ended);
                let mut breaches = ended.breaches(1);
                if ended.status != Some(1) || folder_content(&out)? != before {
                    breaches.push(format!("ended with {:?}", ended.status));
                }
                row.breach(text, breaches);
            }
        }
    }
    Ok(FaultResult::Done(row))
}

/// A run fails or warns while nobody reads standard error.
pub(super) fn nobody_reads_errors(ground: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("nobody reads standard error");
    let out = ground.empty_folder("out")?;
    for (text, status) in [
        ("info IN/none.ply", 1),
        ("convert IN/none.ply OUT/a.stl", 1),
        ("convert IN/arm.glb OUT/a.stl", 0),
        ("simplify IN/arm.glb -o OUT/a.ply --ratio 0.5 --verbose", 0),
        ("lod IN/arm.glb -O OUT --levels 0.5 --verbose", 0),
        ("convert IN/finial.ply", 2),
    ] {
        let mut child = start(&ground.program, &words(text, ground, &out), Stdio::null(), Stdio::null())?;
        drop(child.stderr.take());
        let ended = RunOutcome { status: child.wait()?.code(), stderr: String::new() };
        row.count(&ended);
        if ended.status != Some(status) {
            row.breach(text, [format!("ended with {:?}, not {status}", ended.status)]);
        }
    }
    Ok(FaultResult::Done(row))
}
