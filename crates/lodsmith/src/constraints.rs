//! Locked vertices, importance and error maps: their checks, and the wedges of locked vertices, which a result keeps.

use std::collections::HashMap;

use lodsmith_core::mesh::weld::{self, Weld};
use lodsmith_core::{PositionsView, RegionId, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::collapse::order::{NONE, Ordered};
use crate::input::MeshData;

/// Range that densities are clamped to. (Their cost factors must leave room in single precision.)
const DENSITY_RANGE: [f32; 2] = [1e-3, 1e3];

/// Locks and cost factors of vertices, by number in the ordered input.
pub(crate) struct Constraints {
    locked: Option<Vec<bool>>,
    locked_faces: usize,
    cost_factors: Option<Vec<f32>>,
    error_map: Option<Vec<f32>>,
}

impl Constraints {
    /// Builds locks and cost factors. `joined` returns the vertex that each vertex was merged with before the
    /// input was ordered.
    pub(crate) fn new(data: &MeshData<'_>, ordered: &Ordered, joined: impl Fn(VertexId) -> VertexId) -> Self {
        let place = |i: usize| ordered.rank[joined(VertexId::new(i)).index()];
        let places = || (0..ordered.rank.len()).map(|i| (i, place(i))).filter(|x| x.1 != NONE);
        let locked = data.locked.filter(|l| l.contains(&true)).map(|own| {
            let mut locked = vec![false; ordered.point_count];
            places().for_each(|(i, place)| locked[place.index()] |= own[i]);
            locked
        });
        let factors = data.importance.filter(|x| x.iter().any(|x| *x != 1.0)).map(|own| {
            let mut factors = vec![0f32; ordered.point_count];
            for (i, place) in places() {
                let density = own[i].clamp(DENSITY_RANGE[0], DENSITY_RANGE[1]);
                let factor = &mut factors[place.index()];
                *factor = factor.max(density * density * density.sqrt());
            }
            // Normalises so that the smallest factor is 1: only the ratios matter.
            let least = factors.iter().copied().fold(f32::INFINITY, f32::min);
            factors.iter_mut().for_each(|x| *x /= least);
            factors
        });
        let locked_faces = locked
            .as_ref()
            .map_or(0, |locked| ordered.faces.iter().filter(|t| t.iter().all(|v| locked[v.index()])).count());
        let error_map = data.error_map.filter(|all| all.iter().any(|share| *share != 1.0)).map(|own| {
            let mut shares = vec![1f32; ordered.point_count];
            for (i, place) in places() {
                let share = &mut shares[place.index()];
                *share = share.min(own[i]);
            }
            shares
        });
        Self { locked, locked_faces, cost_factors: factors, error_map }
    }

    pub(crate) fn locked(&self) -> Option<&[bool]> {
        self.locked.as_deref()
    }
    /// The share of the error limit at each vertex; `None` if all are 1.
    pub(crate) fn error_map(&self) -> Option<&[f32]> {
        self.error_map.as_deref()
    }
    pub(crate) fn locked_vertices(&self) -> usize {
        self.locked.as_ref().map_or(0, |locked| locked.iter().filter(|l| **l).count())
    }
    /// Returns the number of faces whose vertices are all locked.
    pub(crate) fn locked_faces(&self) -> usize {
        self.locked_faces
    }
    /// Returns a copy of the cost factors, for a run that changes them.
    pub(crate) fn cost_factors(&self) -> Option<Vec<f32>> {
        self.cost_factors.clone()
    }
}

/// Checks the lists of a mesh against the number of vertices.
pub(crate) fn check(data: &MeshData<'_>, wanted: usize) -> Result<(), SimplifyError> {
    let lists = [
        ("locked", data.locked.map(<[bool]>::len)),
        ("importance", data.importance.map(<[f32]>::len)),
        ("error map", data.error_map.map(<[f32]>::len)),
    ];
    for (option, got) in lists {
        if let Some(got) = got.filter(|&got| got != wanted) {
            return Err(SimplifyError::WrongLength { option, wanted, got });
        }
    }
    let bad = |x: &&f32| !(x.is_finite() && **x > 0.0);
    if let Some(got) = data.importance.and_then(|all| all.iter().find(bad)) {
        let wanted = "a number above 0 for each vertex";
        return Err(SimplifyError::BadOption { option: "importance", wanted, got: f64::from(*got) });
    }
    let is_share = |x: &f32| (0.0..=1.0).contains(x);
    if let Some(shares) = data.error_map
        && let Some(vertex) = shares.iter().position(|x| !is_share(x))
    {
        let (wanted, got) = ("from 0 to 1", f64::from(shares[vertex]));
        return Err(SimplifyError::BadVertexValue { option: "error map", wanted, vertex, got });
    }
    Ok(())
}

/// Returns the locks of a mesh and of the vertices at which its error map is 0; `None` if the map adds none.
pub(crate) fn locks_of_map(data: &MeshData<'_>) -> Option<Vec<bool>> {
    let shares = data.error_map?;
    let is_locked = |v: usize| data.locked.is_some_and(|locked| locked[v]);
    if !(0..shares.len()).any(|v| shares[v] == 0.0 && !is_locked(v)) {
        return None;
    }
    Some((0..shares.len()).map(|v| is_locked(v) || shares[v] == 0.0).collect())
}

/// Returns the vertex that each vertex is merged with, and the number of merged vertices. Vertices are merged
/// onto locked ones: one at the same position first, otherwise one within the distance; a locked vertex is
/// merged with none.
pub(crate) fn weld_onto_locked(
    weld: &Weld,
    positions: PositionsView<'_>,
    locked: Option<&[bool]>,
) -> (Vec<VertexId>, usize) {
    let vertices = positions.len();
    let mut joined: Vec<VertexId> = (0..vertices as u32).map(|v| weld.of(VertexId(v))).collect();
    if let Some(locked) = locked {
        let same = weld::weld(positions);
        let (mut locked_near, mut locked_at) = (vec![NONE; vertices], vec![NONE; vertices]);
        for v in (0..vertices).rev().filter(|&v| locked[v]).map(VertexId::new) {
            locked_near[joined[v.index()].index()] = v;
            locked_at[same.of(v).index()] = v;
        }
        for (v, to) in joined.iter_mut().enumerate() {
            *to = match (locked_at[same.of(VertexId::new(v)).index()], locked_near[to.index()]) {
                _ if locked[v] => VertexId::new(v),
                (NONE, NONE) => *to,
                (NONE, near) => near,
                (held, _) => held,
            };
        }
    }
    let merged = joined.iter().enumerate().filter(|(v, to)| *v != to.index()).count();
    (joined, merged)
}

/// Wedges of locked vertices, by the engine's index of the wedge and, where possible, the region of the face.
#[derive(Default)]
pub(crate) struct LockedWedges(HashMap<(u32, Option<RegionId>), WedgeId>);

impl LockedWedges {
    pub(crate) fn add(&mut self, index: u32, region: Option<RegionId>, wedge: WedgeId) {
        self.0.entry((index, region)).or_insert(wedge);
        self.0.entry((index, None)).or_insert(wedge);
    }
    pub(crate) fn get(&self, index: u32, region: Option<RegionId>) -> Option<WedgeId> {
        self.0.get(&(index, region)).or_else(|| self.0.get(&(index, None))).copied()
    }
}

/// The wedge of the input at each corner of a result that belongs to a locked vertex; empty if none is
/// locked.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldWedges(Vec<[Option<WedgeId>; 3]>);

impl HeldWedges {
    pub(crate) fn new(corners: impl Iterator<Item = [Option<WedgeId>; 3]>) -> Self {
        Self(corners.collect())
    }

    /// True if nothing is locked.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the wedge held at a corner.
    pub(crate) fn at(&self, face: usize, k: usize) -> Option<WedgeId> {
        self.0.get(face)?[k]
    }

    /// Restores the attributes of locked vertices to their original bits.
    pub(crate) fn restore(&self, result: &mut TriMesh, input: &TriMesh) {
        if self.0.is_empty() {
            return;
        }
        let mut source = vec![None; result.wedge_count()];
        for (t, held) in result.triangles().iter().zip(&self.0) {
            for (w, held) in t.iter().zip(held) {
                source[w.index()] = held.or(source[w.index()]);
            }
        }
        restore(result, input, &source);
    }
}

/// Copies attributes from wedges of another mesh, where that mesh has them.
pub(crate) fn restore(result: &mut TriMesh, input: &TriMesh, source: &[Option<WedgeId>]) {
    fn with<T: Copy>(own: Option<&[T]>, other: Option<&[T]>, source: &[Option<WedgeId>]) -> Option<Vec<T>> {
        let mut own = own?.to_vec();
        for (x, w) in own.iter_mut().zip(source) {
            if let (Some(other), Some(w)) = (other, w) {
                *x = other[w.index()];
            }
        }
        Some(own)
    }
    let lengths = "there is one for each wedge, as before";
    result.set_normals(with(result.normals(), input.normals(), source)).expect(lengths);
    result.set_uvs(with(result.uvs(), input.uvs(), source)).expect(lengths);
    result.set_colors(with(result.colors(), input.colors(), source)).expect(lengths);
    for i in 0..result.further_attributes().len() {
        let a = &result.further_attributes()[i];
        let (semantic, width) = (a.semantic.clone(), a.width);
        let same = |a: &&lodsmith_core::Attribute| a.semantic == semantic && a.width == width;
        let Some(other) = input.further_attributes().iter().find(same) else { continue };
        let values = result.further_values_mut(i).chunks_exact_mut(width);
        for (own, w) in values.zip(source) {
            if let Some(w) = w {
                own.copy_from_slice(other.of(*w));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weld_goes_onto_locked_vertices() {
        // Vertices 0, 1 and 2 lie within the distance, 3 far away.
        let points = [[0f32, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let weld = weld::weld_within(PositionsView::F32(&points), 0.05);
        let all = weld_onto_locked(&weld, PositionsView::F32(&points), None);
        assert_eq!((all.0[1], all.0[2], all.1), (all.0[0], all.0[0], 2));
        let locked = [false, true, true, false];
        let (joined, merged) = weld_onto_locked(&weld, PositionsView::F32(&points), Some(&locked));
        assert_eq!((joined, merged), ([1, 1, 2, 3].map(VertexId).to_vec(), 1));
    }
    #[test]
    fn a_weld_merges_vertices_at_equal_positions_onto_locked_ones() {
        // Vertices 0 and 1 are locked, 2 has the position of 1.
        let points = [[0f32, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.0, 0.0]];
        let weld = weld::weld_within(PositionsView::F32(&points), 0.05);
        let locked = [true, true, false];
        let (joined, merged) = weld_onto_locked(&weld, PositionsView::F32(&points), Some(&locked));
        assert_eq!((joined, merged), ([0, 1, 1].map(VertexId).to_vec(), 1));
    }
}
