//! Parser of OBJ files.
//!
//! The file is cut into sections at line ends, which are parsed in parallel and joined in order. Values that
//! depend on earlier sections (the number of positions, the line number) are adjusted then. If there is an
//! error, the file is parsed again as one section, so that the message names the first wrong line.

mod mesh;
mod notes;

use lodsmith_core::Positions;
use rayon::prelude::*;

use super::wedges::NONE;
use crate::attributes::{NO_ALPHA, NO_COLOR};
use crate::error::ReadError;
use crate::lines::{Lines, ends_line};
use crate::loaded::Loaded;
use crate::material::{FacePosition, Heading, Headings};
use crate::numbers::parse_short_integer;
use crate::options::ReadOptions;
use notes::ObjNotes;

/// Reads the bytes of an OBJ file in UTF-8 or any other encoding that contains ASCII.
///
/// Faces keep their order; polygons are cut into triangles. Corners that share position, texture coordinates
/// and normal share a wedge, and a mesh without seams has no vertex map. A face may refer to positions that
/// come after it. If some corners have texture coordinates or normals and others have none, the latter get
/// zeros, and there is a warning. `nan` and `inf` are numbers. Lines that begin with an unknown word are
/// skipped with a warning. Cost: O(bytes); memory about 1.5 times the size of the file at most, besides the
/// mesh.
///
/// # Errors
/// [`ReadError::Malformed`] with the line: a word that is not a number, a position with fewer than three
/// coordinates, an index of a position that is 0 or out of range. [`ReadError::Mesh`] if the mesh is too large for 32-bit
/// ids.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let sections_or_whole = |precise: bool| match read_sections(bytes, precise) {
        Some(section) => Ok(section),
        None => Section::read(bytes, UNKNOWN_COUNTS, true, precise),
    };
    let mut section = sections_or_whole(false)?;
    if section.wants_precision {
        section = sections_or_whole(true)?;
    }
    let counts = section.counts();
    // The same error again, with its line.
    let first_error = |kind: usize| {
        let mut tested = UNKNOWN_COUNTS;
        tested[kind] = counts[kind];
        let named = Section::read(bytes, tested, true, true).err();
        named.unwrap_or_else(|| ReadError::file("a face refers to an element that does not exist"))
    };
    if !section.in_range(0) {
        return Err(first_error(0));
    }
    for kind in (1..3).filter(|&kind| !section.in_range(kind)).collect::<Vec<_>>() {
        let corners = section.leave_out_missing(kind);
        if corners > 0 {
            section.notes.missing.push((first_error(kind).to_string(), corners));
        }
    }
    section.finish(options)
}

/// Parses the sections of a file in parallel; `None` if one of them depends on earlier ones, because of a
/// negative index or for the line number of an error.
fn read_sections(bytes: &[u8], precise: bool) -> Option<Section> {
    let pieces = sections(bytes, rayon::current_num_threads());
    let read = |(i, piece): (usize, &&[u8])| Section::read(piece, UNKNOWN_COUNTS, i == 0, precise).ok();
    Section::joined(pieces.par_iter().enumerate().map(read).collect::<Option<Vec<_>>>()?)
}

/// Guessed: parsing this much takes a few milliseconds, far more than handing it to a thread.
pub(super) const MIN_SECTION_BYTES: usize = 1 << 20;

/// Cuts a file at line ends into at most `count` sections.
fn sections(bytes: &[u8], count: usize) -> Vec<&[u8]> {
    let count = count.clamp(1, bytes.len() / MIN_SECTION_BYTES + 1);
    let (mut rest, mut pieces) = (bytes, Vec::with_capacity(count));
    for left in (2..=count).rev() {
        let aim = rest.len() / left;
        let is_end = |&n: &usize| ends_line(&rest[..n]);
        let Some(end) = memchr::memchr_iter(b'\n', &rest[aim..]).map(|n| aim + n).find(is_end) else { break };
        let (piece, after) = rest.split_at(end + 1);
        pieces.push(piece);
        rest = after;
    }
    pieces.push(rest);
    pieces
}

/// Limits on position, texture coordinate and normal indices while the counts are unknown.
pub(super) const UNKNOWN_COUNTS: [usize; 3] = [NONE as usize; 3];

