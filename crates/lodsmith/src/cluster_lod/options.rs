//! Options of cluster levels of detail.

use crate::options::{AttributeWeights, BorderPolicy};

/// Options of [`cluster_lod`](crate::cluster_lod()).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClusterLodOptions {
    /// Maximum number of triangles per cluster: 8 to 256.
    pub triangles: usize,
    /// Maximum number of vertices per cluster, those on seams counted once per side: 8 to 256.
    pub vertices: usize,
    /// Approximate number of clusters per group: 4 to 64. A group may get half as many, or twice.
    pub group: usize,
    /// A group that keeps more than this fraction of its triangles stays unchanged for the round.
    pub keep_at_most: f64,
    /// Weights of the attributes in the error metric.
    pub weights: AttributeWeights,
    /// Treatment of the open borders of the mesh. Where several groups meet on a border, it is always locked.
    pub border: BorderPolicy,
}

impl Default for ClusterLodOptions {
    fn default() -> Self {
        Self {
            triangles: 128,
            vertices: 128,
            group: 16,
            keep_at_most: 0.75,
            weights: AttributeWeights::default(),
            border: BorderPolicy::default(),
        }
    }
}
