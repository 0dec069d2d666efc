//! Hierarchical clusters for levels of detail: which coarser triangles replace which finer ones, and at what
//! error.
//!
//! ```text
//! level 2        [ a ]                     drawn where group 2 is good enough
//!                  │ group 2
//! level 1     [b] [c]   [d]
//!              │ group 0  │ group 1
//! level 0   [e][f][g]  [h][i]              the original triangles
//! ```
//!
//! The clusters that go into a group and the clusters that come out of it have the same border, vertex by
//! vertex, so one set can replace the other whatever is drawn around it. A *cut* is a choice of groups; if a
//! group is taken, all groups below it are, so no two clusters of a cut cover the same place and none leaves
//! a crack.

use crate::ids::{ClusterId, FaceId, GroupId};
use crate::mesh::part::extract_faces;
use crate::mesh::{MeshError, TriMesh};

/// Maximum number of triangles, and of wedges, of one cluster: what an 8-bit index can address.
pub const MAX_CLUSTER_SIZE: usize = 256;
/// Relative tolerance for rounding when testing that one sphere contains another.
const SPHERE_TOLERANCE: f64 = 1e-6;

/// Reasons why data do not form a valid cluster hierarchy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClusterError {
    /// A cluster has no faces, or too many.
    #[error("cluster {cluster} has {faces} faces; it may have 1 to {MAX_CLUSTER_SIZE}")]
    FaceCount {
        /// The cluster.
        cluster: usize,
        /// Its number of faces.
        faces: usize,
    },
    /// A cluster uses too many wedges.
    #[error("cluster {cluster} has {wedges} vertices; it may have up to {MAX_CLUSTER_SIZE}")]
    WedgeCount {
        /// The cluster.
        cluster: usize,
        /// Its number of wedges.
        wedges: usize,
    },
    /// The face counts of the clusters do not add up to the face count of the mesh.
    #[error("the clusters have {got} faces in total, but their mesh has {wanted}")]
    Faces {
        /// Number of faces of all clusters.
        got: usize,
        /// Number of faces of the mesh.
        wanted: usize,
    },
    /// A cluster refers to a group that does not exist, or goes into a group that is not above the group that
    /// it comes from.
    #[error(
        "cluster {cluster} refers to group {group}, which does not exist (there are {count}) or is not above its own group"
    )]
    Order {
        /// The cluster.
        cluster: usize,
        /// The group.
        group: u32,
        /// Number of groups.
        count: usize,
    },
    /// The error or sphere of a group is not finite, is negative, or is smaller than that of a group below
    /// it.
    #[error("{what} of group {group} is {problem}")]
    Group {
        /// The group.
        group: usize,
        /// The wrong property: its error or its sphere.
        what: &'static str,
        /// Description of the problem.
        problem: &'static str,
    },
    /// The sphere of a cluster is not finite, or has a negative radius.
    #[error("the sphere of cluster {cluster} is not finite or has a negative radius")]
    Sphere {
        /// The cluster.
        cluster: usize,
    },
    /// No cluster goes into a group.
    #[error("no cluster goes into group {group}")]
    EmptyGroup {
        /// The group.
        group: usize,
    },
    /// The mesh is not valid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// A sphere, in the units of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub center: [f64; 3],
    /// Its radius.
    pub radius: f64,
}

impl Sphere {
    /// Returns a sphere that contains all of `spheres`, centred on the middle of their bounding box.
    pub fn around(spheres: impl Iterator<Item = Sphere> + Clone) -> Self {
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for s in spheres.clone() {
            for k in 0..3 {
                (min[k], max[k]) = (min[k].min(s.center[k] - s.radius), max[k].max(s.center[k] + s.radius));
            }
        }
        if min[0] > max[0] {
            return Self::default();
        }
        let center = [0, 1, 2].map(|k| min[k] + 0.5 * (max[k] - min[k]));
        let radius = spheres.map(|s| distance(center, s.center) + s.radius).fold(0.0, f64::max);
        // Rounding must not let a sphere that touches from inside stick out.
        Self { center, radius: radius * (1.0 + 1e-9) }
    }