/// An index of a texture coordinate or a normal that cannot exist.
const MISSING: u32 = NONE - 1;

/// The three kinds of indices of a corner, in this order.
const INDEX_KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// The parsed contents of a section of the file.
pub(super) struct Section {
    /// Single precision until a number needs double.
    positions: Positions,
    /// True if that happened after other positions: the section must be parsed again in double precision.
    pub(super) wants_precision: bool,
    /// As many as positions, or none.
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Triangular faces: position, texture coordinate and normal index of each corner. The last two are as
    /// long as the first if they are `Own`, else empty.
    triangles: [Vec<[u32; 3]>; 3],
    /// The first is always `Own`.
    storage: [Storage; 3],
    /// Faces with more than three corners.
    polygons: Vec<Polygon>,
    polygon_corners: Vec<[u32; 3]>,
    /// The largest index of each kind, plus one.
    ends: [u32; 3],
    /// True if the file begins with this section, so that its counts are the counts of the file.
    is_first: bool,
    line_count: usize,
    notes: ObjNotes,
    headings: Headings,
}

/// Storage of the indices of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Storage {
    /// No triangle has indices.
    #[default]
    Absent,
    /// All triangles have the same indices as for their positions.
    Same,
    /// The indices have their own buffer.
    Own,
}

/// A face with more than three corners.
struct Polygon {
    /// Number of triangles before it.
    after: usize,
    /// Number of corners.
    size: usize,
}

impl Section {
    /// Creates an empty section; `is_first` if the file begins with it, `precise` to use double precision
    /// from the start.
    pub(super) fn new(is_first: bool, precise: bool) -> Self {
        Self {
            positions: if precise { Positions::F64(Vec::new()) } else { Positions::F32(Vec::new()) },
            wants_precision: false,
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            triangles: Default::default(),
            storage: Default::default(),
            polygons: Vec::new(),
            polygon_corners: Vec::new(),
            ends: [0; 3],
            is_first,
            line_count: 0,
            notes: ObjNotes::default(),
            headings: Headings::default(),
        }
    }

    /// Parses a piece; an index of `counts` or more is an error.
    fn read(bytes: &[u8], counts: [usize; 3], is_first: bool, precise: bool) -> Result<Self, ReadError> {
        let mut section = Self::new(is_first, precise);
        section.parse_lines(bytes, counts)?;
        Ok(section)
    }

    /// Joins consecutive sections.
    pub(super) fn joined(sections: Vec<Self>) -> Option<Self> {
        sections.into_iter().reduce(|mut all, section| {
            all.append(section);
            all
        })
    }

    /// Parses more whole lines; an index of `counts` or more is an error.
    pub(super) fn parse_lines(&mut self, bytes: &[u8], counts: [usize; 3]) -> Result<(), ReadError> {
        let section = self;
        let mut lines = Lines::new(bytes);
        let (mut corners, mut lengths) = (Vec::new(), [0; 3]);
        while !lines.at_end() {
            lines.skip_blanks();
            match lines.remaining() {
                [b'v', b' ' | b'\t' | b'\r' | b'\n', ..] | [b'v'] => {
                    lines.skip_bytes(1);
                    section.vertex(&mut lines)?;
                    lines.next_line();
                }
                [b'f', b' ' | b'\t' | b'\r' | b'\n', ..] | [b'f'] => {
                    lines.skip_bytes(1);
                    section.face(&mut lines, counts, &mut lengths, &mut corners)?;
                    lines.next_line();
                }
                [b'v', b'n', b' ' | b'\t' | b'\r' | b'\n', ..] | [b'v', b'n'] => {
                    lines.skip_bytes(2);
                    let normal = coordinates::<3>(&mut lines, 3, "a normal")?;
                    section.normals.push(normal.map(|c| c as f32));
                    lines.next_line();
                }
                [b'v', b't', b' ' | b'\t' | b'\r' | b'\n', ..] | [b'v', b't'] => {
                    lines.skip_bytes(2);
                    let uv = coordinates::<2>(&mut lines, 1, "a texture coordinate")?;
                    section.uvs.push(uv.map(|c| c as f32));
                    lines.next_line();
                }
                [b'\n' | b'#', ..] | [] => lines.next_line(),
                _ => {
                    section.parse_other_line(&lines);
                    lines.next_logical_line();
                }
            }
        }
        section.line_count += lines.line() - 1;
        Ok(())
    }

