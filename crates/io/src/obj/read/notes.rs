//! Counts of the contents of an OBJ file besides the mesh, for warnings.

use lodsmith_core::numbers::{counted, grouped};

use crate::error::Warning;
use crate::excerpt::excerpt_of_bytes;

/// Counts for warnings.
#[derive(Default)]
pub(super) struct ObjNotes {
    pub(super) objects: usize,
    pub(super) colored: usize,
    pub(super) small_faces: usize,
    pub(super) lines_and_points: usize,
    pub(super) free_forms: usize,
    /// Texture coordinates and normals that faces refer to but the file lacks: the first error, and the number of corners.
    pub(super) missing: Vec<(String, usize)>,
    /// Lines that begin with an unknown word: their number, the line of the first one, and its word.
    pub(super) unknown_lines: Option<(usize, usize, Vec<u8>)>,
}

impl ObjNotes {
    /// Adds the notes of the following section, which begins after `lines` lines.
    pub(super) fn append(&mut self, next: Self, lines: usize) {
        self.objects += next.objects;
        self.colored += next.colored;
        self.small_faces += next.small_faces;
        self.lines_and_points += next.lines_and_points;
        self.free_forms += next.free_forms;
        self.unknown_lines = match (self.unknown_lines.take(), next.unknown_lines) {
            (Some((count, line, word)), Some((more, ..))) => Some((count + more, line, word)),
            (None, Some((count, line, word))) => Some((count, line + lines, word)),
            (first, None) => first,
        };
    }

    pub(super) fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        for (error, corners) in &self.missing {
            let corners = counted(*corners, "corner refers to such a one", "corners refer to such ones");
            warnings.push(Warning::lost(format!("{error} ({corners}): left out")));
        }
        if self.lines_and_points > 0 {
            let count = counted(self.lines_and_points, "element", "elements");
            warnings.push(Warning::lost(format!("{count} of lines or points: dropped")));
        }
        if self.free_forms > 0 {
            warnings.push(Warning::lost("free-form curves and surfaces: dropped"));
        }
        if self.small_faces > 0 {
            let count = counted(self.small_faces, "face", "faces");
            warnings.push(Warning::note(format!("{count} of fewer than three corners: dropped")));
        }
        if let Some((count, line, word)) = &self.unknown_lines {
            let word = excerpt_of_bytes(word);
            warnings.push(Warning::note(match count {
                1 => format!("line {line} begins with the unknown keyword `{word}`: skipped"),
                _ => format!(
                    "{} lines begin with an unknown keyword, such as `{word}` in line {line}: skipped",
                    grouped(*count)
                ),
            }));
        }
        warnings
    }
}
