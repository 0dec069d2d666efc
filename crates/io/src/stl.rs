//! Stereolithography files (STL): a triangle soup, as text or binary.
//!
//! Facets have no vertex indices, so corners with equal positions become one vertex. That is exact: nothing
//! moves.

mod soup;
mod text;
mod write;

use std::io::{self, Write};

use lodsmith_core::numbers::counted;
use lodsmith_core::{MeshError, Positions, TriMesh};

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::{Contents, Loaded};
use crate::options::{PROGRESS_RECORDS, ReadOptions, SharedProgress, WriteOptions};
use soup::Soup;

/// Size of the header and of a facet in a binary file, in bytes.
const HEADER: usize = 84;
const FACET: usize = 50;

/// Reads the bytes of an STL file.
///
/// The size decides whether it is binary, not the first word. Corners with equal positions become one vertex
/// (0 and -0 are equal), with a note; facet normals are ignored, since the positions define them. Several
/// solids become one mesh. Cost: O(facets).
///
/// # Errors
/// [`ReadError::Malformed`] if the file is truncated or has an invalid line of text; [`ReadError::NoFaces`].
///
/// Source: the format has no standard; 3D Systems' "StereoLithography Interface Specification" (1988) and practice.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    // The caller that opens the file checks its size against the limits; memory here is proportional to it.
    let mut soup = if is_text(bytes) { text::read(bytes)? } else { read_binary(bytes, &options.progress)? };
    if soup.triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: 0 });
    }
    let corners = soup.triangles.len() * 3;
    let positions: Vec<[f32; 3]> =
        soup.corners.into_keys().into_iter().map(|key| key.map(f32::from_bits)).collect();
    if positions.len() < corners {
        soup.warnings.push(Warning::note(format!(
            "STL has no vertex indices: {corners} facet corners were merged into {} vertices by equal position",
            positions.len()
        )));
    }
    let contents =
        Contents { meshes: soup.solids.max(1), polygons: soup.triangles.len(), ..Contents::default() };
    let mesh = TriMesh::new(Positions::F32(positions), bytemuck::allocation::cast_vec(soup.triangles))?;
    Ok(Loaded::new(mesh, Format::Stl, contents, soup.warnings))
}

/// Writes a mesh as STL: binary, or text if the options request it.
///
/// Facet normals are computed from the positions, zero for facets without area. Returns a warning for each
/// thing that STL cannot carry: attributes, and double precision if rounding changes a position.
///
/// # Errors
/// The errors of the stream.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    write::write(mesh, options.ascii, out)
}

/// Returns the number of facets in the header of a binary file.
fn facet_count_in_header(bytes: &[u8]) -> Option<u32> {
    bytes.get(80..HEADER).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b))
}

/// Returns true if a file is text. Many binary files begin with `solid` too, so a size that matches the count
/// decides first.
fn is_text(bytes: &[u8]) -> bool {
    if facet_count_in_header(bytes)
        .is_some_and(|n| HEADER as u64 + FACET as u64 * u64::from(n) == bytes.len() as u64)
    {
        return false;
    }
    // Text has no zero byte; a binary count and the first floats nearly always do.
    let head = &bytes[..bytes.len().min(1024)];
    let word = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let begins = word.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    let has_facet = || head.windows(5).any(|w| w.eq_ignore_ascii_case(b"facet"));
    !head.contains(&0) && (begins || has_facet())
}

