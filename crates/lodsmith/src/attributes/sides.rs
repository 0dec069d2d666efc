//! Values that distinguish the two sides of a seam, for runs that match wedges instead of blending them.

use std::sync::Arc;

use lodsmith_core::{Attribute, Morphed, Semantic, TriMesh, WedgeId};

/// The values of each wedge of a mesh that are equal on both sides of an edge, unless the edge is a seam.
#[derive(Clone, Debug, Default)]
pub(crate) struct SideValues {
    values: Arc<[f32]>,
    width: usize,
}

impl SideValues {
    /// Takes all attributes of a mesh but directions (normals, tangents apart from their sign, and morph targets of
    /// either): these differ along every crease, but can still be matched to the nearest ones on its other
    /// side.
    pub(crate) fn new(mesh: &TriMesh) -> Self {
        let mut columns: Vec<(&[f32], usize, usize)> = Vec::new();
        columns.extend(mesh.uvs().map(|all| (all.as_flattened(), 2, 0)));
        columns.extend(mesh.colors().map(|all| (all.as_flattened(), 4, 0)));
        columns.extend(mesh.further_attributes().iter().filter_map(|a| {
            let Attribute { semantic, width, values } = a;
            let first = match semantic {
                Semantic::Morph { of: Morphed::Normal | Morphed::Tangent, .. } => return None,
                // The sign of the bitangent.
                Semantic::Tangent => 3.min(*width),
                _ => 0,
            };
            (first < *width).then_some((&values[..], *width, first))
        }));
        Self::of(&columns, mesh.wedge_count())
    }

    /// Takes texture coordinates; an empty list stands for a mesh without any, in which no sides are
    /// distinguished.
    pub(crate) fn of_uvs(uvs: &[[f32; 2]]) -> Self {
        Self::of(&[(uvs.as_flattened(), 2, 0)], uvs.len())
    }

    /// Takes columns, each with its width and the first value that counts.
    fn of(columns: &[(&[f32], usize, usize)], wedges: usize) -> Self {
        let width = columns.iter().map(|(_, width, first)| width - first).sum();
        let mut values = Vec::with_capacity(width * wedges);
        for w in 0..wedges {
            for (all, width, first) in columns {
                values.extend_from_slice(&all[w * width + first..(w + 1) * width]);
            }
        }
        Self { values: values.into(), width }
    }

    /// True if no attribute distinguishes sides.
    pub(crate) fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// True if two wedges of one vertex are on the same side of every seam.
    #[inline(always)]
    pub(crate) fn same(&self, a: WedgeId, b: WedgeId) -> bool {
        let of = |w: WedgeId| &self.values[w.index() * self.width..(w.index() + 1) * self.width];
        a == b || self.is_empty() || of(a) == of(b)
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{IntegerType, shapes};

    use super::*;

    /// A quick run on sheets without texture coordinates ended in a panic.
    #[test]
    fn without_values_all_wedges_are_on_the_same_side() {
        let sides = SideValues::of_uvs(&[]);
        assert!(sides.is_empty() && sides.same(WedgeId(0), WedgeId(9)));
    }

    #[test]
    fn all_attributes_but_directions_distinguish_sides() {
        let sheet = shapes::grid(1);
        let count = sheet.wedge_count();
        // The last wedge differs from the others, in one attribute at a time.
        let values = |width: usize, k: usize| -> Vec<f32> {
            (0..count * width).map(|i| f32::from(u8::from(i == (count - 1) * width + k))).collect()
        };
        let differs = |mesh: &TriMesh| !SideValues::new(mesh).same(WedgeId(0), WedgeId::new(count - 1));
        let with = |semantic: Semantic, width: usize, k: usize| {
            let mut mesh = sheet.clone();
            mesh.add_attribute(Attribute { semantic, width, values: values(width, k) }).unwrap();
            differs(&mesh)
        };
        let morph = |of| Semantic::Morph { target: 0, of };
        assert!(with(Semantic::Uv(1), 2, 1) && with(Semantic::Color(1), 4, 3));
        assert!(with(Semantic::Custom("heat".into()), 1, 0) && with(morph(Morphed::Position), 3, 2));
        assert!(with(Semantic::Discrete { name: "id".into(), of: IntegerType::U8 }, 1, 0));
        assert!(with(Semantic::Tangent, 4, 3) && !with(Semantic::Tangent, 4, 0));
        assert!(!with(morph(Morphed::Normal), 3, 0) && !with(morph(Morphed::Tangent), 3, 0));

        let mut mesh = sheet.clone();
        assert!(!differs(&mesh) && SideValues::new(&mesh).is_empty());
        mesh.set_normals(Some(values(3, 0).as_chunks().0.to_vec())).unwrap();
        assert!(!differs(&mesh));
        mesh.set_colors(Some(values(4, 2).as_chunks().0.to_vec())).unwrap();
        assert!(differs(&mesh));
        mesh.set_colors(None).unwrap();
        mesh.set_uvs(Some(values(2, 0).as_chunks().0.to_vec())).unwrap();
        assert!(differs(&mesh));
    }
}
