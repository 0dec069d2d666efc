//! Makes triangle meshes lighter: the closest mesh for the count, at the speed of the fastest tool.

mod attributes;
mod care;
pub mod clean;
mod cluster;
pub mod cluster_lod;
mod collapse;
pub mod control;
mod deviation;
mod error;
mod escalate;
mod fit;
mod given;
mod guard;
mod input;
mod lanes;
pub mod lod;
mod metric;
mod normals;
pub mod options;
mod planar;
mod progressive;
pub mod proposal;
mod prune;
mod rebuild;
mod recolor;
pub mod remesh;
pub mod report;
mod run;
pub mod scene;
mod shading;
mod tensor;
mod textures;
#[cfg(test)]
mod trial;
mod triangle;
mod unsubdivide;
mod vertex_removal;

pub use clean::{CleanOptions, CleanReport, Cleaned, NonManifold, clean};
pub use cluster_lod::{BuiltClusterLod, ClusterLodOptions, ClusterLodReport, cluster_lod};
pub use control::{Control, NoControl, Stage, Verdict};
pub use error::SimplifyError;
pub use lod::{Levels, LodChain, LodOptions, SceneChain, Screen, lod, lod_scene};
pub use lodsmith_core as core;
use lodsmith_core::{Surface, TriMesh};
pub use options::{
    AttributeWeights, BorderPolicy, Bound, Fit, Guards, Length, Measure, Method, MethodOptions, Placement,
    Preset, SimplifyOptions, Stop, TopologyPolicy,
};
pub use progressive::{Changed, Progressive, ProgressiveScene};
pub use proposal::{Change, Proposal};
pub use prune::Pruned;
pub use report::{Cleanup, Clustered, ErrorReport, Escalation, Refusal, Report, Simplified, StoppedBy};

pub use scene::{MeshCounts, Part, SimplifiedScene, simplify_scene};
pub use textures::{Texture, Textures};

/// Makes a mesh lighter.
///
/// Attributes of the mesh come along by themselves. For data that it does not hold,
/// [`correspondence`](lodsmith_core::correspondence::correspondence) says where each wedge of the result comes from:
///
/// ```
/// use lodsmith::core::{correspondence, shapes};
/// use lodsmith::{NoControl, SimplifyOptions, Stop, simplify};
///
/// let mesh = shapes::icosphere(4);
/// // Whatever an engine keeps at vertices: here the height, as a stand-in for light that was baked.
/// let light: Vec<f32> = mesh.positions().view().iter().map(|p| p[2] as f32).collect();
///
/// let lighter = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(0.2)), &mut NoControl)?.mesh;
/// let carried = correspondence(&mesh, &lighter)?.carry(&light, 1)?;
///
/// assert_eq!(carried.len(), lighter.wedge_count());
/// for (p, light) in lighter.positions().view().iter().zip(carried) {
///     assert!((light - p[2] as f32).abs() < 0.01);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`SimplifyError::NoFaces`], [`SimplifyError::BadOption`], [`SimplifyError::WrongLength`],
/// [`SimplifyError::Cancelled`].
pub fn simplify(
    mesh: &TriMesh,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Simplified, SimplifyError> {
    run::run(&run::Input { surface: mesh.surface(), mesh: Some(mesh), joined: None }, options, control)
        .map(|done| done.0)
}

/// The same from borrowed buffers, without attributes.
///
/// # Errors
/// As [`simplify`].
pub fn simplify_surface(
    surface: &Surface<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Simplified, SimplifyError> {
    run::run(&run::Input { surface: surface.clone(), mesh: None, joined: None }, options, control)
        .map(|done| done.0)
}
