//! Conversion of a level to a mesh.

use lodsmith_core::splits::NO_ORIGINAL;
use lodsmith_core::{Attribute, FaceId, MeshError, Positions, PositionsView, TriMesh, VertexId, WedgeId};

use super::Progressive;

/// Elements in the order of a result, and the index of each in it.
struct ElementNumbering {
    chosen: Vec<usize>,
    place: Vec<u32>,
}

impl ElementNumbering {
    /// Orders the elements in `is_in` by their numbers in the original; elements without a number come last.
    fn new(is_in: &[bool], number: Option<&[u32]>) -> Self {
        let mut chosen: Vec<usize> = (0..is_in.len()).filter(|&i| is_in[i]).collect();
        if let Some(number) = number {
            chosen.sort_by_key(|&i| number[i]);
        }
        let mut place = vec![u32::MAX; is_in.len()];
        for (k, &i) in chosen.iter().enumerate() {
            place[i] = k as u32;
        }
        Self { chosen, place }
    }
}

impl Progressive {
    /// Returns the mesh of the current level with these positions and values.
    pub(super) fn extract(&self, positions: &Positions, values: &[f32]) -> Result<TriMesh, MeshError> {
        let counts = self.counts();
        let original = self.sequence.splits.original.as_ref();
        let is_full = self.level == self.top();
        let mut wedge_in = vec![false; counts.wedges as usize];
        let mut vertex_in = vec![false; counts.vertices as usize];
        for w in self.faces().iter().flatten() {
            wedge_in[w.index()] = true;
        }
        for w in (0..wedge_in.len()).filter(|&w| wedge_in[w]) {
            vertex_in[self.owner(w).index()] = true;
        }
        if let (Some(original), true) = (original, is_full) {
            // The full level has every element of the original, used or not.
            wedge_in.iter_mut().zip(&original.wedges).for_each(|(x, w)| *x |= w.0 != NO_ORIGINAL);
            vertex_in.iter_mut().zip(&original.vertices).for_each(|(x, v)| *x |= v.0 != NO_ORIGINAL);
        }
        let wedges = ElementNumbering::new(&wedge_in, original.map(|o| bytemuck::cast_slice(&o.wedges)));
        let vertices = ElementNumbering::new(&vertex_in, original.map(|o| bytemuck::cast_slice(&o.vertices)));
        let mut faces: Vec<usize> = (0..self.face_count()).collect();
        if let Some(original) = original {
            faces.sort_by_key(|&f| original.faces[f]);
        }
        let triangles: Vec<[WedgeId; 3]> =
            faces.iter().map(|&f| self.faces[f].map(|w| WedgeId(wedges.place[w.index()]))).collect();
        let positions = match positions {
            Positions::F32(p) => Positions::F32(vertices.chosen.iter().map(|&v| p[v]).collect()),
            Positions::F64(p) => Positions::F64(vertices.chosen.iter().map(|&v| p[v]).collect()),
        };
        let map: Vec<VertexId> =
            wedges.chosen.iter().map(|&w| VertexId(vertices.place[self.owner(w).index()])).collect();
        let is_plain = map.len() == positions.len() && map.iter().enumerate().all(|(w, v)| v.index() == w);
        let keeps_map = is_full && original.is_some_and(|o| o.has_vertex_map);
        let mut mesh = if is_plain && !keeps_map {
            TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?
        } else {
            TriMesh::with_wedges(positions, map, triangles)?
        };
        self.set_attributes(&mut mesh, values, wedges.chosen.iter().copied())?;
        let regions = self.sequence.splits.regions.as_ref();
        mesh.set_regions(regions.map(|r| faces.iter().map(|&f| r[FaceId::new(f).index()]).collect()))?;
        Ok(mesh)
    }

    /// Returns the mesh of the current level with the fit of the checkpoints, in the numbering of this
    /// progressive mesh, for rendering: face i is face i of [`Progressive::faces`], and so on. It is faster
    /// than [`Progressive::fitted_mesh`], and may have vertices that no face uses. Cost: O(n).
    ///
    /// # Errors
    /// Those of [`Progressive::mesh`].
    pub fn fitted_buffers(&self) -> Result<TriMesh, MeshError> {
        let mut positions = match self.positions() {
            PositionsView::F32(p) => Positions::F32(p.to_vec()),
            PositionsView::F64(p) => Positions::F64(p.to_vec()),
        };
        let mut values = self.values().to_vec();
        self.correct(&mut positions, &mut values);
        let mut mesh = match self.vertex_map() {
            None => TriMesh::new(positions, bytemuck::allocation::cast_vec(self.faces().to_vec()))?,
            Some(map) => TriMesh::with_wedges(positions, map.to_vec(), self.faces().to_vec())?,
        };
        self.set_attributes(&mut mesh, &values, 0..self.counts().wedges as usize)?;
        mesh.set_regions(self.regions().map(<[_]>::to_vec))?;
        Ok(mesh)
    }

