//! Seams of attributes, as edges of the live surface.

use std::collections::{HashMap, HashSet};

use lodsmith_core::{TriMesh, VertexId, WedgeId};

use crate::attributes::sides::SideValues;
use crate::methods::task::PreparedInput;

/// The edges whose two faces have different attributes, apart from shading.
#[derive(Default)]
pub(super) struct Seams(HashSet<[VertexId; 2]>);

impl Seams {
    /// Finds the seams of a mesh. Cost: O(n).
    pub(super) fn new(prepared: &PreparedInput, mesh: &TriMesh) -> Self {
        let sides = SideValues::new(mesh);
        if sides.is_empty() {
            return Self::default();
        }
        let corners =
            |f: usize| prepared.faces[f].into_iter().zip(mesh.triangles()[prepared.origin[f].index()]);
        let mut first: Vec<Option<WedgeId>> = vec![None; prepared.points.len()];
        let mut is_split = vec![false; prepared.points.len()];
        for (v, w) in (0..prepared.faces.len()).flat_map(corners) {
            is_split[v.index()] |= !sides.same(*first[v.index()].get_or_insert(w), w);
        }
        let (mut known, mut seams) = (HashMap::new(), HashSet::new());
        for f in 0..prepared.faces.len() {
            let t: Vec<(VertexId, WedgeId)> = corners(f).collect();
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                // (A seam may end within the surface, at a vertex that is not split.)
                if is_split[a.0.index()] || is_split[b.0.index()] {
                    let (a, b) = if a.0 < b.0 { (a, b) } else { (b, a) };
                    let (c, d) = *known.entry([a.0, b.0]).or_insert((a.1, b.1));
                    if !sides.same(a.1, c) || !sides.same(b.1, d) {
                        seams.insert([a.0, b.0]);
                    }
                }
            }
        }
        Self(seams)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    /// True if an edge is a seam.
    #[inline]
    pub(super) fn has(&self, a: VertexId, b: VertexId) -> bool {
        !self.0.is_empty() && self.0.contains(&[a.min(b), a.max(b)])
    }
    /// Makes an edge a seam.
    pub(super) fn add(&mut self, a: VertexId, b: VertexId) {
        self.0.insert([a.min(b), a.max(b)]);
    }
}
