//! Triangles of one primitive, from its indices and its mode.

use serde_json::Value;

use super::accessors::Accessor;
use super::buffers::Buffers;
use super::container::{number, whole};
use crate::error::ReadError;

/// Topology of a primitive with triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TriangleMode {
    Triangles,
    Strip,
    Fan,
}

/// A primitive with triangles, not decoded yet.
pub(super) struct Primitive {
    pub(super) name: String,
    mode: TriangleMode,
    /// Accessor of the indices; without one, vertices are used in order.
    indices: Option<usize>,
    /// Number of indices, or of vertices if there are no indices.
    pub(super) corners: usize,
    /// Index of its material, which may not exist.
    pub(super) material: Option<usize>,
}

impl Primitive {
    /// Returns true for triangles, false for points and lines.
    pub(super) fn has_faces(primitive: &Value, name: &str) -> Result<bool, ReadError> {
        mode(primitive, name).map(|m| m.is_some())
    }

    /// Returns a primitive with faces and this many vertices.
    pub(super) fn new(
        json: &Value,
        buffers: &Buffers<'_>,
        primitive: &Value,
        name: String,
        vertices: usize,
    ) -> Result<Self, ReadError> {
        let mode = mode(primitive, &name)?.unwrap_or(TriangleMode::Triangles);
        let indices = whole(primitive, "indices", &name)?;
        let corners = match indices {
            None => vertices,
            Some(index) => Accessor::new(json, buffers, index, &name)?.count,
        };
        Ok(Self { name, mode, indices, corners, material: number(&primitive["material"]) })
    }

    pub(super) fn max_faces(&self) -> usize {
        match self.mode {
            TriangleMode::Triangles => self.corners / 3,
            TriangleMode::Strip | TriangleMode::Fan => self.corners.saturating_sub(2),
        }
    }

    /// Decodes the triangles over the primitive's `count` vertices; also returns true if one or two indices
    /// are left over.
    pub(super) fn triangles(
        &self,
        json: &Value,
        buffers: &Buffers<'_>,
        count: usize,
    ) -> Result<(Vec<[u32; 3]>, bool), ReadError> {
        let corners = match self.indices {
            None => (0..count as u32).collect(),
            Some(index) => {
                let accessor = Accessor::new(json, buffers, index, &self.name)?;
                let indices = accessor.indices()?;
                if indices.iter().max().is_some_and(|&i| i as usize >= count) {
                    let at = indices.iter().position(|&i| i as usize >= count).unwrap_or(0);
                    return Err(ReadError::element(
                        accessor.name,
                        format!(
                            "entry {at} is the index {}, but {} has {count} vertices",
                            indices[at], self.name
                        ),
                    ));
                }
                indices
            }
        };
        Ok(match self.mode {
            TriangleMode::Triangles => {
                let (triangles, rest) = corners.as_chunks::<3>();
                (triangles.to_vec(), !rest.is_empty())
            }
            // Strips flip every other triangle; degenerate ones only connect strips.
            TriangleMode::Strip => {
                let triangles = corners
                    .windows(3)
                    .enumerate()
                    .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
                    .filter(|[a, b, c]| a != b && b != c && c != a);
                (triangles.collect(), false)
            }
            TriangleMode::Fan => {
                let around = |(&hub, rim): (&u32, &[u32])| {
                    rim.windows(2).map(|w| [w[0], w[1], hub]).collect::<Vec<_>>()
                };
                (corners.split_first().map(around).unwrap_or_default(), false)
            }
        })
    }
}

/// Returns the topology; `None` for points and lines.
fn mode(primitive: &Value, name: &str) -> Result<Option<TriangleMode>, ReadError> {
    Ok(Some(match whole(primitive, "mode", name)?.unwrap_or(4) {
        4 => TriangleMode::Triangles,
        5 => TriangleMode::Strip,
        6 => TriangleMode::Fan,
        0..=3 => return Ok(None),
        other => {
            return Err(ReadError::element(name, format!("mode {other} is unknown: 0 to 6 are valid")));
        }
    }))
}
