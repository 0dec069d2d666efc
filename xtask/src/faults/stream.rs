//! Faults: standard streams that close early or are full.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};

use super::job::{FolderContent, RunOutcome, finish, folder_content, put, start};
use super::{FaultResult, FaultRow, FaultSetup, Random};

/// Runs that write a mesh or an image to standard output.
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

fn arguments(text: &str, setup: &FaultSetup, out: &Path) -> Vec<String> {
    let (inputs, out) = (setup.inputs().display().to_string(), out.display().to_string());
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
fn complete_output(setup: &FaultSetup, arguments: &[String]) -> Result<Vec<u8>> {
    let output = Command::new(&setup.program).args(arguments).output()?;
    ensure!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(output.stdout)
}

/// Reads a number of bytes and closes the pipe.
fn read_some(child: &mut Child, bytes: usize) -> Result<()> {
    let mut pipe = child.stdout.take().context("the output is a pipe")?;
    let mut head = vec![0; bytes];
    pipe.read_exact(&mut head)?;
    Ok(())
}

/// The reader of a mesh or image closes the pipe early.
pub(super) fn closed_pipe(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("pipe of a mesh or image closed early");
    let mut random = Random(31);
    for text in MESHES {
        let arguments = arguments(text, setup, &setup.empty_folder("out")?);
        let length = complete_output(setup, &arguments)?.len();
        for round in 0..setup.part_of(20) {
            // The first round closes immediately.
            let read = if round == 0 { 0 } else { random.below(length) };
            let quietly = [arguments.as_slice(), &["--quiet".to_owned()]].concat();
            let mut child = start(&setup.program, &quietly, Stdio::null(), Stdio::piped())?;
            read_some(&mut child, read)?;
            let ended = finish(child)?;
            row.count(&ended);
            // The last bytes, up to the capacity of the pipe, may be written before it closes.
            if ended.status != Some(1) && length - read > PIPE_BYTES {
                row.add_violations(
                    text,
                    [format!("ended with {:?} after {read} of {length} bytes", ended.status)],
                );
            }
            row.add_violations(text, ended.violations(1));
        }
    }
    Ok(FaultResult::Done(row))
}

/// The reader of a text closes the pipe early, which is no error.
pub(super) fn closed_pipe_of_text(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("pipe of a text closed early");
    let mut random = Random(37);
    for text in TEXTS {
        let arguments = arguments(text, setup, &setup.empty_folder("out")?);
        let length = complete_output(setup, &arguments)?.len();
        for round in 0..setup.part_of(10) {
            let read = if round == 0 { 0 } else { random.below(length) };
            let mut child = start(&setup.program, &arguments, Stdio::null(), Stdio::piped())?;
            read_some(&mut child, read)?;
            let ended = errors(finish(child)?);
            row.count(&ended);
            if ended.status != Some(0) {
                row.add_violations(
                    text,
                    [format!("ended with {:?} after {read} of {length} bytes", ended.status)],
                );
            }
            row.add_violations(text, ended.violations(1));
        }
    }
    Ok(FaultResult::Done(row))
}

/// Standard output is `/dev/full`.
pub(super) fn full_device(setup: &FaultSetup) -> Result<FaultResult> {
    const FAULT: &str = "standard output on a full device";
    if File::options().write(true).open("/dev/full").is_err() {
        return Ok(FaultResult::Skipped(FAULT, "there is no /dev/full".into()));
    }
    let mut row = FaultRow::new(FAULT);
    for text in MESHES.iter().chain(TEXTS) {
        let device = File::options().write(true).open("/dev/full")?;
        let arguments = arguments(text, setup, &setup.empty_folder("out")?);
        let ended = errors(finish(start(&setup.program, &arguments, Stdio::null(), device.into())?)?);
        row.count(&ended);
        if ended.status != Some(1) {
            row.add_violations(text, [format!("ended with {:?}", ended.status)]);
        }
        row.add_violations(text, ended.violations(1));
    }
    Ok(FaultResult::Done(row))
}

/// A model on standard input is truncated.
pub(super) fn truncated_input(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("standard input truncated");
    let mut random = Random(41);
    for name in ["finial.ply", "arm.glb"] {
        let bytes = std::fs::read(setup.inputs().join(name))?;
        for text in ["convert - OUT/a.stl", "simplify - -o OUT/a.stl --ratio 0.5", "clean - -o OUT/a.stl"] {
            for _ in 0..setup.part_of(20) {
                let out = setup.empty_folder("out")?;
                let before = FolderContent::from([("a.stl".to_owned(), b"old content".to_vec())]);
                put(&before, &out)?;
                let mut arguments = arguments(text, setup, &out);
                arguments.push("--quiet".into());
                let mut child = start(&setup.program, &arguments, Stdio::piped(), Stdio::null())?;
                let mut pipe = child.stdin.take().context("it has a pipe")?;
                // The run may stop reading after an error.
                let _ = pipe.write_all(&bytes[..random.below(bytes.len())]);
                drop(pipe);
                let ended = finish(child)?;
                row.count(&ended);
                let mut violations = ended.violations(1);
                if ended.status != Some(1) || folder_content(&out)? != before {
                    violations.push(format!("ended with {:?}", ended.status));
                }
                row.add_violations(text, violations);
            }
        }
    }
    Ok(FaultResult::Done(row))
}

/// A run fails or warns after the reader of standard error has gone.
pub(super) fn nobody_reads_errors(setup: &FaultSetup) -> Result<FaultResult> {
    let mut row = FaultRow::new("closed standard error");
    let out = setup.empty_folder("out")?;
    for (text, status) in [
        ("info IN/none.ply", 1),
        ("convert IN/none.ply OUT/a.stl", 1),
        ("convert IN/arm.glb OUT/a.stl", 0),
        ("simplify IN/arm.glb -o OUT/a.ply --ratio 0.5 --verbose", 0),
        ("lod IN/arm.glb -O OUT --levels 0.5 --verbose", 0),
        ("convert IN/finial.ply", 2),
    ] {
        let mut child = start(&setup.program, &arguments(text, setup, &out), Stdio::null(), Stdio::null())?;
        drop(child.stderr.take());
        let ended = RunOutcome { status: child.wait()?.code(), stderr: String::new() };
        row.count(&ended);
        if ended.status != Some(status) {
            row.add_violations(text, [format!("ended with {:?}, not {status}", ended.status)]);
        }
    }
    Ok(FaultResult::Done(row))
}
