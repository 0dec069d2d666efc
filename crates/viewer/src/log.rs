//! What was said, newest last.

use std::time::{Duration, Instant};

/// How much an entry matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// It went well.
    Good,
    /// It is so.
    Note,
    /// Something is not as one might think.
    Warning,
    /// It did not work.
    Error,
}

/// Something that was said.
#[derive(Clone, Debug)]
pub struct Entry {
    /// How much it matters.
    pub level: Level,
    /// A sentence without a full stop.
    pub text: String,
    /// Time since the window opened.
    pub at: Duration,
}

/// What was said.
#[derive(Debug)]
pub struct Log {
    begin: Instant,
    entries: Vec<Entry>,
}

/// Entries that are kept. Guessed.
const KEPT: usize = 1000;

impl Default for Log {
    fn default() -> Self {
        Self { begin: Instant::now(), entries: Vec::new() }
    }
}

impl Log {
    /// All that is kept.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }
    /// It went well.
    pub fn good(&mut self, text: impl Into<String>) {
        self.add(Level::Good, text.into());
    }
    /// It is so.
    pub fn note(&mut self, text: impl Into<String>) {
        self.add(Level::Note, text.into());
    }
    /// Something is not as one might think.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.add(Level::Warning, text.into());
    }
    /// It did not work.
    pub fn bad(&mut self, text: impl Into<String>) {
        self.add(Level::Error, text.into());
    }

    fn add(&mut self, level: Level, text: String) {
        // While a slider is dragged, one thing would be said again and again.
        if self.entries.last().is_some_and(|e| e.text == text) {
            return;
        }
        if self.entries.len() == KEPT {
            self.entries.remove(0);
        }
        self.entries.push(Entry { level, text, at: self.begin.elapsed() });
    }
}
