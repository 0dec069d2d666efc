//! Inputs and outputs: a path, or a standard stream, written `-`.

use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use lodsmith_io::sniff::hint_of;
use lodsmith_io::{Format, WriteError};

use crate::error::{AssetError, usage};

/// Source of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Standard input.
    Stream,
    /// A file.
    Path(PathBuf),
}

/// Destination of a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sink {
    /// Standard output.
    Stream,
    /// A file.
    Path(PathBuf),
}

impl Source {
    /// Returns the path from which names of outputs are made.
    pub(crate) fn name(&self) -> &Path {
        match self {
            Self::Path(path) => path,
            Self::Stream => Path::new("stdin"),
        }
    }
}

impl From<OsString> for Source {
    fn from(text: OsString) -> Self {
        if text == "-" { Self::Stream } else { Self::Path(text.into()) }
    }
}

impl From<OsString> for Sink {
    fn from(text: OsString) -> Self {
        if text == "-" { Self::Stream } else { Self::Path(text.into()) }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stream => f.write_str("-"),
            Self::Path(path) => path.display().fmt(f),
        }
    }
}

impl fmt::Display for Sink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stream => f.write_str("-"),
            Self::Path(path) => path.display().fmt(f),
        }
    }
}

/// Returns an error if two sources are standard input.
///
/// # Errors
/// [`AssetError::Usage`].
pub fn at_most_one_stream<'a>(sources: impl IntoIterator<Item = &'a Source>) -> Result<(), AssetError> {
    if sources.into_iter().filter(|s| **s == Source::Stream).count() > 1 {
        return Err(usage("standard input can be read only once: `-` is given twice"));
    }
    Ok(())
}

/// Returns the format of an output: `to`, or the format of the file extension.
///
/// # Errors
/// [`AssetError::Usage`] if there is no format, or if meshes cannot be written in it.
pub fn format_of(sink: &Sink, to: Option<Format>) -> Result<Format, AssetError> {
    let hint = match sink {
        Sink::Path(path) => hint_of(path),
        Sink::Stream => None,
    };
    match (to.or(hint), sink) {
        (Some(Format::Lpm), _) => Err(usage(WriteError::NeedsSplits.to_string())),
        (Some(format), _) if !Format::WRITTEN.contains(&format) => {
            Err(usage(WriteError::ReadOnly { format: format.title() }.to_string()))
        }
        (Some(format), _) => Ok(format),
        (None, Sink::Stream) => Err(usage("standard output has no file extension: set the format with --to")),
        (None, Sink::Path(path)) if path.is_dir() => {
            Err(usage(format!("{}: is a folder: give a file name in it", path.display())))
        }
        (None, Sink::Path(path)) => Err(usage(WriteError::UnknownFormat { path: path.clone() }.to_string())),
    }
}

/// Returns an error if the output is a folder.
///
/// # Errors
/// [`AssetError::Usage`], with the hint at its end.
pub fn refuse_folder(sink: &Sink, hint: &str) -> Result<(), AssetError> {
    match sink {
        Sink::Path(path) if path.is_dir() => {
            Err(usage(format!("{}: is a folder, which is never overwritten{hint}", path.display())))
        }
        _ => Ok(()),
    }
}

/// Refuses to overwrite an input without `force`: it may be the only copy.
///
/// # Errors
/// [`AssetError::Usage`] if the output is an input.
pub fn refuse_inputs<'a>(
    sink: &Sink,
    inputs: impl IntoIterator<Item = &'a Source>,
    force: bool,
) -> Result<(), AssetError> {
    let Sink::Path(path) = sink else { return Ok(()) };
    // A device or a pipe cannot be overwritten.
    if force || !fs::metadata(path).is_ok_and(|metadata| metadata.is_file()) {
        return Ok(());
    }
    let output = identity(path);
    for input in inputs {
        if matches!(input, Source::Path(input) if identity(input) == output) {
            return Err(usage(format!("{sink}: is an input; --force overwrites it")));
        }
    }
    Ok(())
}

/// Returns a path without the extension `.gz`.
pub(crate) fn unpacked(path: &Path) -> PathBuf {
    let is_gz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    if is_gz { path.with_extension("") } else { path.to_owned() }
}

/// Returns the name of a file without its extensions.
pub(crate) fn stem(path: &Path) -> String {
    unpacked(path).file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Returns the canonical form of a path, which is the same for all paths to the file, as far as the file system can
/// tell.
pub fn identity(path: &Path) -> PathBuf {
    if let Ok(real) = path.canonicalize() {
        return real;
    }
    let parent = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    match (parent.canonicalize(), path.file_name()) {
        (Ok(parent), Some(name)) => parent.join(name),
        _ => std::path::absolute(path).unwrap_or_else(|_| path.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dash_is_a_stream() {
        assert_eq!(Source::from(OsString::from("-")), Source::Stream);
        assert_eq!(Source::from(OsString::from("./-")).to_string(), "./-");
        assert!(at_most_one_stream([&Source::Stream, &Source::Stream]).is_err());
    }

    #[test]
    fn the_extension_determines_the_format_unless_one_is_given() {
        let sink = |s: &str| Sink::from(OsString::from(s));
        assert_eq!(format_of(&sink("a.stl.gz"), None).unwrap(), Format::Stl);
        assert_eq!(format_of(&sink("a.stl"), Some(Format::Ply)).unwrap(), Format::Ply);
        assert!(format_of(&sink("-"), None).unwrap_err().is_usage());
    }
}