    /// Appends the following section.
    fn append(&mut self, mut next: Self) {
        if !self.colors.is_empty() || !next.colors.is_empty() {
            self.colors.resize(self.positions.len(), NO_COLOR);
            self.colors.append(&mut next.colors);
        }
        self.wants_precision |= next.wants_precision;
        match (&mut self.positions, &mut next.positions) {
            (Positions::F32(all), Positions::F32(these)) => all.append(these),
            (Positions::F64(all), Positions::F64(these)) => all.append(these),
            (_, these) if these.is_empty() => {}
            (all, these) if all.is_empty() => std::mem::swap(all, these),
            _ => self.wants_precision = true,
        }
        self.uvs.append(&mut next.uvs);
        self.normals.append(&mut next.normals);
        let before = self.triangles[0].len();
        let place = FacePosition { triangles: before, polygons: self.polygons.len() };
        self.headings.append(std::mem::take(&mut next.headings), place);
        for kind in 1..3 {
            if self.triangles[0].is_empty() {
                self.storage[kind] = next.storage[kind];
            } else if !next.triangles[0].is_empty() && self.storage[kind] != next.storage[kind] {
                self.make_own_buffer(kind);
                next.make_own_buffer(kind);
            }
        }
        for (all, these) in self.triangles.iter_mut().zip(&mut next.triangles) {
            all.append(these);
        }
        self.polygons.extend(next.polygons.iter().map(|p| Polygon { after: p.after + before, size: p.size }));
        self.polygon_corners.append(&mut next.polygon_corners);
        for (end, next) in self.ends.iter_mut().zip(next.ends) {
            *end = next.max(*end);
        }
        self.notes.append(next.notes, self.line_count);
        self.line_count += next.line_count;
    }

    #[inline]
    fn vertex(&mut self, lines: &mut Lines<'_>) -> Result<(), ReadError> {
        let mut position = [0.0; 3];
        let mut needs_f64 = false;
        for (k, coordinate) in position.iter_mut().enumerate() {
            if lines.at_line_end() {
                return Err(too_few(lines, "a position", 3, k));
            }
            let number = lines.decimal()?;
            needs_f64 = needs_f64 || number.needs_f64();
            *coordinate = number.value;
        }
        if !lines.at_line_end() {
            let mut more = [0.0f32; 4];
            let mut count = 0;
            while count < 4 && !lines.at_line_end() {
                more[count] = lines.decimal()?.value as f32;
                count += 1;
            }
            // A single extra number is a weight, which plain meshes do not use.
            if count >= 3 {
                self.colors.resize(self.positions.len(), NO_COLOR);
                self.notes.colored += 1;
                self.colors.push(if count == 4 { more } else { [more[0], more[1], more[2], NO_ALPHA] });
            }
        }
        match &mut self.positions {
            Positions::F64(all) => all.push(position),
            Positions::F32(all) if needs_f64 && all.is_empty() => {
                self.positions = Positions::F64(vec![position])
            }
            Positions::F32(all) => {
                self.wants_precision |= needs_f64;
                all.push(position.map(|c| c as f32));
            }
        }
        Ok(())
    }

    #[inline]
    fn face(
        &mut self,
        lines: &mut Lines<'_>,
        counts: [usize; 3],
        lengths: &mut [usize; 3],
        corners: &mut Vec<[u32; 3]>,
    ) -> Result<(), ReadError> {
        let mut first = [[NONE; 3]; 3];
        let mut size = 0;
        while size < 3 && !lines.at_line_end() {
            first[size] = self.corner(lines, counts, lengths)?;
            size += 1;
        }
        if size < 3 {
            self.small_faces(&first);
            return Ok(());
        }
        if !lines.at_line_end() {
            corners.clear();
            corners.extend_from_slice(&first);
            while !lines.at_line_end() {
                corners.push(self.corner(lines, counts, lengths)?);
            }
            self.polygons.push(Polygon { after: self.triangles[0].len(), size: corners.len() });
            self.polygon_corners.extend_from_slice(corners);
            self.update_index_ends(corners);
            return Ok(());
        }
        self.update_index_ends(&first);
        let [a, b, c] = first;
        let positions = [a[0], b[0], c[0]];
        for kind in 1..3 {
            let triangle = [a[kind], b[kind], c[kind]];
            match self.storage[kind] {
                Storage::Own => self.triangles[kind].push(triangle),
                Storage::Same if triangle == positions => {}
                Storage::Absent if triangle == [NONE; 3] => {}
                _ => self.store_differing_index(kind, triangle, positions),
            }
        }
        self.triangles[0].push(positions);
        Ok(())
    }

