//! Files in memory, each thread with its own, under the paths that readers and writers name.
//!
//! A folder exists while it has a file. Paths have no root: `/a`, `./a` and `a` are the same file.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

type Bytes = Arc<[u8]>;

thread_local! {
    static FILES: RefCell<BTreeMap<PathBuf, Bytes>> = const { RefCell::new(BTreeMap::new()) };
}

/// Writes a file, and replaces an existing one.
pub fn put(path: &Path, bytes: impl Into<Arc<[u8]>>) {
    FILES.with_borrow_mut(|files| files.insert(plain(path), bytes.into()));
}

/// Removes a file and returns its bytes, if it exists.
pub fn take(path: &Path) -> Option<Arc<[u8]>> {
    FILES.with_borrow_mut(|files| files.remove(&plain(path)))
}

/// Returns the bytes of a file.
///
/// # Errors
/// [`io::ErrorKind::NotFound`].
pub fn read(path: &Path) -> io::Result<Arc<[u8]>> {
    FILES.with_borrow(|files| files.get(&plain(path)).cloned()).ok_or_else(absent)
}

/// Returns the paths of all files, in order.
pub fn paths() -> Vec<PathBuf> {
    FILES.with_borrow(|files| files.keys().cloned().collect())
}

fn absent() -> io::Error {
    io::Error::new(io::ErrorKind::NotFound, "there is no such file")
}

/// Returns the path without a root, `.` and `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => plain.push(name),
            Component::ParentDir => _ = plain.pop(),
            Component::Prefix(_) | Component::RootDir | Component::CurDir => {}
        }
    }
    plain
}

/// Size and kind of a file, as [`std::fs::Metadata`] has them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Metadata {
    /// `None` for a folder.
    size: Option<u64>,
}

impl Metadata {
    pub(crate) fn is_file(&self) -> bool {
        self.size.is_some()
    }
    pub(crate) fn is_dir(&self) -> bool {
        self.size.is_none()
    }
    pub(crate) fn len(&self) -> u64 {
        self.size.unwrap_or(0)
    }
}

/// As [`std::fs::metadata`].
pub(crate) fn metadata(path: &Path) -> io::Result<Metadata> {
    let path = plain(path);
    FILES.with_borrow(|files| match files.get(&path) {
        Some(bytes) => Ok(Metadata { size: Some(bytes.len() as u64) }),
        None if files.keys().any(|file| file.starts_with(&path)) => Ok(Metadata { size: None }),
        None => Err(absent()),
    })
}

/// As [`std::fs::canonicalize`]. A path that is no file may become a folder, so it is not an error.
pub(crate) fn canonicalize(path: &Path) -> io::Result<PathBuf> {
    Ok(plain(path))
}

/// As [`std::fs::remove_file`].
pub(crate) fn remove_file(path: impl AsRef<Path>) -> io::Result<()> {
    take(path.as_ref()).map(drop).ok_or_else(absent)
}

/// An open file, for reading.
#[derive(Debug)]
pub(crate) struct File(Cursor<Bytes>);

impl File {
    /// As [`std::fs::File::open`].
    pub(crate) fn open(path: impl AsRef<Path>) -> io::Result<Self> {
        read(path.as_ref()).map(|bytes| Self(Cursor::new(bytes)))
    }
    /// As [`std::fs::File::metadata`].
    pub(crate) fn metadata(&self) -> io::Result<Metadata> {
        Ok(Metadata { size: Some(self.0.get_ref().len() as u64) })
    }
}

impl Read for File {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Seek for File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_found_under_each_form_of_its_path() {
        put(Path::new("/in/tex/a.png"), *b"abc");
        for path in ["in/tex/a.png", "./in/x/../tex/a.png", "/in/tex/a.png"] {
            let path = Path::new(path);
            assert!(metadata(path).unwrap().is_file() && metadata(path).unwrap().len() == 3);
            assert_eq!(canonicalize(path).unwrap(), Path::new("in/tex/a.png"));
            let mut bytes = Vec::new();
            let mut file = File::open(path).unwrap();
            file.seek(SeekFrom::Start(1)).unwrap();
            file.read_to_end(&mut bytes).unwrap();
            assert_eq!((bytes.as_slice(), file.metadata().unwrap().len()), (&b"bc"[..], 3));
        }
        assert!(metadata(Path::new("in/tex")).unwrap().is_dir());
        assert_eq!(File::open("in/none").unwrap_err().kind(), io::ErrorKind::NotFound);
        put(Path::new("b"), *b"b");
        assert_eq!(paths(), [Path::new("b"), Path::new("in/tex/a.png")]);
        assert!(remove_file("b").is_ok() && remove_file("b").is_err());
        assert_eq!(take(Path::new("in/tex/a.png")).as_deref(), Some(&b"abc"[..]));
        assert!(metadata(Path::new("in")).is_err());
    }
}
