//! Locked positions, which become clusters of their own.

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::VertexId;

use super::model::{ClusterInput, ClusterPosition};

/// The distinct positions of locked vertices, and the vertices there.
#[derive(Default)]
pub(super) struct LockedPositions {
    /// One vertex at each position.
    pub(super) places: Vec<VertexId>,
    /// Vertices at locked positions, each with the index of its position.
    vertices: Vec<(u32, u32)>,
    /// Number of faces with all vertices at such positions.
    pub(super) faces: usize,
    /// Index of each position.
    number: HashMap<[u64; 3], u32>,
}

/// Hash key of a position. (Minus zero equals zero.)
fn key(p: DVec3) -> [u64; 3] {
    p.to_array().map(|x| (x + 0.0).to_bits())
}

impl LockedPositions {
    pub(super) fn new<P: ClusterPosition>(
        model: &ClusterInput<'_, P>,
        locked: impl Fn(usize) -> bool,
    ) -> Self {
        let mut places = Vec::new();
        let mut number: HashMap<[u64; 3], u32> = HashMap::new();
        let key = |v: usize| key(model.points[v].wide());
        let used = || (0..model.points.len()).filter(|&v| model.is_used(v));
        for v in used().filter(|&v| locked(v)) {
            number.entry(key(v)).or_insert_with(|| {
                places.push(VertexId::new(v));
                places.len() as u32 - 1
            });
        }
        let standing: Vec<(u32, u32)> =
            used().filter_map(|v| Some((v as u32, *number.get(&key(v))?))).collect();
        let mut is_locked = vec![false; model.points.len()];
        standing.iter().for_each(|x| is_locked[x.0 as usize] = true);
        let faces = model.faces.iter().filter(|t| t.iter().all(|v| is_locked[v.index()])).count();
        Self { places, vertices: standing, faces, number }
    }

    /// True if a locked vertex is at this position.
    pub(super) fn is_taken(&self, place: DVec3) -> bool {
        !self.number.is_empty() && self.number.contains_key(&key(place))
    }

    /// Assigns the vertices at locked positions to clusters from `first` on.
    pub(super) fn assign_clusters(&self, cluster_of: &mut [u32], first: usize) {
        for &(v, place) in &self.vertices {
            cluster_of[v as usize] = first as u32 + place;
        }
    }
}