    /// Parses the indices of a corner.
    #[inline(always)]
    fn corner(
        &self,
        lines: &mut Lines<'_>,
        counts: [usize; 3],
        lengths: &mut [usize; 3],
    ) -> Result<[u32; 3], ReadError> {
        let mut corner = [NONE; 3];
        corner[0] = self.index(lines, 0, counts, lengths)?;
        if lines.peek() == b'/' {
            lines.skip_bytes(1);
            if lines.peek() != b'/' && !lines.at_word_end() {
                corner[1] = self.index(lines, 1, counts, lengths)?;
            }
            if lines.peek() == b'/' {
                lines.skip_bytes(1);
                if !lines.at_word_end() {
                    corner[2] = self.index(lines, 2, counts, lengths)?;
                }
            }
        }
        if !lines.at_word_end() {
            return Err(lines.expected_error("corner of a face"));
        }
        Ok(corner)
    }

    /// Updates the largest indices.
    #[inline(always)]
    fn update_index_ends(&mut self, corners: &[[u32; 3]]) {
        for corner in corners {
            for (end, index) in self.ends.iter_mut().zip(corner) {
                // A missing index (`NONE`) wraps to 0.
                *end = index.wrapping_add(1).max(*end);
            }
        }
    }

    /// Counts a face with fewer than three corners; its indices are checked all the same.
    #[cold]
    fn small_faces(&mut self, corners: &[[u32; 3]]) {
        self.notes.small_faces += 1;
        self.update_index_ends(corners);
    }

    #[cold]
    fn store_differing_index(&mut self, kind: usize, triangle: [u32; 3], positions: [u32; 3]) {
        if self.triangles[0].is_empty() && triangle == positions {
            self.storage[kind] = Storage::Same;
        } else {
            self.make_own_buffer(kind);
            self.triangles[kind].push(triangle);
        }
    }

    /// Gives the indices of a kind their own buffer.
    fn make_own_buffer(&mut self, kind: usize) {
        match self.storage[kind] {
            Storage::Own => {}
            Storage::Absent => self.triangles[kind] = vec![[NONE; 3]; self.triangles[0].len()],
            Storage::Same => self.triangles[kind] = self.triangles[0].clone(),
        }
        self.storage[kind] = Storage::Own;
    }

    /// Parses an index. `lengths` has the length of the last index of each kind: the next index mostly has
    /// the same length, so its end can be predicted before its digits are examined.
    #[inline(always)]
    fn index(
        &self,
        lines: &mut Lines<'_>,
        kind: usize,
        counts: [usize; 3],
        lengths: &mut [usize; 3],
    ) -> Result<u32, ReadError> {
        if let Some((number, length)) = parse_short_integer(lines.remaining())
            && number > 0
            && (number as usize) <= counts[kind]
        {
            if length != lengths[kind] {
                update_length(&mut lengths[kind], length);
            }
            lines.skip_bytes(lengths[kind]);
            return Ok(number - 1);
        }
        self.any_index(lines, kind, counts)
    }

    #[cold]
    fn any_index(&self, lines: &mut Lines<'_>, kind: usize, counts: [usize; 3]) -> Result<u32, ReadError> {
        let have = self.counts();
        let number = lines.whole()?;
        let index = if number > 0 { number - 1 } else { have[kind] as i64 + number };
        // As unsigned, negative indices are out of range.
        if number <= 0 && !self.is_first {
            return Err(lines.error("an index that counts backwards needs the whole file"));
        }
        if number == 0 || index as u64 >= counts[kind] as u64 {
            // Texture coordinates and normals can be left out, once all are counted.
            if kind > 0 && counts[kind] == UNKNOWN_COUNTS[kind] {
                return Ok(MISSING);
            }
            return Err(bad_index(lines, number, kind, have, counts));
        }
        Ok(index as u32)
    }

