//! Files as one: tar packed by gzip, and zip.
//!
//! Sources: IEEE 1003.1-2017, pax, "ustar Interchange Format"; PKWARE, ".ZIP File Format Specification" 6.3.10 (2022).

use std::io::Write as _;

use anyhow::{Context, Result, ensure};
use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc, GzBuilder};

/// A file of an archive.
pub(super) struct Entry {
    /// Its path, with slashes.
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
    /// Whether it can be started.
    pub(super) is_program: bool,
}

impl Entry {
    fn mode(&self) -> u32 {
        if self.is_program { 0o755 } else { 0o644 }
    }
}

/// All files in one stream, packed.
pub(super) fn tar_gz(entries: &[Entry], time: u64) -> Result<Vec<u8>> {
    // Neither name nor time: the file may be made again and called otherwise.
    let mut packed = GzBuilder::new().mtime(0).operating_system(255).write(Vec::new(), Compression::best());
    for entry in entries {
        packed.write_all(&header(entry, time)?)?;
        packed.write_all(&entry.bytes)?;
        packed.write_all(&vec![0; entry.bytes.len().next_multiple_of(512) - entry.bytes.len()])?;
    }
    packed.write_all(&[0; 1024])?;
    Ok(packed.finish()?)
}

/// What stands before a file in a tar: text in fields of fixed size, numbers in octal digits.
fn header(entry: &Entry, time: u64) -> Result<[u8; 512]> {
    let mut header = [0; 512];
    let mut put = |at: usize, text: &[u8]| header[at..at + text.len()].copy_from_slice(text);
    ensure!(entry.name.len() <= 100, "{}: a name of more than 100 bytes", entry.name);
    put(0, entry.name.as_bytes());
    put(100, format!("{:07o}\0", entry.mode()).as_bytes());
    put(108, b"0000000\0");
    put(116, b"0000000\0");
    ensure!(entry.bytes.len() < 1 << 33, "{}: larger than a tar can say", entry.name);
    put(124, format!("{:011o}\0", entry.bytes.len()).as_bytes());
    ensure!(time < 1 << 33, "{time}: later than a tar can say");
    put(136, format!("{time:011o}\0").as_bytes());
    // The sum is taken with blanks in its own place.
    put(148, b"        ");
    put(156, b"0");
    put(257, b"ustar\x0000");
    put(265, b"root");
    put(297, b"root");
    let sum: u32 = header.iter().map(|&b| u32::from(b)).sum();
    header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    Ok(header)
}

/// All files, each packed, and a list of them at the end.
pub(super) fn zip(entries: &[Entry], time: u64) -> Result<Vec<u8>> {
    let (mut bytes, mut list) = (Vec::new(), Vec::new());
    for entry in entries {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&entry.bytes)?;
        let packed = encoder.finish()?;
        let mut crc = Crc::new();
        crc.update(&entry.bytes);
        let too_large = || format!("{}: larger than a zip can say", entry.name);
        let word = |n: usize| u32::try_from(n).with_context(too_large);
        let mut common = Vec::new();
        // Version 2.0 is asked for; names are UTF-8; deflate.
        for half in [20u16, 1 << 11, 8] {
            common.extend(half.to_le_bytes());
        }
        common.extend(dos_time(time).to_le_bytes());
        for n in [crc.sum(), word(packed.len())?, word(entry.bytes.len())?] {
            common.extend(n.to_le_bytes());
        }
        let name_length = u16::try_from(entry.name.len()).with_context(|| entry.name.clone())?;
        for half in [name_length, 0] {
            common.extend(half.to_le_bytes());
        }
        let at = word(bytes.len())?;
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(entry.name.as_bytes());
        bytes.extend(packed);

        list.extend(b"PK\x01\x02");
        // Made by version 2.0 on Unix, so that the mode counts.
        list.extend((3u16 << 8 | 20).to_le_bytes());
        list.extend(&common);
        list.extend([0; 6]);
        list.extend(((0o100_000 | entry.mode()) << 16).to_le_bytes());
        list.extend(at.to_le_bytes());
        list.extend(entry.name.as_bytes());
    }
    let [at, size] = [bytes.len(), list.len()].map(|n| u32::try_from(n).context("larger than a zip can be"));
    let count = u16::try_from(entries.len()).context("more files than a zip can hold")?;
    bytes.extend(list);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([count; 2].map(u16::to_le_bytes).as_flattened());
    bytes.extend([size?, at?].map(u32::to_le_bytes).as_flattened());
    bytes.extend([0; 2]);
    Ok(bytes)
}