    fn is_sound(&self) -> bool {
        self.center.iter().all(|x| x.is_finite()) && self.radius.is_finite() && self.radius >= 0.0
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [0, 1, 2].map(|k| a[k] - b[k]);
    let largest = d.iter().fold(0f64, |m, x| m.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * d.iter().map(|x| (x / largest) * (x / largest)).sum::<f64>().sqrt()
}

/// Error of a cluster or group, and the sphere within which it applies: the basis of a level-of-detail
/// choice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bound {
    /// Contains everything chosen together and everything that it replaces.
    pub sphere: Sphere,
    /// Largest distance from the original, in the units of the mesh.
    pub error: f64,
}

/// A few neighbouring triangles of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Number of faces of the mesh that belong to it; they follow the faces of the previous cluster.
    pub face_count: usize,
    /// Bounding sphere of its triangles.
    pub sphere: Sphere,
    /// The group that it came out of; `None` for a cluster of original triangles.
    pub from: Option<GroupId>,
    /// The group that it went into; `None` for a cluster of the coarsest ones.
    pub into: Option<GroupId>,
}

/// Camera position and resolution for a level-of-detail choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Position in the space of the mesh.
    pub position: [f64; 3],
    /// Size in pixels of one unit of length at a distance of one unit: `height_px / (2 tan(fov_y / 2))`.
    pub pixels_per_unit: f64,
    /// Near distance, the smallest that is used; above 0.
    pub near: f64,
}

impl Eye {
    /// Returns the largest size in pixels of the error of a bound: `error · pixels_per_unit / max(near, d -
    /// r)`, where `d` is the distance from the eye to the centre of the sphere and `r` its radius.
    pub fn pixels(&self, bound: &Bound) -> f64 {
        let distance = distance(self.position, bound.sphere.center) - bound.sphere.radius;
        bound.error * self.pixels_per_unit / distance.max(self.near)
    }
}

/// The vertices and triangles of a cluster in the layout of GPU meshlets.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Meshlet {
    /// Wedges of the mesh, in the order of their first use.
    pub wedges: Vec<crate::WedgeId>,
    /// Three indices into that list for each triangle.
    pub triangles: Vec<[u8; 3]>,
}

/// Counts and errors of one level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelCounts {
    /// Number of clusters.
    pub clusters: usize,
    /// Number of clusters without a coarser replacement.
    pub coarsest_clusters: usize,
    /// Number of triangles.
    pub faces: usize,
    /// Number of wedges; a wedge shared by several clusters counts once for each.
    pub wedges: usize,
    /// The smallest error among them.
    pub least_error: f64,
    /// The largest error among them.
    pub largest_error: f64,
}

/// A mesh at many levels of detail: clusters, and the groups that link finer to coarser ones.
///
/// Groups are numbered so that a cluster comes out of a group with a lower number than the group it goes
/// into.
#[derive(Clone, Debug, PartialEq)]
pub struct ClusterLod {
    mesh: TriMesh,
    clusters: Vec<Cluster>,
    groups: Vec<Bound>,
    /// The first face of each cluster, then the total number of faces.
    first_face: Vec<usize>,
    /// The level of the clusters that come out of each group, from 1.
    levels: Vec<u32>,
}

