//! All printing: results on standard output, warnings and errors on standard error.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "this is the one file that prints")]

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::io::{self, ErrorKind, IsTerminal, Write};

use anyhow::Context as _;
use serde_json::Value;

use crate::args::Loudness;
use crate::status::{Status, status_of};

/// Destination and level of a command's output.
pub(crate) struct Output {
    json: bool,
    quiet: bool,
    verbose: bool,
    /// True if a mesh is written to standard output, so that text goes to standard error.
    stdout_taken: bool,
    closed: Cell<bool>,
    fault: RefCell<Option<io::Error>>,
}

impl Output {
    pub(crate) fn new(loudness: Loudness, json: bool, stdout_taken: bool) -> Self {
        Self {
            json,
            quiet: loudness.quiet,
            verbose: loudness.verbose,
            stdout_taken,
            closed: Cell::new(false),
            fault: RefCell::new(None),
        }
    }

    /// Returns an output for manual pages and scripts: only results are printed.
    pub(crate) fn plain() -> Self {
        Self {
            json: false,
            quiet: true,
            verbose: false,
            stdout_taken: false,
            closed: Cell::new(false),
            fault: RefCell::new(None),
        }
    }

    /// Prints a result as text; nothing with `--json` or `--quiet`.
    pub(crate) fn line(&self, text: &str) {
        if self.json || self.quiet {
            return;
        }
        let text = escaped(text);
        if self.stdout_taken { eprint_line(&text) } else { self.print(&text) }
    }

    /// Prints details, with `-v` only.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose {
            self.line(text);
        }
    }

    /// Prints a result that `--quiet` does not silence: JSON, a script, a manual page.
    pub(crate) fn result(&self, text: &str) {
        self.print(text);
    }

    /// Prints a result as one line of JSON; nothing without `--json`.
    pub(crate) fn object(&self, object: &Value) {
        if self.json {
            self.print(&escaped_json(&object.to_string()));
        }
    }

    /// Prints a warning to standard error. With `--json`, the result has it too.
    pub(crate) fn warning(&self, text: &str) {
        if !self.quiet {
            eprint_line(&format!("{} {}", paint("warning:", "1;33"), escaped(&one_line(text))));
        }
    }

    /// Prints the failure of a file, unless the user interrupted it: a line on standard error, and an object
    /// with `--json`. Returns the exit status for this file alone.
    pub(crate) fn failure(&self, path: &str, failure: &anyhow::Error) -> Status {
        let status = status_of(failure);
        if status != Status::Interrupted {
            let reason = format!("{failure:#}");
            self.object(&serde_json::json!({ "path": path, "error": one_line(&reason) }));
            error(&format!("{path}: {reason}"));
        }
        status
    }

    /// Flushes the output and returns an error if printing failed. A reader that closed the pipe is no error.
    pub(crate) fn finish(&self, status: Status) -> anyhow::Result<Status> {
        if !self.closed.get() {
            self.keep_error(io::stdout().flush());
        }
        match self.fault.borrow_mut().take() {
            None => Ok(status),
            // The error of a mesh was already reported by its writer.
            Some(_) if self.stdout_taken && status == Status::Failed => Ok(status),
            Some(e) => Err(e).context("cannot write to standard output"),
        }
    }

    fn print(&self, text: &str) {
        if self.closed.get() {
            return;
        }
        let mut out = io::stdout().lock();
        let text = text.strip_suffix('\n').unwrap_or(text);
        self.keep_error(writeln!(out, "{text}"));
    }

    fn keep_error(&self, result: io::Result<()>) {
        if let Err(e) = result {
            self.closed.set(true);
            if e.kind() != ErrorKind::BrokenPipe {
                self.fault.borrow_mut().get_or_insert(e);
            }
        }
    }
}

/// Prints an error in one line on standard error, even with `--quiet`.
pub(crate) fn error(text: &str) {
    eprint_line(&format!("{} {}", paint("error:", "1;31"), escaped(&one_line(text))));
}

/// Prints a usage error, or the requested help. Arguments are escaped, since a shell may have expanded file
/// names into them.
///
/// # Errors
/// If standard output does not accept the help; a reader that closed the pipe is no error.
pub(crate) fn usage(error: &clap::Error) -> anyhow::Result<()> {
    let has_unsafe = |argument: std::ffi::OsString| argument.to_string_lossy().contains(is_unsafe);
    if error.use_stderr() && std::env::args_os().any(has_unsafe) {
        error.render().to_string().lines().for_each(|line| eprint_line(&escaped(line)));
        return Ok(());
    }
    match error.print().and_then(|()| io::stdout().flush()) {
        Err(e) if !error.use_stderr() && e.kind() != ErrorKind::BrokenPipe => {
            Err(e).context("cannot write to standard output")
        }
        // A failure of standard error cannot be reported.
        _ => Ok(()),
    }
}

fn eprint_line(text: &str) {
    // A failure of standard error cannot be reported.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

fn one_line(text: &str) -> String {
    text.split('\n').map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Escapes characters that must not reach a terminal: control characters, which move the cursor or start
/// escape sequences, and marks that change the direction of text.
///
/// Names of files, groups, materials, nodes and images may contain anything. All text for people passes through this
/// function once.
pub(crate) fn escaped(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unsafe(c) { shown.extend(c.escape_debug()) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Escapes the same characters in JSON notation. They occur in strings only, so the value stays the same.
fn escaped_json(json: &str) -> Cow<'_, str> {
    if !json.contains(is_unsafe) {
        return Cow::Borrowed(json);
    }
    let mut shown = String::with_capacity(json.len() + 16);
    for c in json.chars() {
        if is_unsafe(c) { shown.push_str(&format!("\\u{:04x}", u32::from(c))) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Returns true for characters that act on a terminal: control characters (C0, DEL, C1), line and paragraph
/// separators, and bidirectional marks.
fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn paint(text: &str, code: &str) -> String {
    let is_colored = std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
        && std::env::var_os("TERM").is_none_or(|v| v != "dumb")
        && io::stderr().is_terminal();
    if is_colored { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_and_direction_marks_are_escaped() {
        assert_eq!(escaped("a\u{1b}[2Jb\u{7f}\u{9b}\t\r\n"), "a\\u{1b}[2Jb\\u{7f}\\u{9b}\\t\\r\\n");
        for mark in "\u{61c}\u{200e}\u{200f}\u{202a}\u{202e}\u{2066}\u{2069}\u{2028}".chars() {
            assert!(escaped(&mark.to_string()).is_ascii(), "{mark:?}");
        }
        let plain = "Größe → 木 \\ \"a\" 👩‍🚀";
        assert_eq!(escaped(plain), plain);
        let value = serde_json::json!({ "a\u{9b}": "\u{1b}\u{202e}\n\u{7f}" });
        let json = escaped_json(&value.to_string()).into_owned();
        assert!(json.is_ascii() && !json.contains(is_unsafe), "{json}");
        assert_eq!(serde_json::from_str::<Value>(&json).unwrap(), value);
    }

    #[test]
    fn errors_are_one_line() {
        assert_eq!(one_line("a\n  b\n\nc"), "a b c");
    }
}
