//! Test fixture: a temporary folder to run the command in, the outcome of a run, and small files.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// Outcome of a run.
pub(crate) struct RunOutcome {
    pub(crate) status: i32,
    pub(crate) stdout: Vec<u8>,
    pub(crate) stderr: String,
}

impl RunOutcome {
    fn of(output: std::process::Output) -> Self {
        Self {
            status: output.status.code().expect("it ends by itself"),
            stdout: output.stdout,
            stderr: String::from_utf8(output.stderr).expect("errors are text"),
        }
    }
    pub(crate) fn text(&self) -> &str {
        std::str::from_utf8(&self.stdout).expect("standard output is text")
    }
    pub(crate) fn objects(&self) -> Vec<Value> {
        self.text().lines().map(|line| serde_json::from_str(line).expect("each line is JSON")).collect()
    }
    #[track_caller]
    pub(crate) fn with_status(self, status: i32) -> Self {
        assert_eq!(self.status, status, "stdout: {}\nstderr: {}", self.stdout.escape_ascii(), self.stderr);
        self
    }
    /// Checks that there is one line of error, without internals of the program.
    #[track_caller]
    pub(crate) fn with_one_error(self) -> Self {
        assert_eq!(self.stderr.lines().count(), 1, "{}", self.stderr);
        assert!(self.stderr.starts_with("error: "), "{}", self.stderr);
        assert!(!self.stderr.contains("panicked") && !self.stderr.contains("backtrace"), "{}", self.stderr);
        self
    }
}

/// A temporary folder to run the command in.
pub(crate) struct CliSandbox {
    pub(crate) folder: TempDir,
}

impl CliSandbox {
    pub(crate) fn new() -> Self {
        Self { folder: TempDir::new().expect("the folder can be created") }
    }
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    pub(crate) fn put(&self, name: &str, content: &str) {
        fs::write(self.path(name), content).expect("the file can be written");
    }
    pub(crate) fn run(&self, arguments: &str) -> RunOutcome {
        self.run_with(arguments, Vec::new())
    }
    pub(crate) fn run_with(&self, arguments: &str, stdin: impl Into<Vec<u8>>) -> RunOutcome {
        let command = Command::cargo_bin("lodsmith")
            .expect("the command is built")
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path())
            .env_remove("RUST_BACKTRACE")
            .write_stdin(stdin)
            .output();
        RunOutcome::of(command.expect("it runs"))
    }
    /// Starts the command and leaves it running. Standard input stays open until it is taken and dropped.
    pub(crate) fn start(&self, arguments: &str) -> std::process::Child {
        self.start_into(arguments, std::process::Stdio::piped())
    }
    fn start_into(&self, arguments: &str, stdout: std::process::Stdio) -> std::process::Child {
        use std::process::Stdio;
        std::process::Command::new(assert_cmd::cargo::cargo_bin("lodsmith"))
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path())
            .env_remove("RUST_BACKTRACE")
            .stdin(Stdio::piped())
            .stdout(stdout)
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs")
    }
    /// Runs the command with a standard output that is closed at the other end.
    pub(crate) fn run_without_reader(&self, arguments: &str) -> std::process::Output {
        let mut child = self.start(arguments);
        drop(child.stdout.take());
        child.wait_with_output().expect("it ends")
    }
    /// Runs the command with a standard output that accepts nothing, like a full disk.
    #[cfg(target_os = "linux")]
    pub(crate) fn run_into_full_device(&self, arguments: &str) -> RunOutcome {
        let device = fs::File::options().write(true).open("/dev/full").expect("Linux has it");
        RunOutcome::of(self.start_into(arguments, device.into()).wait_with_output().expect("it ends"))
    }
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect("the folder is there");
        let mut names: Vec<String> = entries
            .map(|e| e.expect("it can be listed").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
    pub(crate) fn info(&self, name: &str) -> Value {
        self.run(&format!("info --json {name}")).with_status(0).objects().remove(0)
    }
    pub(crate) fn faces(&self, name: &str) -> u64 {
        self.info(name)["faces"].as_u64().expect("a count")
    }
}

/// A hilly square of `2 n²` triangles as text PLY.
pub(crate) fn hills(n: usize) -> String {
    let mut vertices = String::new();
    let mut faces = String::new();
    for y in 0..=n {
        for x in 0..=n {
            let (u, v) = (x as f64 / n as f64, y as f64 / n as f64);
            writeln!(vertices, "{u} {v} {}", 0.1 * (9.0 * u).sin() * (7.0 * v).cos()).expect("text");
        }
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            writeln!(faces, "3 {a} {b} {d}\n3 {a} {d} {c}").expect("text");
        }
    }
    ply("", (n + 1) * (n + 1), 2 * n * n, &vertices, &faces)
}

/// A cube of twelve triangles with a colour at each corner.
pub(crate) fn coloured_cube() -> String {
    let mut vertices = String::new();
    for i in 0..8u32 {
        let [x, y, z] = [i & 1, i >> 1 & 1, i >> 2];
        writeln!(vertices, "{x} {y} {z} {} {} {}", 255 * x, 255 * y, 255 * z).expect("text");
    }
    let faces = "3 0 2 3\n3 0 3 1\n3 4 5 7\n3 4 7 6\n3 0 1 5\n3 0 5 4\n3 2 6 7\n3 2 7 3\n3 0 4 6\n3 0 6 2\n3 1 3 7\n3 1 7 5\n";
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    ply(colours, 8, 12, &vertices, faces)
}

pub(crate) fn ply(more: &str, vertex_count: usize, face_count: usize, vertices: &str, faces: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertex_count}\nproperty double x\nproperty double y\n\
         property double z\n{more}element face {face_count}\nproperty list uchar int vertex_indices\n\
         end_header\n{vertices}{faces}"
    )
}

pub(crate) fn keys(object: &Value) -> Vec<&str> {
    object.as_object().expect("an object").keys().map(String::as_str).collect()
}
