//! A vertex of the mesh that is being collapsed, packed into one cache line.

use bytemuck::allocation::zeroed_vec;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use lodsmith_core::VertexId;
use wide::{f32x4, u32x4};

use super::kind::Kind;
use crate::cost::lanes::{Four, dot};

/// A vertex; one cache line if the memory is a tensor.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Vertex<Q> {
    pub(super) place: PackedPosition,
    /// Data of the metric.
    pub(crate) q: Q,
    /// Its number in the ordered input.
    pub(crate) origin: VertexId,
    /// Start of its list of corners.
    pub(super) head: u32,
    /// Length of its list of corners.
    pub(super) count: u32,
    /// Length that the list can grow to.
    pub(super) room: u32,
    pub(crate) kind: Kind,
    /// Normal of the input's surface at the input vertex with that number.
    pub(crate) facing: Facing,
}

/// Position of a vertex, loaded by one instruction.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct PackedPosition {
    /// Position in the unit frame.
    pub(crate) p: Vec3,
    /// (Fills the register.)
    pub(crate) unused: u32,
}

impl<Q> std::ops::Deref for Vertex<Q> {
    type Target = PackedPosition;
    #[inline(always)]
    fn deref(&self) -> &PackedPosition {
        &self.place
    }
}

impl<Q> std::ops::DerefMut for Vertex<Q> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut PackedPosition {
        &mut self.place
    }
}

impl<Q> Vertex<Q> {
    /// Counts another corner, before the lists are built.
    #[inline(always)]
    pub(super) fn count_corner(&mut self) {
        self.count += 1;
    }

    /// Sets the start and length of its list. Returns the length.
    #[inline(always)]
    pub(super) fn list(&mut self, head: u32, count: u32) -> u32 {
        (self.head, self.count, self.room) = (head, count, count);
        count
    }
}

/// A direction in four bytes: three signed bytes are enough to distinguish front from back.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Facing([i8; 4]);

impl Facing {
    /// Returns the direction of a vector of any length; zero for the zero vector.
    #[inline(always)]
    pub(crate) fn of(n: Vec3) -> Self {
        let n = n * (127.0 / n.length().max(1e-30));
        Self([n.x as i8, n.y as i8, n.z as i8, 0])
    }
    /// Returns the directions of four vectors.
    #[inline(always)]
    pub(super) fn of_four(normals: &[f32x4; 4]) -> [Self; 4] {
        let [x, y, z, _] = f32x4::transpose(*normals);
        let per_length =
            f32x4::splat(127.0) / dot(&[x, y, z], &[x, y, z]).sqrt().fast_max(f32x4::splat(1e-30));
        let bytes = [x, y, z].map(|x| {
            let x = x * per_length;
            // NaN becomes zero; values that are too large are clamped.
            let x = (x & x.simd_eq(x)).fast_max(f32x4::splat(-128.0)).fast_min(f32x4::splat(127.0));
            bytemuck::cast::<_, u32x4>(x.fast_trunc_int()) & u32x4::splat(255)
        });
        let all = bytes[0] | bytes[1] << 8u32 | bytes[2] << 16u32;
        all.to_array().map(|n| Self(n.to_le_bytes().map(u8::cast_signed)))
    }
    #[inline(always)]
    pub(super) fn bytes(self) -> [u8; 4] {
        self.0.map(|x| x as u8)
    }
    #[inline(always)]
    pub(crate) fn direction(self) -> Vec3 {
        Vec3::new(f32::from(self.0[0]), f32::from(self.0[1]), f32::from(self.0[2]))
    }
}

/// Sums of normals, by vertex.
pub(super) struct Normals(Vec<f32x4>);

impl Normals {
    /// Returns zero sums for `count` vertices.
    pub(super) fn zero(count: usize) -> Self {
        Self(zeroed_vec(count.next_multiple_of(4)))
    }
    /// Returns the sums, mutable.
    pub(super) fn of_each(&mut self) -> &mut [f32x4] {
        &mut self.0
    }
    pub(super) fn fours(&self) -> &[[f32x4; 4]] {
        self.0.as_chunks().0
    }
}

/// Returns the positions of four vertices side by side.
#[inline(always)]
pub(crate) fn four<Q>(all: &[Vertex<Q>], vertices: [VertexId; 4]) -> Four {
    let row = |w: VertexId| *bytemuck::cast_ref::<PackedPosition, f32x4>(&all[w.index()].place);
    let [x, y, z, _] = f32x4::transpose(vertices.map(row));
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cost::tensor::Tensor;
    use crate::test_support::four_vectors;

    #[test]
    fn a_vertex_is_one_cache_line() {
        assert_eq!(size_of::<Vertex<Tensor>>(), 64);
    }

    #[test]
    fn four_facings_at_once_equal_each_alone() {
        let far = f32::MAX;
        let normals = [
            [[1.0, -2.0, 3.0], [0.0, 0.0, 0.0], [-1e-3, 1e-3, 0.0], [0.0, 0.0, -1.0]],
            // Lengths that are not finite, or that are zero although the coordinates are not.
            [[1e-23, -1e-23, 0.0], [far, far, -far], [f32::NAN, 1.0, -1.0], [f32::INFINITY, 0.0, 0.0]],
        ];
        for four in normals {
            let rows = four.map(|[x, y, z]| f32x4::new([x, y, z, 9.0]));
            assert_eq!(Facing::of_four(&rows).map(|f| f.0), four.map(|n| Facing::of(Vec3::from(n)).0));
        }
    }

    proptest::proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(512) })]

        #[test]
        fn any_four_facings_at_once_equal_each_alone(
            normals in four_vectors(),
            far in [-38i32..38, -38i32..38, -38i32..38, -38i32..38],
        ) {
            let normals = [0, 1, 2, 3].map(|i| normals[i] * 10f32.powi(far[i]));
            let rows = normals.map(|n| f32x4::new(n.extend(9.0).to_array()));
            prop_assert_eq!(Facing::of_four(&rows).map(|f| f.0), normals.map(|n| Facing::of(n).0));
        }
    }
}
