//! Writing of files on a disk.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::NamedTempFile;

use super::BUFFER;

/// Replaces the file at `path` by what `write` writes; on an error the old file is unchanged.
///
/// The output goes to a temporary file in the same folder, which is renamed when it is complete. A link stays
/// a link: its target is replaced, or created. A write-protected file is replaced with `force` only.
///
/// # Errors
/// The errors of the system and of `write`.
pub fn write_file<T>(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<T>,
) -> io::Result<T> {
    // Standard output may be a pipe, whose link leads to no path.
    if fs::metadata(path).is_ok_and(|about| !about.is_file() && !about.is_dir()) {
        let mut out = BufWriter::with_capacity(BUFFER, File::options().write(true).open(path)?);
        let value = write(&mut out)?;
        out.flush()?;
        return Ok(value);
    }
    let target = target_of(path)?;
    let existing = match fs::metadata(&target) {
        Ok(about) => Some(about),
        Err(e) if e.kind() == io::ErrorKind::NotFound => None,
        Err(e) => return Err(e),
    };
    if let Some(about) = &existing {
        if about.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
        }
        if about.permissions().readonly() && !force {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
        }
    }
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        let text = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, text));
    }
    let temporary = temporary_in(&folder)?;
    let mut out = BufWriter::with_capacity(BUFFER, temporary.as_file());
    let value = write(&mut out)?;
    out.flush()?;
    drop(out);
    if let Some(about) = existing {
        temporary.as_file().set_permissions(about.permissions())?;
    }
    temporary.persist(&target).map_err(|e| e.error)?;
    Ok(value)
}

/// Writes a new file.
///
/// # Errors
/// The errors of the system: [`io::ErrorKind::AlreadyExists`] if there is a file already.
pub(crate) fn write_new_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut temporary = temporary_in(path.parent().unwrap_or(Path::new("")))?;
    temporary.as_file_mut().write_all(bytes)?;
    temporary.persist_noclobber(path).map(drop).map_err(|e| e.error)
}

/// Returns the file that a path refers to, after resolving all links; it may be missing.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    if let Ok(real) = fs::canonicalize(path) {
        return Ok(real);
    }
    // The limit of Linux.
    const MAX_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&target) else { return Ok(target) };
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    Err(io::Error::other("too many levels of symbolic links"))
}

const PART_PREFIX: &str = ".lodsmith-";
const PART_SUFFIX: &str = ".part";

/// Creates a temporary file that is deleted unless it is renamed. Removes temporary files that killed
/// processes left behind.
fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    remove_stale_parts(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PART_PREFIX).suffix(PART_SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The mode of new files before the umask is applied.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let temporary = builder.tempfile_in(folder)?;
        // The lock shows that this process is alive, and ends with it. On systems without locks, no stale
        // files are removed.
        let is_locked = temporary.as_file().lock().is_ok();
        // Before it was locked, another process may have removed it as stale.
        if !is_locked || temporary.path().exists() {
            return Ok(temporary);
        }
    }
}

/// Removes temporary files that no running process holds: once per folder and process, since a folder may be
/// large.
fn remove_stale_parts(folder: &Path) {
    static CLEANED_FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let real = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    if !CLEANED_FOLDERS.lock().unwrap_or_else(PoisonError::into_inner).insert(real) {
        return;
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        let is_part = name.starts_with(PART_PREFIX.as_bytes()) && name.ends_with(PART_SUFFIX.as_bytes());
        if !is_part || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let path = entry.path();
        // (Opened for writing, since some systems lock no other files.)
        if File::options().write(true).open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            // A remaining file does no harm.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stale_temporary_files_are_removed_and_locked_ones_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let [left, held, other] =
            [".lodsmith-a.part", ".lodsmith-b.part", "a.part"].map(|n| folder.path().join(n));
        for path in [&left, &held, &other] {
            fs::write(path, "half").unwrap();
        }
        let holder = File::open(&held).unwrap();
        holder.lock().unwrap();
        let out = folder.path().join("out");
        write_file(&out, false, |out| out.write_all(b"whole")).unwrap();
        assert!(!left.exists() && held.exists() && other.exists());
        assert_eq!(fs::read(&out).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_link_to_a_pipe_is_written_to() {
        use std::os::fd::AsRawFd;
        let (mut reader, writer) = io::pipe().unwrap();
        let path = PathBuf::from(format!("/proc/self/fd/{}", writer.as_raw_fd()));
        write_file(&path, false, |out| out.write_all(b"whole")).unwrap();
        drop(writer);
        let mut text = String::new();
        io::Read::read_to_string(&mut reader, &mut text).unwrap();
        assert_eq!(text, "whole");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_missing_file_stays_a_link() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("far")).unwrap();
        symlink("far/b", path("a")).unwrap();
        symlink("a", path("first")).unwrap();
        write_file(&path("first"), false, |out| out.write_all(b"1")).unwrap();
        assert_eq!(fs::read(path("far/b")).unwrap(), b"1");
        assert!(["a", "first"].iter().all(|name| path(name).is_symlink()));
        symlink("none/c", path("lost")).unwrap();
        assert!(
            write_file(&path("lost"), false, |_| Ok(()))
                .unwrap_err()
                .to_string()
                .contains("there is no folder")
        );
        symlink("round", path("round")).unwrap();
        assert!(write_file(&path("round"), false, |_| Ok(())).is_err());
        assert!(path("lost").is_symlink() && path("round").is_symlink());
    }
}
