//! Log messages, newest last.

use web_time::{Duration, Instant};

/// Severity of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Success.
    Good,
    /// Information.
    Note,
    /// Warning.
    Warning,
    /// Error.
    Error,
}

/// A log entry.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Severity.
    pub level: Severity,
    /// A sentence without a full stop.
    pub text: String,
    /// Time since the window opened.
    pub at: Duration,
}

/// The log.
#[derive(Debug)]
pub struct Log {
    begin: Instant,
    entries: Vec<Entry>,
}

/// Number of entries that are kept. Guessed.
const MAX_ENTRIES: usize = 1000;

impl Default for Log {
    fn default() -> Self {
        Self { begin: Instant::now(), entries: Vec::new() }
    }
}

impl Log {
    /// Returns the entries that are kept.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }
    /// Logs a success message.
    pub fn good(&mut self, text: impl Into<String>) {
        self.add(Severity::Good, text.into());
    }
    /// Logs an informational message.
    pub fn note(&mut self, text: impl Into<String>) {
        self.add(Severity::Note, text.into());
    }
    /// Logs a warning.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.add(Severity::Warning, text.into());
    }
    /// Logs an error.
    pub fn bad(&mut self, text: impl Into<String>) {
        self.add(Severity::Error, text.into());
    }

    fn add(&mut self, level: Severity, text: String) {
        // A dragged slider can cause the same message many times.
        if self.entries.last().is_some_and(|e| e.text == text) {
            return;
        }
        if self.entries.len() == MAX_ENTRIES {
            self.entries.remove(0);
        }
        self.entries.push(Entry { level, text, at: self.begin.elapsed() });
    }
}