fn read_binary(bytes: &[u8], progress: &SharedProgress) -> Result<Soup, ReadError> {
    let present = bytes.len();
    let Some(count) = facet_count_in_header(bytes) else {
        return Err(ReadError::file(format!(
            "{present} bytes are not an STL file: a binary file has at least {HEADER}, a text file begins with `solid`"
        )));
    };
    let mut expected = HEADER as u64 + FACET as u64 * u64::from(count);
    // Programs that write while they compute may leave the count as 0.
    let behind = (present - HEADER) / FACET;
    let is_uncounted = count == 0 && behind > 0 && (present - HEADER).is_multiple_of(FACET);
    let count = if is_uncounted { u32::try_from(behind).unwrap_or(0) } else { count };
    if is_uncounted {
        expected = present as u64;
    }
    if expected > present as u64 {
        return Err(ReadError::file(format!(
            "the header claims {count} facets, which take {expected} bytes, but the file has {present}: it is cut off, \
             or the header is wrong"
        )));
    }
    let count = count as usize;
    if count * 3 >= u32::MAX as usize {
        return Err(MeshError::TooLarge { what: "corners", count: count * 3 }.into());
    }
    let mut soup = Soup::with_capacity(count);
    soup.solids = 1;
    let mut attributes = 0u8;
    let records = &bytes[HEADER..expected as usize];
    for (i, record) in records.as_chunks::<FACET>().0.iter().enumerate() {
        if i.is_multiple_of(PROGRESS_RECORDS) {
            progress.set(i as u64, count as u64);
        }
        let float =
            |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
        let triangle = [12, 24, 36].map(|at| soup.corner([float(at), float(at + 4), float(at + 8)]));
        soup.triangles.push(triangle);
        attributes |= record[48] | record[49];
    }
    progress.set(count as u64, count as u64);
    if attributes != 0 {
        soup.warnings.push(Warning::lost("facet colours (attribute bytes) are not supported: dropped"));
    }
    if is_uncounted {
        let facets = counted(behind, "facet is", "facets are");
        soup.warnings
            .push(Warning::note(format!("the header claims no facets, but {facets} behind it: read")));
    }
    if present as u64 > expected {
        let more = counted((present as u64 - expected) as usize, "byte", "bytes");
        soup.warnings.push(Warning::note(format!("after the last facet: {more}, ignored")));
    }
    Ok(soup)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(header: &str, facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        bytes.resize(80, b' ');
        bytes.extend((facets.len() as u32).to_le_bytes());
        for f in facets {
            bytes.extend([0; 12]);
            f.as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    const TWO: [[[f32; 3]; 3]; 2] =
        [[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.]], [[-0., 0., 0.], [1., 1., -0.], [0., 1., 0.]]];

    #[test]
    fn corners_of_equal_position_become_one_vertex() {
        let got = read(&binary("solid, yet binary", &TWO), &ReadOptions::default()).unwrap();
        assert_eq!((got.mesh.face_count(), got.mesh.vertex_count()), (2, 4));
        assert_eq!(got.warnings.len(), 1);
        assert!(!got.warnings[0].data_lost);
    }

    #[test]
    fn facets_behind_a_count_of_zero_are_read() {
        let mut bytes = binary("", &TWO);
        bytes[80..84].fill(0);
        let got = read(&bytes, &ReadOptions::default()).unwrap();
        assert_eq!(got.mesh.face_count(), 2);
        assert!(got.warnings.iter().any(|w| w.text.contains("2 facets are behind it")), "{:?}", got.warnings);
        // Other bytes are no facets.
        bytes.push(0);
        assert!(matches!(read(&bytes, &ReadOptions::default()), Err(ReadError::NoFaces { .. })));
    }

    #[test]
    fn colours_are_lost_once() {
        let mut bytes = binary("", &TWO);
        let end = bytes.len();
        bytes[end - 1] = 0x80;
        bytes[end - 51] = 0x80;
        let got = read(&bytes, &ReadOptions::default()).unwrap();
        assert_eq!(got.warnings.iter().filter(|w| w.data_lost).count(), 1);
    }

    #[test]
    fn the_error_of_a_truncated_file_has_both_sizes() {
        let bytes = binary("solid", &TWO);
        let e = read(&bytes[..150], &ReadOptions::default()).unwrap_err().to_string();
        assert_eq!(
            e,
            "the header claims 2 facets, which take 184 bytes, but the file has 150: it is cut off, or the header is wrong"
        );
    }
}
