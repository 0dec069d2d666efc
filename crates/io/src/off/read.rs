//! Parser of OFF files.

use lodsmith_core::numbers::counted;
use lodsmith_core::polygon::Triangulator;
use lodsmith_core::{Positions, TriMesh, VertexId};

use crate::attributes::{NO_ALPHA, unit_colors, unit_normals};
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt_of_bytes;
use crate::format::Format;
use crate::lines::Lines;
use crate::loaded::{Contents, Loaded};
use crate::numbers::parse_short_integer;
use crate::options::ReadOptions;
use crate::sniff::off_prefix;

/// Reads the bytes of an OFF file.
///
/// Colours are in 0..1, or in 0..255 if any is above 1. With the prefix `4` positions are divided by their
/// weight. Polygons are cut into triangles; faces with fewer than three corners are dropped with a warning.
/// The count of edges is ignored and may be missing; so may the word `OFF`. Cost: O(bytes). No memory is
/// allocated by the header's counts alone.
///
/// # Errors
/// [`ReadError::Malformed`] with the line: counts beyond the size of the file, fewer vertices or faces than
/// in the header, a word that is not a number, an index out of range. [`ReadError::Unsupported`] for the
/// binary variant and for dimensions other than 3.
pub fn read(bytes: &[u8], _options: &ReadOptions) -> Result<Loaded, ReadError> {
    let mut lines = Lines::new(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let kind = header(&mut lines)?;
    let [vertex_count, face_count] = counts(&mut lines, &kind)?;
    let mut notes = OffNotes::default();
    let vertices = vertices(&mut lines, &kind, vertex_count, &mut notes)?;
    let triangles = faces(&mut lines, &vertices.positions, face_count, &mut notes)?;
    finish(vertices, triangles, face_count, notes)
}

/// The attributes of vertices.
#[derive(Default)]
struct VertexLayout {
    has_uvs: bool,
    has_colors: bool,
    has_normals: bool,
    has_weights: bool,
}

impl VertexLayout {
    /// Returns the minimum count of numbers per vertex.
    fn numbers(&self) -> usize {
        3 + usize::from(self.has_weights)
            + 3 * usize::from(self.has_normals)
            + 3 * usize::from(self.has_colors)
            + 2 * usize::from(self.has_uvs)
    }
}

#[derive(Default)]
struct OffNotes {
    /// Number of vertices followed by extra words on their line.
    long_vertices: usize,
    /// Number of faces followed by extra words on their line, which are colours.
    colored_faces: usize,
    small_faces: usize,
}

/// Moves to the next word, across blank lines and comments; returns false at the end of the file.
#[inline]
fn go_to_word(lines: &mut Lines<'_>) -> bool {
    while lines.at_line_end() {
        if lines.at_end() {
            return false;
        }
        lines.next_line();
    }
    true
}

fn header(lines: &mut Lines<'_>) -> Result<VertexLayout, ReadError> {
    if !go_to_word(lines) {
        return Err(ReadError::file("no OFF header: the file is empty"));
    }
    let word = lines.word();
    // A comment may follow without a blank.
    let word = word.split(|&b| b == b'#').next().unwrap_or_default();
    let Some(prefix) = off_prefix(word) else {
        if word.iter().all(u8::is_ascii_digit) {
            return Ok(VertexLayout::default());
        }
        return Err(lines.error(format!("`{}` is not an OFF header", excerpt_of_bytes(word))));
    };
    lines.skip_bytes(word.len());
    if !lines.at_line_end() && lines.word().eq_ignore_ascii_case(b"BINARY") {
        return Err(ReadError::Unsupported("binary OFF is not read; save it as text".to_owned()));
    }
    if prefix.contains(&b'n') {
        go_to_word(lines);
        let dimension = lines.whole()?;
        if dimension != 3 {
            return Err(ReadError::Unsupported(format!(
                "OFF of {dimension} dimensions is not supported, only of 3"
            )));
        }
    }
    Ok(VertexLayout {
        has_uvs: prefix.starts_with(b"ST"),
        has_colors: prefix.contains(&b'C'),
        has_normals: prefix.contains(&b'N'),
        has_weights: prefix.contains(&b'4'),
    })
}

/// Reads the counts of vertices and faces, and checks them against the size of the file.
fn counts(lines: &mut Lines<'_>, kind: &VertexLayout) -> Result<[usize; 2], ReadError> {
    let mut counts = [0usize; 2];
    for (count, what) in counts.iter_mut().zip(["vertices", "faces"]) {
        if !go_to_word(lines) {
            return Err(lines.error(format!("the file ends before its number of {what}")));
        }
        let number = lines.whole()?;
        if !lines.at_word_end() {
            return Err(lines.expected_error("whole number"));
        }
        *count = usize::try_from(number)
            .map_err(|_| lines.error(format!("the header says {number} {what}, which is impossible")))?;
    }
    // A number takes a digit and a blank; a face has at least its corner count.
    for (count, what, bytes) in [(counts[0], "vertices", 2 * kind.numbers()), (counts[1], "faces", 2)] {
        // The last line may have no end.
        let room = (lines.remaining().len() + 1) / bytes;
        if count > room {
            return Err(lines
                .error(format!("the header says {count} {what}, but the file has room for {room} at most")));
        }
    }
    lines.next_line();
    Ok(counts)
}

#[derive(Default)]
struct OffVertices {
    positions: Vec<[f64; 3]>,
    needs_f64: bool,
    normals: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
}

fn vertices(
    lines: &mut Lines<'_>,
    kind: &VertexLayout,
    count: usize,
    notes: &mut OffNotes,
) -> Result<OffVertices, ReadError> {
    let mut vertices = OffVertices::default();
    for vertex in 0..count {
        let missing = |lines: &Lines<'_>| {
            lines.error(format!("the file ends at vertex {vertex} of the {count} declared in the header"))
        };
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            if !go_to_word(lines) {
                return Err(missing(lines));
            }
            let number = lines.decimal()?;
            vertices.needs_f64 = vertices.needs_f64 || number.needs_f64();
            *coordinate = number.value;
        }
        let next = |lines: &mut Lines<'_>| {
            if go_to_word(lines) { lines.decimal().map(|d| d.value) } else { Err(missing(lines)) }
        };
        if kind.has_weights {
            let weight = next(lines)?;
            position = position.map(|c| c / weight);
        }
        vertices.positions.push(position);
        if kind.has_normals {
            let mut normal = [0.0; 3];
            for n in &mut normal {
                *n = next(lines)? as f32;
            }
            vertices.normals.push(normal);
        }
        if kind.has_colors {
            let mut color = [0.0, 0.0, 0.0, NO_ALPHA];
            for c in &mut color[..3] {
                *c = next(lines)? as f32;
            }
            // Alpha is optional; the count of remaining numbers on the line decides.
            let more = numbers_ahead(lines);
            if more == if kind.has_uvs { 3 } else { 1 } {
                color[3] = next(lines)? as f32;
            }
            vertices.colors.push(color);
        }
        if kind.has_uvs {
            let uv = [next(lines)? as f32, next(lines)? as f32];
            vertices.uvs.push(uv);
        }
        notes.long_vertices += usize::from(!lines.at_line_end());
        lines.next_line();
    }
    Ok(vertices)
}

