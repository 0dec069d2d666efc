//! Check of the memory that a step needs against a limit, before the step starts.
//!
//! The need of a step is a sum of counts times bytes, measured (docs/decisions/0022). It is the peak of the
//! process during the step, including meshes that stay in memory meanwhile.

use crate::mesh::{Positions, TriMesh};

/// A step that needs more memory than allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{step} would take about {} of memory, above the limit of {} (--max-memory)",
    format_bytes(*need),
    format_bytes(*limit)
)]
pub struct TooMuchMemory {
    /// The step: `reading an OBJ file`.
    pub step: String,
    /// Bytes that it needs.
    pub need: u64,
    /// Bytes that are allowed.
    pub limit: u64,
}

/// Rejects a step that needs more than the limit.
///
/// # Errors
/// [`TooMuchMemory`], which contains step, need and limit.
pub fn check(step: impl Into<String>, need: u64, limit: u64) -> Result<(), TooMuchMemory> {
    if need > limit { Err(TooMuchMemory { step: step.into(), need, limit }) } else { Ok(()) }
}

/// Formats a number of bytes in powers of 1024: `1.5 GiB`.
pub fn format_bytes(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["bytes", "KiB", "MiB", "GiB", "TiB"];
    let mut scaled = (bytes as f64, 0);
    while scaled.0 >= 1024.0 && scaled.1 + 1 < UNITS.len() {
        scaled = (scaled.0 / 1024.0, scaled.1 + 1);
    }
    let (number, unit) = (scaled.0, UNITS[scaled.1]);
    if scaled.1 == 0 || number >= 100.0 {
        format!("{number:.0} {unit}")
    } else {
        format!("{number:.2} {unit}")
    }
}

impl TriMesh {
    /// Number of bytes that its buffers take.
    pub fn bytes(&self) -> u64 {
        let (wedges, faces) = (self.wedge_count() as u64, self.face_count() as u64);
        let position = match self.positions() {
            Positions::F32(_) => 12,
            Positions::F64(_) => 24,
        };
        let has = |is: bool, bytes: u64| if is { bytes } else { 0 };
        let further: u64 = self.further_attributes().iter().map(|a| 4 * a.width as u64).sum();
        let wedge = has(wedges != self.vertex_count() as u64, 4)
            + has(self.normals().is_some(), 12)
            + has(self.uvs().is_some(), 8)
            + has(self.colors().is_some(), 16)
            + further;
        self.vertex_count() as u64 * position
            + wedges * wedge
            + faces * (12 + has(self.regions().is_some(), 4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    #[test]
    fn bytes_in_words() {
        let words = [0, 1023, 1536, 100 << 20, 3 << 29, u64::MAX].map(format_bytes);
        assert_eq!(words, ["0 bytes", "1023 bytes", "1.50 KiB", "100 MiB", "1.50 GiB", "16777216 TiB"]);
    }

    #[test]
    fn the_error_is_one_line() {
        assert_eq!(check("reading", 10, 10), Ok(()));
        let error = check("reading", 3 << 30, 1 << 30).unwrap_err().to_string();
        let wanted =
            "reading would take about 3.00 GiB of memory, above the limit of 1.00 GiB (--max-memory)";
        assert_eq!(error, wanted);
    }

    #[test]
    fn bytes_of_a_mesh_are_those_of_its_buffers() {
        let mut mesh = shapes::icosphere(2);
        let (vertices, faces) = (mesh.vertex_count() as u64, mesh.face_count() as u64);
        let position = if matches!(mesh.positions(), Positions::F32(_)) { 12 } else { 24 };
        assert_eq!(mesh.bytes(), position * vertices + 12 * faces);
        mesh.set_uvs(Some(vec![[0.0; 2]; mesh.wedge_count()])).expect("one for each wedge");
        assert_eq!(mesh.bytes(), (position + 8) * vertices + 12 * faces);
    }
}
