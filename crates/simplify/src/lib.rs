//! Makes triangle meshes lighter: the closest mesh for the count, at the speed of the fastest tool.

mod attributes;
mod care;
pub mod clean;
mod cluster;
pub mod cluster_lod;
mod collapse;
pub mod control;
mod deviation;
mod escalate;
mod fit;
mod guard;
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
pub use escalate::Escalation;
pub use lod::{Levels, LodChain, LodOptions, SceneChain, Screen, lod, lod_scene};
pub use lodsmith_core as core;
use lodsmith_core::{MeshError, Surface, TriMesh};
pub use options::{
    AttributeWeights, BorderPolicy, Bound, Fit, Guards, Length, Measure, Method, MethodOptions, Placement,
    Preset, SimplifyOptions, Stop, TopologyPolicy,
};
pub use progressive::{Changed, Progressive, ProgressiveScene};
pub use proposal::{Change, Proposal};
pub use prune::Pruned;
pub use report::{Cleanup, Clustered, ErrorReport, Refusal, Report, StoppedBy};

pub use scene::{MeshCounts, Part, SimplifiedScene, simplify_scene};
pub use textures::{Texture, Textures};

/// Why a mesh could not be simplified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimplifyError {
    /// The mesh has no face, or none that is left after cleaning.
    #[error("the mesh has no face with an area ({faces} faces read)")]
    NoFaces {
        /// Faces of the input.
        faces: usize,
    },
    /// An option is out of range.
    #[error("{option} must be {wanted}, not {got}")]
    BadOption {
        /// The option.
        option: &'static str,
        /// What it may be.
        wanted: &'static str,
        /// What it was.
        got: f64,
    },
    /// A list has not one entry for each vertex.
    #[error("{option} has {got} entries for {wanted} vertices")]
    WrongLength {
        /// The option.
        option: &'static str,
        /// The number of vertices.
        wanted: usize,
        /// Its length.
        got: usize,
    },
    /// An option that only other methods know.
    #[error("{option} is for {takers}, not for {method}", method = method.name(), takers = names(takers))]
    NotOfMethod {
        /// The option.
        option: &'static str,
        /// The methods that take it.
        takers: &'static [Method],
        /// The method of the run.
        method: Method,
    },
    /// Two options that do not go together.
    #[error("{first} and {second} do not go together")]
    NotTogether {
        /// One of them.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// The caller ended the run.
    #[error("cancelled")]
    Cancelled,
    /// The buffers are no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

fn names(methods: &[Method]) -> String {
    let names: Vec<_> = methods.iter().map(|m| m.name()).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}

/// A lighter mesh, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Simplified {
    /// The result.
    pub mesh: TriMesh,
    /// What was done, and why it ended.
    pub report: Report,
}

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