/// Counts the remaining words of this line, up to four.
fn numbers_ahead(lines: &Lines<'_>) -> usize {
    let mut ahead = lines.clone();
    let mut count = 0;
    while count < 4 && !ahead.at_line_end() {
        ahead.skip_bytes(ahead.word().len());
        count += 1;
    }
    count
}

fn faces(
    lines: &mut Lines<'_>,
    positions: &[[f64; 3]],
    count: usize,
    notes: &mut OffNotes,
) -> Result<Vec<[u32; 3]>, ReadError> {
    let mut triangles = Vec::new();
    let mut triangulator = Triangulator::default();
    let (mut corners, mut points, mut cut) = (Vec::new(), Vec::new(), Vec::new());
    for face in 0..count {
        let missing = |lines: &Lines<'_>| {
            lines.error(format!("the file ends at face {face} of the {count} declared in the header"))
        };
        if !go_to_word(lines) {
            return Err(missing(lines));
        }
        let size = lines.whole()?;
        if !lines.at_word_end() || size < 0 {
            return Err(lines.error("a face begins with the number of its corners"));
        }
        corners.clear();
        for _ in 0..size {
            lines.skip_blanks();
            let index = match parse_short_integer(lines.remaining()) {
                Some((number, length)) => {
                    lines.skip_bytes(length);
                    i64::from(number)
                }
                None if go_to_word(lines) => lines.whole()?,
                None => return Err(missing(lines)),
            };
            if !lines.at_word_end() {
                return Err(lines.expected_error("whole number"));
            }
            if index as u64 >= positions.len() as u64 {
                let have = positions.len();
                return Err(lines.error(format!(
                    "face {face} names vertex {index}, but the file has {have}, counted from 0"
                )));
            }
            corners.push(index as u32);
        }
        match corners[..] {
            [a, b, c] => triangles.push([a, b, c]),
            [] | [_] | [_, _] => notes.small_faces += 1,
            _ => {
                points.clear();
                points.extend(corners.iter().map(|&i| positions[i as usize]));
                triangulator.triangulate(&points, &mut cut);
                triangles.extend(cut.iter().map(|t: &[u32; 3]| t.map(|k| corners[k as usize])));
            }
        }
        notes.colored_faces += usize::from(!lines.at_line_end());
        lines.next_line();
    }
    Ok(triangles)
}