impl ClusterLod {
    /// Checks and builds a hierarchy; `mesh` holds the triangles of all clusters, cluster after cluster.
    ///
    /// # Errors
    /// [`ClusterError`] if counts, order, errors or spheres are not valid.
    pub fn new(mesh: TriMesh, clusters: Vec<Cluster>, groups: Vec<Bound>) -> Result<Self, ClusterError> {
        let mut first_face = Vec::with_capacity(clusters.len() + 1);
        first_face.push(0);
        let mut sum = 0usize;
        for (cluster, c) in clusters.iter().enumerate() {
            if c.face_count == 0 || c.face_count > MAX_CLUSTER_SIZE {
                return Err(ClusterError::FaceCount { cluster, faces: c.face_count });
            }
            if !c.sphere.is_sound() {
                return Err(ClusterError::Sphere { cluster });
            }
            sum += c.face_count;
            first_face.push(sum);
        }
        if sum != mesh.face_count() {
            return Err(ClusterError::Faces { got: sum, wanted: mesh.face_count() });
        }
        let bad = |group, what, problem| Err(ClusterError::Group { group, what, problem });
        for (group, g) in groups.iter().enumerate() {
            if !(g.error.is_finite() && g.error >= 0.0) {
                return bad(group, "the error", "negative or not finite");
            }
            if !g.sphere.is_sound() {
                return bad(group, "the sphere", "not finite or has a negative radius");
            }
        }
        let count = groups.len();
        let mut levels = vec![0u32; count];
        let mut order: Vec<usize> = (0..clusters.len()).filter(|&c| clusters[c].into.is_some()).collect();
        order.sort_by_key(|&c| clusters[c].into);
        for cluster in order {
            let c = &clusters[cluster];
            let Some(into) = c.into else { continue };
            let from = c.from.filter(|f| f.index() >= count || *f >= into);
            if let Some(bad) = from.or(Some(into).filter(|g| g.index() >= count)) {
                return Err(ClusterError::Order { cluster, group: bad.0, count });
            }
            let (group, above) = (into.index(), &groups[into.index()]);
            let below = c.from.map_or(Bound { sphere: c.sphere, error: 0.0 }, |f| groups[f.index()]);
            if above.error < below.error {
                return bad(group, "the error", "smaller than the error below it");
            }
            let reach = distance(above.sphere.center, below.sphere.center) + below.sphere.radius;
            if reach > above.sphere.radius * (1.0 + SPHERE_TOLERANCE) {
                return bad(group, "the sphere", "too small to contain the spheres below it");
            }
            levels[group] = levels[group].max(1 + c.from.map_or(0, |f| levels[f.index()]));
        }
        if let Some((cluster, group)) = clusters
            .iter()
            .enumerate()
            .find_map(|(i, c)| c.from.filter(|f| f.index() >= count).map(|f| (i, f.0)))
        {
            return Err(ClusterError::Order { cluster, group, count });
        }
        if let Some(group) = levels.iter().position(|&l| l == 0) {
            return Err(ClusterError::EmptyGroup { group });
        }
        let lod = Self { mesh, clusters, groups, first_face, levels };
        for id in lod.ids() {
            let wedges = lod.wedge_count(id);
            if wedges > MAX_CLUSTER_SIZE {
                return Err(ClusterError::WedgeCount { cluster: id.index(), wedges });
            }
        }
        Ok(lod)
    }

