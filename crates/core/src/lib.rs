//! Triangle meshes, distances between them, and correspondence of one mesh to another.
//!
//! Data, queries and measures only. No files, no clocks, no printing, no simplification.

#[cfg(feature = "proptest")]
pub mod arbitrary;
pub mod clusters;
pub mod correspondence;
pub mod disjoint_sets;
pub mod geometry;
pub mod ids;
pub mod image;
pub mod measure;
pub mod memory;
pub mod mesh;
pub mod model;
pub mod numbers;
pub mod polygon;
pub mod sampling;
pub mod shapes;
pub mod sorted;
pub mod spatial;
pub mod splits;
pub mod topology;
#[cfg(feature = "serde")]
pub mod wire;

pub use clusters::{Cluster, ClusterLod};
pub use correspondence::{Correspondence, Source, correspondence};
pub use disjoint_sets::DisjointSets;
pub use ids::{ClusterId, FaceId, GroupId, HalfEdgeId, RegionId, VertexId, WedgeId};
pub use image::Image;
pub use mesh::{
    Attribute, Bounds, IntegerType, MeshBuffers, MeshError, Morphed, Positions, PositionsView, Semantic,
    Surface, TriMesh,
};
pub use model::Model;
pub use splits::Splits;
pub use topology::Topology;