fn finish(
    mut vertices: OffVertices,
    triangles: Vec<[u32; 3]>,
    face_count: usize,
    notes: OffNotes,
) -> Result<Loaded, ReadError> {
    let mut warnings = Vec::new();
    if notes.long_vertices > 0 {
        let text = format!(
            "{} with more numbers than the header declares: the rest was skipped",
            counted(notes.long_vertices, "vertex", "vertices")
        );
        warnings.push(Warning::lost(text));
    }
    if notes.colored_faces > 0 {
        warnings.push(Warning::note(format!(
            "colours of {}: skipped",
            counted(notes.colored_faces, "face", "faces")
        )));
    }
    if notes.small_faces > 0 {
        let faces = counted(notes.small_faces, "face", "faces");
        warnings.push(Warning::note(format!("{faces} of fewer than three corners: dropped")));
    }
    unit_normals(&mut vertices.normals);
    unit_colors(&mut vertices.colors);
    let positions = if vertices.needs_f64 {
        Positions::F64(vertices.positions)
    } else {
        Positions::F32(vertices.positions.into_iter().map(|p| p.map(|c| c as f32)).collect())
    };
    let triangles: Vec<[VertexId; 3]> = bytemuck::allocation::cast_vec(triangles);
    let mut mesh = TriMesh::new(positions, triangles)?;
    let mut contents =
        Contents { meshes: 1, polygons: face_count - notes.small_faces, ..Contents::default() };
    if !vertices.normals.is_empty() {
        contents.attributes.push("normals".to_owned());
        mesh.set_normals(Some(vertices.normals))?;
    }
    if !vertices.uvs.is_empty() {
        contents.attributes.push("uvs".to_owned());
        mesh.set_uvs(Some(vertices.uvs))?;
    }
    if !vertices.colors.is_empty() {
        contents.attributes.push("colors".to_owned());
        mesh.set_colors(Some(vertices.colors))?;
    }
    Ok(Loaded::new(mesh, Format::Off, contents, warnings))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Loaded {
        read(text.as_bytes(), &ReadOptions::default()).unwrap()
    }

    #[test]
    fn headers_of_every_style_are_read() {
        for text in [
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
            "# c\n\nOFF# c\n\n3 1 # c\n\n0 0 0 # c\n1 0\n0\n\n0 1 0\n# c\n3 0 1 2\n",
            "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "nOFF 3\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 4 0 4\n3 0 1 2\n",
        ] {
            let got = read_text(text);
            assert_eq!(
                got.mesh.positions(),
                &Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
            );
            assert_eq!(got.mesh.face_count(), 1, "{text}");
            assert!(got.warnings.is_empty());
        }
    }

    #[test]
    fn attributes_are_in_the_order_of_the_format() {
        let got = read_text(
            "STCNOFF\n3 1 0\n0 0 0 0 0 1 255 0 51 0.5 0.25\n1 0 0 0 0 1 0 0 0 255 0 0\n0 1 0 0 0 1 0 0 0 0 0\n3 0 1 2\n",
        );
        assert_eq!(got.mesh.normals().unwrap(), [[0.0, 0.0, 1.0]; 3]);
        assert_eq!(
            got.mesh.colors().unwrap(),
            [[1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
        );
        assert_eq!(got.mesh.uvs().unwrap()[0], [0.5, 0.25]);
        assert_eq!(got.contents.attributes, ["normals", "uvs", "colors"]);
        let got = read_text("COFF\n3 1 0\n0 0 0 1 0 0.5\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n");
        assert_eq!(got.mesh.colors().unwrap()[0], [1.0, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn numbers_after_a_face_are_its_colour() {
        let got = read_text("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n2 0 1\n");
        assert_eq!((got.mesh.face_count(), got.contents.polygons), (2, 1));
        assert_eq!(got.warnings[0].text, "colours of 1 face: skipped");
        assert_eq!(got.warnings[1].text, "1 face of fewer than three corners: dropped");
    }
}