    #[cold]
    fn parse_other_line(&mut self, lines: &Lines<'_>) {
        let word = lines.word();
        let notes = &mut self.notes;
        let heading = Heading::ALL.into_iter().find(|heading| heading.keyword().as_bytes() == word);
        if let Some(heading) = heading {
            notes.objects += usize::from(heading == Heading::Object);
            let at = FacePosition { triangles: self.triangles[0].len(), polygons: self.polygons.len() };
            self.headings.add_heading(heading, &lines.rest_with_continuations()[word.len()..], at);
            return;
        }
        match word {
            b"mtllib" => self.headings.add_libraries(&lines.rest_with_continuations()[word.len()..]),
            b"l" | b"p" => notes.lines_and_points += 1,
            b"vp" | b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm"
            | b"trim" | b"hole" | b"scrv" | b"sp" | b"end" | b"con" => notes.free_forms += 1,
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"maplib" | b"usemap" | b"shadow_obj"
            | b"trace_obj" | b"ctech" | b"stech" => {}
            _ => {
                let line = self.line_count + lines.line();
                notes.unknown_lines.get_or_insert_with(|| (0, line, word.to_vec())).0 += 1;
            }
        }
    }

    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    /// Returns true if every index is in range.
    pub(super) fn indices_in_range(&self) -> bool {
        (0..3).all(|kind| self.in_range(kind))
    }

    /// Returns true if every index of a kind is in range.
    fn in_range(&self, kind: usize) -> bool {
        self.ends[kind] as usize <= self.counts()[kind]
    }

    /// Leaves out the indices of a kind that are out of range; returns the number of corners.
    #[cold]
    fn leave_out_missing(&mut self, kind: usize) -> usize {
        let count = self.counts()[kind];
        self.make_own_buffer(kind);
        let mut corners = 0;
        let in_triangles = self.triangles[kind].as_flattened_mut().iter_mut();
        let in_polygons = self.polygon_corners.iter_mut().map(|corner| &mut corner[kind]);
        for index in in_triangles.chain(in_polygons) {
            if *index != NONE && *index as usize >= count {
                *index = NONE;
                corners += 1;
            }
        }
        if self.triangles[kind].as_flattened().iter().all(|&index| index == NONE) {
            (self.triangles[kind], self.storage[kind]) = (Vec::new(), Storage::Absent);
        }
        corners
    }
}

/// Not inlined, so that the caller keeps a branch, which the processor predicts.
#[cold]
#[inline(never)]
fn update_length(length: &mut usize, new: usize) {
    *length = new;
}

/// Parses N numbers, of which those after the first `least` may be missing; the rest of the line is left.
#[inline]
fn coordinates<const N: usize>(
    lines: &mut Lines<'_>,
    least: usize,
    what: &str,
) -> Result<[f64; N], ReadError> {
    let mut numbers = [0.0; N];
    for (k, number) in numbers.iter_mut().enumerate() {
        if lines.at_line_end() {
            if k < least {
                return Err(too_few(lines, what, least, k));
            }
            break;
        }
        *number = lines.decimal()?.value;
    }
    Ok(numbers)
}

#[cold]
fn too_few(lines: &Lines<'_>, what: &str, wanted: usize, got: usize) -> ReadError {
    let numbers = if wanted == 1 { "number" } else { "numbers" };
    lines.error(format!("{what} needs {wanted} {numbers}, but has {got}"))
}

#[cold]
fn bad_index(lines: &Lines<'_>, number: i64, kind: usize, have: [usize; 3], counts: [usize; 3]) -> ReadError {
    let what = INDEX_KINDS[kind];
    if number == 0 {
        return lines.error(format!("the face refers to {what} 0, but OBJ counts from 1"));
    }
    if number < 0 {
        return lines
            .error(format!("the face refers to {what} {number}, but only {} come before it", have[kind]));
    }
    if counts[kind] == UNKNOWN_COUNTS[kind] {
        return lines.error(format!("the face refers to {what} {number}, more than a mesh can have"));
    }
    lines.error(format!("the face refers to {what} {number}, but the file has {}", counts[kind]))
}