/// Time and date in universal time, by two seconds, from 1980 on.
fn dos_time(time: u64) -> u32 {
    let time = time.max(super::OLDEST);
    let (days, secs) = (time / 86_400, time % 86_400);
    // Years that begin in March end with the day that not all years have.
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let date = (year - 1980).min(127) << 9 | month << 5 | day;
    let clock = (secs / 3600) << 11 | (secs / 60 % 60) << 5 | (secs % 60 / 2);
    (date << 16 | clock) as u32
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::{DeflateDecoder, GzDecoder};

    use super::*;

    /// 2024-02-29 12:34:56.
    const TIME: u64 = 1_709_210_096;

    fn entries() -> Vec<Entry> {
        let entry = |name: &str, bytes: &[u8], is_program| Entry {
            name: name.to_owned(),
            bytes: bytes.to_vec(),
            is_program,
        };
        vec![
            entry("a/lodsmith", &[7; 1000], true),
            entry("a/é.txt", b"text", false),
            entry("a/none", b"", false),
        ]
    }

    #[test]
    fn a_tar_holds_what_was_put_in() {
        let packed = tar_gz(&entries(), TIME).unwrap();
        assert_eq!(packed, tar_gz(&entries(), TIME).unwrap());
        let mut tar = Vec::new();
        GzDecoder::new(&*packed).read_to_end(&mut tar).unwrap();
        let octal = |at: usize, digits: usize| {
            let text = std::str::from_utf8(&tar[at..at + digits]).unwrap();
            usize::from_str_radix(text, 8).unwrap()
        };
        let mut at = 0;
        for entry in entries() {
            let header = &tar[at..at + 512];
            assert!(header.starts_with(entry.name.as_bytes()) && header[entry.name.len()] == 0);
            assert_eq!(octal(at + 100, 7) as u32, entry.mode());
            assert_eq!((octal(at + 124, 11), octal(at + 136, 11)), (entry.bytes.len(), TIME as usize));
            let blank = |i: usize| (148..156).contains(&i);
            let sum = header.iter().enumerate().map(|(i, &b)| if blank(i) { 32 } else { usize::from(b) });
            assert_eq!(octal(at + 148, 6), sum.sum::<usize>());
            assert_eq!(&tar[at + 512..at + 512 + entry.bytes.len()], entry.bytes);
            at += 512 + entry.bytes.len().next_multiple_of(512);
        }
        assert_eq!(tar.len(), at + 1024);
        let long = Entry { name: "x".repeat(101), bytes: Vec::new(), is_program: false };
        assert!(tar_gz(&[long], TIME).is_err());
    }

    #[test]
    fn a_zip_holds_what_was_put_in() {
        let zip = zip(&entries(), TIME).unwrap();
        let word = |at: usize| u32::from_le_bytes(zip[at..at + 4].try_into().unwrap()) as usize;
        let half = |at: usize| usize::from(u16::from_le_bytes(zip[at..at + 2].try_into().unwrap()));
        let end = zip.len() - 22;
        assert_eq!((&zip[end..end + 4], half(end + 10)), (&b"PK\x05\x06"[..], 3));
        let mut at = word(end + 16);
        assert_eq!(at + word(end + 12), end);
        for entry in entries() {
            assert_eq!(&zip[at..at + 4], b"PK\x01\x02");
            assert_eq!(word(at + 38) >> 16, 0o100_000 | entry.mode() as usize);
            assert_eq!(&zip[at + 46..at + 46 + entry.name.len()], entry.name.as_bytes());
            let file = word(at + 42);
            assert_eq!(zip[at + 6..at + 32], zip[file + 4..file + 30], "both say the same");
            let begin = file + 30 + entry.name.len();
            let mut bytes = Vec::new();
            DeflateDecoder::new(&zip[begin..begin + word(at + 20)]).read_to_end(&mut bytes).unwrap();
            assert_eq!((bytes.len(), &bytes), (word(at + 24), &entry.bytes));
            at += 46 + entry.name.len();
        }
        assert_eq!(at, end);
    }

    #[test]
    fn times_are_those_of_the_calendar() {
        let told = |y: u32, m: u32, d: u32, h: u32, min: u32, s: u32| {
            ((y - 1980) << 9 | m << 5 | d) << 16 | h << 11 | min << 5 | (s / 2)
        };
        assert_eq!(dos_time(TIME), told(2024, 2, 29, 12, 34, 56));
        assert_eq!(dos_time(TIME + 86_400), told(2024, 3, 1, 12, 34, 56));
        assert_eq!(dos_time(0), told(1980, 1, 1, 0, 0, 0));
        assert_eq!(dos_time(978_307_199), told(2000, 12, 31, 23, 59, 58));
    }
}