    /// The triangles of all clusters, one cluster after the other, with all their attributes.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }
    /// All clusters: first the clusters of the original, then ordered by the group that they came out of.
    pub fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }
    /// Error and sphere of the clusters that come out of each group.
    pub fn groups(&self) -> &[Bound] {
        &self.groups
    }
    /// The ids of all clusters.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = ClusterId> + use<> {
        (0..self.clusters.len()).map(ClusterId::new)
    }
    /// The faces of a cluster.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn faces(&self, id: ClusterId) -> impl ExactSizeIterator<Item = FaceId> + use<> {
        (self.first_face[id.index()]..self.first_face[id.index() + 1]).map(FaceId::new)
    }
    /// The level of a cluster: 0 holds the original triangles.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn level(&self, id: ClusterId) -> u32 {
        self.clusters[id.index()].from.map_or(0, |g| self.levels[g.index()])
    }
    /// Returns the error and sphere of a cluster; the error is 0 for original triangles. The cluster may be
    /// drawn where this is good enough.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn cluster_bound(&self, id: ClusterId) -> Bound {
        let c = &self.clusters[id.index()];
        c.from.map_or(Bound { sphere: c.sphere, error: 0.0 }, |g| self.groups[g.index()])
    }
    /// Returns the error and sphere of the clusters that replace a cluster; `None` for one of the coarsest
    /// clusters. The cluster is drawn only where its replacement is not good enough.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn parent_bound(&self, id: ClusterId) -> Option<Bound> {
        self.clusters[id.index()].into.map(|g| self.groups[g.index()])
    }
    /// The largest error of any group: a cut at this error is the coarsest.
    pub fn coarsest_error(&self) -> f64 {
        self.groups.iter().fold(0.0, |largest, g| largest.max(g.error))
    }

    /// Returns the counts of each level, the original first.
    pub fn level_counts(&self) -> Vec<LevelCounts> {
        let mut all: Vec<LevelCounts> = Vec::new();
        for id in self.ids() {
            let level = self.level(id) as usize;
            while all.len() <= level {
                all.push(LevelCounts { least_error: f64::INFINITY, ..LevelCounts::default() });
            }
            let (own, error) = (&mut all[level], self.cluster_bound(id).error);
            own.clusters += 1;
            own.coarsest_clusters += usize::from(self.parent_bound(id).is_none());
            own.faces += self.clusters[id.index()].face_count;
            own.wedges += self.wedge_count(id);
            (own.least_error, own.largest_error) = (own.least_error.min(error), own.largest_error.max(error));
        }
        all
    }

    /// Returns the clusters whose error is at most `error` and whose parents' error is above it: the lightest
    /// surface within that error everywhere. Ids ascend. Cost: O(clusters).
    pub fn cut(&self, error: f64) -> Vec<ClusterId> {
        self.cut_where(|bound| bound.error <= error)
    }

    /// Returns the clusters whose error covers at most `pixels` for an eye, and whose parents' error covers
    /// more.
    pub fn cut_for_view(&self, eye: &Eye, pixels: f64) -> Vec<ClusterId> {
        self.cut_where(|bound| eye.pixels(bound) <= pixels)
    }

    /// Returns the clusters for which `is_good` is true and whose parents' bounds are not good.
    ///
    /// A group is taken only if all groups below it are, so every `is_good` gives a surface without cracks.
    pub fn cut_where(&self, is_good: impl Fn(&Bound) -> bool) -> Vec<ClusterId> {
        let mut taken: Vec<bool> = self.groups.iter().map(&is_good).collect();
        // A group that is not taken prevents all groups above it from being taken; groups ascend.
        let mut links: Vec<(GroupId, GroupId)> =
            self.clusters.iter().filter_map(|c| Some((c.into?, c.from?))).collect();
        links.sort_unstable();
        for (above, below) in links {
            taken[above.index()] &= taken[below.index()];
        }
        let is_taken = |g: Option<GroupId>, none: bool| g.map_or(none, |g| taken[g.index()]);
        self.ids()
            .filter(|id| {
                let c = &self.clusters[id.index()];
                is_taken(c.from, true) && !is_taken(c.into, false)
            })
            .collect()
    }

    /// Returns the surface of some clusters as a mesh, with attributes and regions; faces in the order of the
    /// clusters.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn mesh_of(&self, clusters: &[ClusterId]) -> TriMesh {
        let faces: Vec<FaceId> = clusters.iter().flat_map(|&id| self.faces(id)).collect();
        extract_faces(&self.mesh, &faces).mesh
    }

    /// Returns a cluster with its own short list of wedges.
    ///
    /// # Panics
    /// If there is no such cluster.
    pub fn meshlet(&self, id: ClusterId) -> Meshlet {
        let mut meshlet = Meshlet::default();
        for face in self.faces(id) {
            meshlet.triangles.push(self.mesh.triangles()[face.index()].map(|w| {
                let known = meshlet.wedges.iter().position(|x| *x == w);
                known.unwrap_or_else(|| {
                    meshlet.wedges.push(w);
                    meshlet.wedges.len() - 1
                }) as u8
            }));
        }
        meshlet
    }

    fn wedge_count(&self, id: ClusterId) -> usize {
        let mut wedges: Vec<_> = self.faces(id).flat_map(|f| self.mesh.triangles()[f.index()]).collect();
        wedges.sort_unstable();
        wedges.dedup();
        wedges.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Positions, VertexId};

    fn sphere(radius: f64) -> Sphere {
        Sphere { center: [0.0; 3], radius }
    }

    /// Two triangles of a square, each a cluster, and one triangle of half its area that replaces both.
    fn square() -> (TriMesh, Vec<Cluster>, Vec<Bound>) {
        let p = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, 0.0f32]);
        let t = [[0, 1, 2], [0, 2, 3], [0, 1, 3]].map(|t: [u32; 3]| t.map(VertexId));
        let mesh = TriMesh::new(Positions::F32(p.to_vec()), t.to_vec()).unwrap();
        let leaf = Cluster { face_count: 1, sphere: sphere(2.0), from: None, into: Some(GroupId(0)) };
        let root = Cluster { from: Some(GroupId(0)), into: None, ..leaf };
        (mesh, vec![leaf, leaf, root], vec![Bound { sphere: sphere(2.0), error: 0.5 }])
    }

    #[test]
    fn a_cut_is_fine_below_the_error_and_coarse_from_it_on() {
        let (mesh, clusters, groups) = square();
        let lod = ClusterLod::new(mesh, clusters, groups).unwrap();
        assert_eq!(lod.cut(0.49), [0, 1].map(ClusterId));
        assert_eq!(lod.cut(0.5), [2].map(ClusterId));
        assert_eq!((lod.level(ClusterId(0)), lod.level(ClusterId(2))), (0, 1));
        let counts = lod.level_counts();
        assert_eq!(
            counts.iter().map(|c| (c.clusters, c.faces, c.wedges)).collect::<Vec<_>>(),
            [(2, 2, 6), (1, 1, 3)]
        );
        assert_eq!((counts[0].largest_error, counts[1].largest_error), (0.0, 0.5));
        assert_eq!((counts[0].coarsest_clusters, counts[1].coarsest_clusters), (0, 1));
        let eye = |x| Eye { position: [x, 0.0, 0.0], pixels_per_unit: 100.0, near: 0.1 };
        // 0.5 units cover 50 pixels at a distance of 1 from the sphere, 5 at 10.
        assert_eq!(lod.cut_for_view(&eye(3.0), 5.0), [0, 1].map(ClusterId));
        assert_eq!(lod.cut_for_view(&eye(12.0), 5.0), [2].map(ClusterId));
        assert_eq!(lod.mesh_of(&lod.cut(1.0)).vertex_count(), 3);
        let meshlet = lod.meshlet(ClusterId(1));
        assert_eq!((meshlet.wedges.len(), meshlet.triangles), (3, vec![[0, 1, 2]]));
    }

    #[test]
    fn inconsistent_numbers_are_refused() {
        let refused = |change: &dyn Fn(&mut Vec<Cluster>, &mut Vec<Bound>)| {
            let (mesh, mut clusters, mut groups) = square();
            change(&mut clusters, &mut groups);
            ClusterLod::new(mesh, clusters, groups).unwrap_err()
        };
        assert!(matches!(refused(&|c, _| c[1].face_count = 0), ClusterError::FaceCount { cluster: 1, .. }));
        assert!(matches!(refused(&|c, _| c[1].face_count = 2), ClusterError::Faces { got: 4, .. }));
        assert!(matches!(
            refused(&|c, _| c[0].into = Some(GroupId(7))),
            ClusterError::Order { group: 7, .. }
        ));
        assert!(matches!(refused(&|c, _| c[2].from = Some(GroupId(1))), ClusterError::Order { .. }));
        assert!(matches!(refused(&|c, _| c[2].into = Some(GroupId(0))), ClusterError::Order { .. }));
        assert!(matches!(
            refused(&|_, g| g[0].error = f64::NAN),
            ClusterError::Group { what: "the error", .. }
        ));
        assert!(matches!(refused(&|_, g| g[0].sphere = sphere(1.0)), ClusterError::Group { .. }));
        assert!(matches!(
            refused(&|c, _| c[0].sphere.radius = f64::NAN),
            ClusterError::Sphere { cluster: 0 }
        ));
        assert!(matches!(
            refused(&|c, _| c.iter_mut().for_each(|c| c.into = None)),
            ClusterError::EmptyGroup { group: 0 }
        ));
    }

    #[test]
    fn a_sphere_around_others_contains_them() {
        let a = Sphere { center: [1.0, 0.0, 0.0], radius: 1.0 };
        let b = Sphere { center: [-3.0, 1.0, 0.0], radius: 0.25 };
        let around = Sphere::around([a, b].into_iter());
        for s in [a, b] {
            assert!(distance(around.center, s.center) + s.radius <= around.radius);
        }
        assert!(around.radius < 4.0);
        assert_eq!(Sphere::around([].into_iter()), Sphere::default());
    }
}