#[cfg(test)]
mod tests {
    use lodsmith_core::RegionId;

    use super::*;

    fn read_text(text: &str) -> Result<Loaded, ReadError> {
        read(text.as_bytes(), &ReadOptions::default())
    }

    fn triangles(loaded: &Loaded) -> Vec<[u32; 3]> {
        loaded.mesh.triangles().iter().map(|t| t.map(|w| w.0)).collect()
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    /// ```text
    ///   3---2
    ///   | / |
    ///   0---1
    /// ```
    #[test]
    fn faces_of_all_sizes_keep_their_order() {
        let got = read_text(&format!("{SQUARE}f 1 2 3\nf 1 2 3 4\nf 1 2\nf 3 4 1\n")).unwrap();
        assert_eq!(triangles(&got), [[0, 1, 2], [0, 1, 2], [0, 2, 3], [2, 3, 0]]);
        assert_eq!(got.contents.polygons, 3);
        assert_eq!(got.warnings[0].text, "1 face of fewer than three corners: dropped");
    }

    #[test]
    fn equal_indices_make_no_wedges_and_seams_do() {
        let vt = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
        let got = read_text(&format!("{SQUARE}{vt}f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")).unwrap();
        assert!(got.mesh.vertex_map().is_none());
        assert_eq!(got.mesh.uvs().unwrap()[2], [1.0, 1.0]);
        let got = read_text(&format!("{SQUARE}{vt}f 1/1 2/2 3/3\nf 1/4 3/3 4/1\n")).unwrap();
        assert_eq!(got.mesh.wedge_count(), 5);
        assert_eq!(triangles(&got), [[0, 1, 2], [3, 2, 4]]);
        assert_eq!(got.mesh.uvs().unwrap()[3], [0.0, 1.0]);
    }

    #[test]
    fn corners_without_attributes_get_zeros_and_a_warning() {
        let got = read_text(&format!("{SQUARE}f 1 2 3\nvn 0 0 2\nf 1//1 3//1 4//-1\n")).unwrap();
        assert_eq!(got.mesh.normals().unwrap()[0], [0.0; 3]);
        assert_eq!(got.mesh.normals().unwrap()[3], [0.0, 0.0, 1.0]);
        assert_eq!(got.warnings[0].text, "3 corners without a normal: filled with zeros");
        assert_eq!(got.contents.attributes, ["normals"]);
    }

    #[test]
    fn attributes_that_are_missing_are_left_out() {
        let faces = "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n";
        let lost = |loaded: &Loaded| {
            loaded.warnings.iter().filter(|w| w.data_lost).map(|w| w.text.clone()).collect::<Vec<_>>()
        };
        // None at all: the indices of all kinds are those of the positions, or a polygon has them alone.
        let got = read_text(&format!("{SQUARE}f 1/1/1 2/2/2 3/3/3\nf 1/1/1 2/2/2 3/3/3 4/4/4\n")).unwrap();
        assert!(got.mesh.uvs().is_none() && got.mesh.normals().is_none() && got.mesh.face_count() == 3);
        assert_eq!(
            lost(&got),
            [
                "line 5: the face refers to texture coordinate 1, but the file has 0 (7 corners refer to such ones): left out",
                "line 5: the face refers to normal 1, but the file has 0 (7 corners refer to such ones): left out",
            ]
        );
        // Some, and indices that count backwards or are 0.
        let got = read_text(&format!("{SQUARE}vt 0 1\nvn 0 0 1\n{faces}f 1/1 2/-2 3/0\n")).unwrap();
        assert_eq!(got.mesh.normals().unwrap()[0], [0.0, 0.0, 1.0]);
        assert_eq!(got.mesh.uvs().unwrap()[0], [0.0, 1.0]);
        assert_eq!(
            lost(&got),
            [
                "line 7: the face refers to texture coordinate 2, but the file has 1 (6 corners refer to such ones): left out"
            ]
        );
    }

    #[test]
    fn a_polygon_may_bring_the_first_attributes() {
        let vt = "vt .5 .5\n";
        let got = read_text(&format!("{SQUARE}{vt}f 1 2 3\nf 1/1 2/1 3/1 4/1\nf 1 2 4\n")).unwrap();
        assert_eq!(got.mesh.face_count(), 4);
        let uv = |face: usize| got.mesh.uvs().unwrap()[got.mesh.triangles()[face][0].index()];
        assert_eq!([uv(0), uv(1), uv(2), uv(3)], [[0.0; 2], [0.5; 2], [0.5; 2], [0.0; 2]]);
    }

    #[test]
    fn colors_stand_behind_positions() {
        let got = read_text("v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0 0.25\nv 0 1 0 1\nf 1 2 3\n").unwrap();
        assert_eq!(got.mesh.colors().unwrap(), [[1.0, 0.0, 0.0, 1.0], [0.0, 0.5, 0.0, 0.25], [1.0; 4]]);
        assert_eq!(got.warnings[0].text, "1 vertex without a colour: made white");
        let got = read_text("v 0 0 0 255 0 0\nv 1 0 0 0 51 0\nv 0 1 0 0 0 0\nf 1 2 3\n").unwrap();
        assert_eq!(got.mesh.colors().unwrap()[1], [0.0, 0.2, 0.0, 1.0]);
        let got = read_text("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").unwrap();
        assert!(got.mesh.colors().is_none());
    }

    #[test]
    fn text_of_every_style_is_read() {
        let wanted = triangles(&read_text(&format!("{SQUARE}f 1 2 3\n")).unwrap());
        for text in [
            format!("\u{feff}{SQUARE}f 1 2 3"),
            format!("{SQUARE}f 1 2 3\n").replace('\n', "\r\n").replace(' ', "\t"),
            format!("{SQUARE}f 1 \\\n2 \\\r\n 3\n"),
            format!("{SQUARE}f -4 -3 -2 # comment\n"),
            format!("# c \\\n{SQUARE}\n\n  f 1 2 3  \n"),
            format!("f 1 2 3\n{SQUARE}"),
            "v 0 0 0\nv nan inf -inf\nv 1. +1 1e0\nf 1 2 3".to_owned(),
        ] {
            assert_eq!(triangles(&read_text(&text).unwrap()), wanted, "{text}");
        }
    }

    #[test]
    fn precision_follows_the_file() {
        let read_x = |x: &str| read_text(&format!("v {x} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap().mesh;
        assert!(matches!(read_x("0.1").positions(), Positions::F32(_)));
        assert!(matches!(read_x("0.100000001").positions(), Positions::F32(_)));
        assert!(matches!(read_x("500000.123").positions(), Positions::F64(p) if p[0][0] == 500000.123));
    }

    #[test]
    fn each_triangle_of_a_polygon_has_its_region() {
        let got = read_text(&format!(
            "{SQUARE}f 1 2 3\ng a b\nusemtl my \\\n wood\nf 1 2 3 4\nf 1 2 4\ns 1\n\\\nf 1 2 3\n"
        ));
        let got = got.unwrap();
        let ids: Vec<u32> = got.mesh.regions().unwrap().iter().map(|r| r.0).collect();
        assert_eq!(ids, [0, 1, 1, 1, 2]);
        let last = got.regions.get(RegionId(2)).unwrap();
        assert_eq!((last.groups, last.material), (Some(&b"a b"[..]), Some(&b"my   wood"[..])));
        assert_eq!((last.object, last.smoothing), (None, Some(&b"1"[..])));
        assert!(got.warnings.is_empty());
    }

    #[test]
    fn dropped_content_is_reported() {
        let got = read_text(&format!(
            "mtllib a.mtl\no a\nusemtl x\n{SQUARE}usemtl y\nusemtl x\nf 1 2 3\nl 1 2\nhello\n"
        ));
        let got = got.unwrap();
        assert_eq!(got.contents.materials, 2);
        assert_eq!(got.regions.libraries()[0].name(), b"a.mtl");
        let texts: Vec<&str> = got.warnings.iter().map(|w| w.text.as_str()).collect();
        assert_eq!(
            texts,
            [
                "1 element of lines or points: dropped",
                "line 12 begins with the unknown keyword `hello`: skipped",
            ]
        );
        assert!(got.warnings[0].data_lost);
    }
}
