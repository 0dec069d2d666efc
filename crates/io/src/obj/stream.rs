//! Reading of OBJ files in pieces: the file is never in memory as a whole.
//!
//! Only for valid files. Whatever needs more context (the line number of an error, a negative index in a
//! later section) is left to the reader of whole files.

use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::read::{MIN_SECTION_BYTES, Section, UNKNOWN_COUNTS};
use crate::drive::File;
use crate::error::ReadError;
use crate::lines::ends_line;
use crate::loaded::Loaded;
use crate::options::{ReadOptions, SharedProgress};

/// Bytes per read. Guessed: enough for a system call, and within the cache of a core.
const PIECE: usize = 1 << 18;

/// Reads the file at `path`, which is known to be OBJ in UTF-8 or similar and to have `size` bytes; `None` if
/// it must be read as a whole, because of an error or missing context.
///
/// # Errors
/// [`ReadError::Mesh`] like the reader of whole files.
pub(crate) fn read_file(path: &Path, size: u64, options: &ReadOptions) -> Result<Option<Loaded>, ReadError> {
    let Ok(Some(ranges)) = ranges(path, size) else { return Ok(None) };
    let read_all = |precise: bool| {
        let last = ranges.len() - 1;
        options.progress.set(0, size);
        let read = |(i, range): (usize, &Range<u64>)| {
            let section = Section::new(i == 0, precise);
            read_range(path, range.clone(), section, i == last, &options.progress)
        };
        let sections: Option<Vec<Section>> = ranges.par_iter().enumerate().map(read).collect();
        sections.and_then(Section::joined)
    };
    let section = match read_all(false) {
        Some(section) if section.wants_precision => read_all(true),
        other => other,
    };
    match section {
        Some(section) if section.indices_in_range() => section.finish(options).map(Some),
        _ => Ok(None),
    }
}

/// Cuts a file at line ends into byte ranges, one per thread; `None` if a line is too long for that.
fn ranges(path: &Path, size: u64) -> io::Result<Option<Vec<Range<u64>>>> {
    let threads = rayon::current_num_threads() as u64;
    let count = threads.clamp(1, size / MIN_SECTION_BYTES as u64 + 1);
    let (mut ranges, mut start) = (Vec::new(), 0);
    let mut file = File::open(path)?;
    let mut piece = Vec::new();
    for i in 1..count {
        let aim = start.max(size / count * i);
        file.seek(SeekFrom::Start(aim))?;
        piece.clear();
        (&mut file).take(PIECE as u64).read_to_end(&mut piece)?;
        // The first bytes may follow a backslash that is not visible here.
        let end = memchr::memchr_iter(b'\n', &piece).find(|&n| n >= 2 && ends_line(&piece[..n]));
        let Some(end) = end else { return Ok(None) };
        let end = aim + end as u64 + 1;
        ranges.push(start..end);
        start = end;
    }
    ranges.push(start..size);
    Ok(Some(ranges))
}

/// Parses a range into an empty section; stops early if the section must be parsed again anyway.
fn read_range(
    path: &Path,
    range: Range<u64>,
    mut section: Section,
    is_last: bool,
    progress: &SharedProgress,
) -> Option<Section> {
    let mut file = File::open(path).ok()?;
    file.seek(SeekFrom::Start(range.start)).ok()?;
    let length = range.end - range.start;
    let mut left = file.take(length);
    let mut buffer = vec![0; PIECE];
    let (mut filled, mut taken) = (0, 0);
    loop {
        match left.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => {
                (filled, taken) = (filled + count, taken + count as u64);
                progress.add(count as u64);
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => return None,
        }
        let end = memchr::memrchr_iter(b'\n', &buffer[..filled]).find(|&n| n > 0 && ends_line(&buffer[..n]));
        if let Some(end) = end {
            section.parse_lines(&buffer[..=end], UNKNOWN_COUNTS).ok()?;
            if section.wants_precision {
                return Some(section);
            }
            buffer.copy_within(end + 1..filled, 0);
            filled -= end + 1;
        } else if filled == buffer.len() {
            // A line of many megabytes, or not an OBJ file.
            buffer.resize(buffer.len() * 2, 0);
        }
    }
    section.parse_lines(&buffer[..filled], UNKNOWN_COUNTS).ok()?;
    // Another process may be writing the file.
    let is_whole = taken == length && (!is_last || left.into_inner().read(&mut [0]).ok()? == 0);
    is_whole.then_some(section)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use lodsmith_core::RegionId;

    use super::*;

    /// Returns many vertices, then faces; every seventh line continues in the next one.
    fn text(side: usize, extra: &str) -> String {
        let mut text = String::new();
        for i in 0..side * side {
            let glue = if i % 7 == 0 { "\\\n" } else { "" };
            writeln!(text, "v {} {glue} {} 0.125", i / side, i % side).unwrap();
        }
        text.push_str(extra);
        for i in (0..side * side - side - 1).filter(|i| (i + 1) % side != 0) {
            let [a, b, c, d] = [i, i + 1, i + 1 + side, i + side].map(|i| i + 1);
            writeln!(text, "f {a}//1 {b}//1 {c}//2\nf {a}//2 {c}//2 \\\r\n {d}//1").unwrap();
        }
        text
    }

    fn streamed(text: &str, threads: usize) -> Result<Option<Loaded>, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, text).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| read_file(&path, text.len() as u64, &ReadOptions::default()))
    }

    #[test]
    fn pieces_give_the_same_result_as_the_whole() {
        let mut text = text(400, "vn 0 0 1\nvn 0 1 0\nusemtl a\nwhat is this\n");
        // Regions that begin within the later pieces, after faces of the earlier ones.
        let half = text.rfind("f 150001").unwrap();
        text.insert_str(half, "usemtl b\ns 1\n");
        text.push_str("g z\nf 1//1 2//1 3//1\n");
        assert!(text.len() > 2 * MIN_SECTION_BYTES, "{}", text.len());
        let whole = super::super::read(text.as_bytes(), &ReadOptions::default()).unwrap();
        assert_eq!((whole.regions.len(), whole.mesh.regions().unwrap().last()), (3, Some(&RegionId(2))));
        for threads in [1, 3] {
            let got = streamed(&text, threads).unwrap().unwrap();
            assert_eq!(got.mesh, whole.mesh);
            assert_eq!((got.contents, got.warnings), (whole.contents.clone(), whole.warnings.clone()));
            assert_eq!(got.regions, whole.regions);
        }
    }

    #[test]
    fn precision_may_be_needed_late() {
        let text = text(400, "vn 0 0 1\nvn 0 1 0\nv 0.1 500000.123 0\n");
        let whole = super::super::read(text.as_bytes(), &ReadOptions::default()).unwrap();
        assert!(matches!(whole.mesh.positions(), lodsmith_core::Positions::F64(_)));
        for threads in [1, 3] {
            assert_eq!(streamed(&text, threads).unwrap().unwrap().mesh, whole.mesh);
        }
    }

    #[test]
    fn files_with_errors_are_left_to_the_reader_of_whole_files() {
        assert!(streamed(&text(40, "vn 0 0 1\n"), 2).unwrap().is_none());
        assert!(streamed(&text(40, "v 0 0 x\n"), 2).unwrap().is_none());
        assert!(streamed("v 0 0 0\n", 2).unwrap().is_some());
    }
}