    /// Sets the attributes of a mesh with these wedges.
    fn set_attributes(
        &self,
        mesh: &mut TriMesh,
        values: &[f32],
        wedges: impl Iterator<Item = usize> + Clone,
    ) -> Result<(), MeshError> {
        let layout = self.layout();
        let width = layout.width();
        let row = |w: usize| &values[w * width..][..width];
        let mut at = 0;
        if layout.has_normals {
            mesh.set_normals(Some(wedges.clone().map(|w| fixed(row(w), at)).collect()))?;
            at += 3;
        }
        if layout.has_uvs {
            mesh.set_uvs(Some(wedges.clone().map(|w| fixed(row(w), at)).collect()))?;
            at += 2;
        }
        if layout.has_colors {
            mesh.set_colors(Some(wedges.clone().map(|w| fixed(row(w), at)).collect()))?;
            at += 4;
        }
        for (semantic, n) in &layout.further {
            let all = wedges.clone().flat_map(|w| &row(w)[at..at + n]).copied().collect();
            mesh.add_attribute(Attribute { semantic: semantic.clone(), width: *n, values: all })?;
            at += n;
        }
        Ok(())
    }

    fn owner(&self, wedge: usize) -> VertexId {
        self.vertex_of.as_ref().map_or(VertexId(wedge as u32), |map| map[wedge])
    }
}

fn fixed<const N: usize>(row: &[f32], at: usize) -> [f32; N] {
    std::array::from_fn(|k| row[at + k])
}

#[cfg(test)]
mod tests {
    use lodsmith_core::Splits;

    use super::*;
    use crate::test_support::three_levels;

    fn raw(mesh: &TriMesh) -> Vec<[u32; 3]> {
        mesh.triangles().iter().map(|t| t.map(|w| w.0)).collect()
    }

    #[test]
    fn meshes_have_the_order_of_the_original() {
        let mut progressive = Progressive::new(Splits::new(three_levels()).expect("sound splits"));
        // Vertex v was number 5 - v, and face f number 3 - f.
        let full = progressive.mesh().expect("a mesh");
        assert_eq!(raw(&full), [[4, 0, 1], [1, 2, 3], [4, 1, 3], [5, 4, 3]]);
        let view = full.positions().view();
        assert_eq!([5, 4, 3].map(|v| view.get(VertexId(v))[0]), [0.0, 1.0, 0.0]);
        // Coarser levels leave no gaps: of 5, 4, 3 and 2, vertex 2 comes first.
        progressive.to_level(1);
        assert_eq!(raw(&progressive.mesh().expect("a mesh")), [[2, 0, 1], [3, 2, 1]]);
        // In the buffers all elements keep their numbers.
        assert_eq!(raw(&progressive.fitted_buffers().expect("a mesh")), [[0, 1, 2], [1, 3, 2]]);
        let fitted = progressive.fitted_mesh().expect("a mesh");
        assert!((fitted.positions().view().get(VertexId(3))[2] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn vertices_without_faces_are_left_out_except_in_the_original() {
        let mut data = three_levels();
        data.checkpoints.clear();
        // Vertex 3 loses both corners in the second split; it is part of the original.
        data.faces[2] = [4, 5, 2].map(WedgeId);
        let progressive = |data| Progressive::new(Splits::new(data).expect("sound splits"));
        assert_eq!(progressive(data.clone()).mesh().expect("a mesh").vertex_count(), 6);
        let original = data.original.as_mut().expect("the original numbers are known");
        let numbers = [4, 3, 2, NO_ORIGINAL, 1, 0];
        (original.vertices, original.wedges) = (numbers.map(VertexId).into(), numbers.map(WedgeId).into());
        assert_eq!(progressive(data.clone()).mesh().expect("a mesh").vertex_count(), 5);
        data.original = None;
        assert_eq!(progressive(data).mesh().expect("a mesh").vertex_count(), 5);
    }
}
