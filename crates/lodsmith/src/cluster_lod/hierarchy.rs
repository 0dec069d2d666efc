//! The clusters and groups made so far, and what the next round starts from.

use lodsmith_core::clusters::{Bound, Cluster, Sphere};
use lodsmith_core::mesh::part::{SharedIds, append, extract_faces};
use lodsmith_core::{FaceId, GroupId, TriMesh, VertexId};

use crate::SimplifyError;

/// A cluster with no coarser replacement yet.
#[derive(Debug, Default)]
pub(super) struct Front {
    pub(super) cluster: usize,
    pub(super) faces: Vec<FaceId>,
    /// Samples of the original surface that it represents.
    pub(super) samples: Vec<[f64; 3]>,
}

/// The levels built so far.
pub(super) struct Build {
    /// The faces of all clusters, cluster after cluster.
    pub(super) pool: TriMesh,
    pub(super) clusters: Vec<Cluster>,
    pub(super) groups: Vec<Bound>,
}

/// A simplified group.
pub(super) struct SimplifiedGroup {
    /// Its faces, cluster by cluster.
    pub(super) mesh: TriMesh,
    /// Its vertices and wedges that are in the pool already.
    pub(super) known: SharedIds,
    pub(super) pieces: Vec<Vec<u32>>,
    pub(super) error: f64,
    /// Samples of the original, for each cluster.
    pub(super) samples: Vec<Vec<[f64; 3]>>,
}

impl Build {
    pub(super) fn vertices(&self, face: FaceId) -> [VertexId; 3] {
        self.pool.triangles()[face.index()].map(|w| self.pool.vertex_of(w))
    }

    /// Returns the bounding sphere of everything that a cluster represents.
    pub(super) fn reach(&self, cluster: usize) -> Sphere {
        let c = &self.clusters[cluster];
        c.from.map_or(c.sphere, |g| self.groups[g.index()].sphere)
    }

    /// Adds clusters whose faces are in the pool already, from `first` on in this order.
    pub(super) fn add_clusters(
        &mut self,
        mut first: usize,
        pieces: &[Vec<u32>],
        from: Option<GroupId>,
    ) -> Vec<Front> {
        let mut front = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let faces: Vec<FaceId> = (first..first + piece.len()).map(FaceId::new).collect();
            first += piece.len();
            let corners =
                faces.iter().flat_map(|&f| self.vertices(f)).map(|v| self.pool.positions().view().get(v));
            let corners: Vec<Sphere> = corners.map(|center| Sphere { center, radius: 0.0 }).collect();
            let sphere = Sphere::around(corners.iter().copied());
            front.push(Front { cluster: self.clusters.len(), faces, samples: Vec::new() });
            self.clusters.push(Cluster { face_count: piece.len(), sphere, from, into: None });
        }
        front
    }

    /// Adds the result of a simplified group.
    pub(super) fn add_group(
        &mut self,
        members: &[usize],
        front: &[Front],
        made: SimplifiedGroup,
    ) -> Result<Vec<Front>, SimplifyError> {
        let group = GroupId::new(self.groups.len());
        let mut spheres = Vec::new();
        let mut error = made.error;
        for &i in members {
            let cluster = front[i].cluster;
            spheres.push(self.reach(cluster));
            if let Some(from) = self.clusters[cluster].from {
                error = error.max(self.groups[from.index()].error);
            }
            self.clusters[cluster].into = Some(group);
        }
        let first = self.pool.face_count();
        append(&mut self.pool, &made.mesh, &made.known)?;
        let mut out = self.add_clusters(first, &made.pieces, Some(group));
        spheres.extend(out.iter().map(|own| self.clusters[own.cluster].sphere));
        for (own, samples) in out.iter_mut().zip(made.samples) {
            own.samples = samples;
        }
        self.groups.push(Bound { sphere: Sphere::around(spheres.iter().copied()), error });
        Ok(out)
    }
}

/// Reorders the faces of a mesh by clusters.
pub(super) fn arranged(mesh: &TriMesh, pieces: &[Vec<u32>]) -> TriMesh {
    let faces: Vec<FaceId> = pieces.iter().flatten().map(|&f| FaceId(f)).collect();
    extract_faces(mesh, &faces).mesh
}
