//! Archive formats: tar with gzip, and zip.

use std::io::{Cursor, Write as _};

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder};
use zip::write::SimpleFileOptions;

/// A file of an archive.
pub(super) struct Entry {
    /// Its path, with slashes.
    pub(super) name: String,
    kind: Kind,
}

enum Kind {
    File(Vec<u8>),
    /// An executable file.
    Program(Vec<u8>),
    /// A symbolic link to a path relative to its own folder.
    Link(String),
}

impl Entry {
    pub(super) fn file(name: String, bytes: Vec<u8>) -> Self {
        Self { name, kind: Kind::File(bytes) }
    }

    pub(super) fn program(name: String, bytes: Vec<u8>) -> Self {
        Self { name, kind: Kind::Program(bytes) }
    }

    pub(super) fn link(name: String, target: String) -> Self {
        Self { name, kind: Kind::Link(target) }
    }

    fn mode(&self) -> u32 {
        match self.kind {
            Kind::File(_) => 0o644,
            Kind::Program(_) => 0o755,
            Kind::Link(_) => 0o777,
        }
    }
}

/// Returns all files as a gzip-compressed tar archive.
pub(super) fn tar_gz(entries: &[Entry], time: u64) -> Result<Vec<u8>> {
    // The gzip header has no name and time: the same content gives the same bytes under any name.
    let packed = GzBuilder::new().mtime(0).operating_system(255).write(Vec::new(), Compression::best());
    let mut tar = tar::Builder::new(packed);
    for entry in entries {
        let mut header = tar::Header::new_ustar();
        header.set_mode(entry.mode());
        header.set_mtime(time);
        match &entry.kind {
            Kind::File(bytes) | Kind::Program(bytes) => {
                header.set_entry_type(tar::EntryType::Regular);
                header.set_size(bytes.len() as u64);
                tar.append_data(&mut header, &entry.name, &**bytes)
            }
            Kind::Link(target) => {
                header.set_entry_type(tar::EntryType::Symlink);
                header.set_size(0);
                tar.append_link(&mut header, &entry.name, target)
            }
        }
        .with_context(|| entry.name.clone())?;
    }
    Ok(tar.into_inner()?.finish()?)
}

/// Returns all files as a zip archive.
pub(super) fn zip(entries: &[Entry], time: u64) -> Result<Vec<u8>> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for entry in entries {
        let options = SimpleFileOptions::default()
            .compression_level(Some(9))
            .last_modified_time(dos_time(time)?)
            .unix_permissions(entry.mode());
        match &entry.kind {
            Kind::File(bytes) | Kind::Program(bytes) => {
                zip.start_file(&*entry.name, options).with_context(|| entry.name.clone())?;
                zip.write_all(bytes)?;
            }
            Kind::Link(target) => zip.add_symlink(&*entry.name, &**target, options)?,
        }
    }
    Ok(zip.finish()?.into_inner())
}

/// Converts a time to ZIP's representation: UTC, in steps of two seconds, from 1980 on.
fn dos_time(time: u64) -> Result<zip::DateTime> {
    let time = time::OffsetDateTime::from_unix_timestamp(time.max(super::EARLIEST_ZIP_TIME).cast_signed())?;
    let time = time::PrimitiveDateTime::new(time.date(), time.time());
    zip::DateTime::try_from(time).with_context(|| format!("{time} cannot be stored in a ZIP archive"))
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::GzDecoder;

    use super::*;

    /// 2024-02-29 12:34:56.
    const TIME: u64 = 1_709_210_096;

    fn entries() -> Vec<Entry> {
        vec![
            Entry::program("a/lodsmith".to_owned(), vec![7; 1000]),
            Entry::file("a/é.txt".to_owned(), b"text".to_vec()),
            Entry::file("a/none".to_owned(), Vec::new()),
            Entry::link("a/other".to_owned(), "none".to_owned()),
        ]
    }

    /// Returns the content of a file, or the target of a link.
    fn content(entry: &Entry) -> &[u8] {
        match &entry.kind {
            Kind::File(bytes) | Kind::Program(bytes) => bytes,
            Kind::Link(target) => target.as_bytes(),
        }
    }

    #[test]
    fn tar_round_trip() {
        let packed = tar_gz(&entries(), TIME).unwrap();
        assert_eq!(packed, tar_gz(&entries(), TIME).unwrap());
        let mut tar = tar::Archive::new(GzDecoder::new(&*packed));
        let mut files = tar.entries().unwrap();
        for wanted in entries() {
            let mut file = files.next().unwrap().unwrap();
            assert_eq!(file.path().unwrap().to_str(), Some(&*wanted.name));
            let header = file.header();
            assert_eq!((header.mode().unwrap(), header.mtime().unwrap()), (wanted.mode(), TIME));
            let mut bytes = Vec::new();
            match file.link_name_bytes() {
                Some(target) => bytes.extend_from_slice(&target),
                None => drop(file.read_to_end(&mut bytes).unwrap()),
            }
            assert_eq!(bytes, content(&wanted));
        }
        assert!(files.next().is_none());
    }

    #[test]
    fn zip_round_trip() {
        let packed = zip(&entries(), TIME).unwrap();
        assert_eq!(packed, zip(&entries(), TIME).unwrap());
        let mut zip = zip::ZipArchive::new(Cursor::new(&packed)).unwrap();
        assert_eq!(zip.len(), 4);
        for (i, wanted) in entries().into_iter().enumerate() {
            let mut file = zip.by_index(i).unwrap();
            assert_eq!(file.name().unwrap(), wanted.name);
            assert_eq!(file.unix_mode().map(|mode| mode & 0o777), Some(wanted.mode()));
            assert_eq!(file.last_modified().unwrap().to_string(), "2024-02-29 12:34:56");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).unwrap();
            assert_eq!(bytes, content(&wanted));
        }
        // Times before 1980 become the earliest time of ZIP.
        assert_eq!(dos_time(0).unwrap().to_string(), "1980-01-01 00:00:00");
    }
}
