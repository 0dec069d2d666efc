//! Simplification of triangle meshes: the closest mesh for the count, at the speed of the fastest tool.
//!
//! A mesh from slices, to a tenth of its triangles, and back:
//!
//! ```
//! # let ball = lodsmith::core::shapes::icosphere(4);
//! # let (positions, indices) = ball.to_indexed();
//! use lodsmith::core::TriMesh;
//! use lodsmith::{SimplifyOptions, Stop, simplify};
//!
//! let mesh = TriMesh::from_indexed(&positions, &indices)?; // &[[f32; 3]], &[u32]
//! let lighter = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(0.1)))?;
//!
//! let (positions, indices) = lighter.mesh.to_indexed();
//! assert!(indices.len() / 3 <= mesh.face_count() / 10);
//! assert_eq!(positions.len(), lighter.report.vertices);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With texture coordinates, whose seams are kept; with locked vertices; within a distance of the original
//! that is proven in both directions; and with a control that sees the progress and can end the run:
//!
//! ```
//! use lodsmith::core::shapes;
//! use lodsmith::{Input, Length, NoControl, SimplifyOptions, Stop, simplify_with};
//!
//! let mut mesh = shapes::grid(32);
//! let uvs = mesh.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
//! mesh.set_uvs(Some(uvs))?;
//! let locked: Vec<bool> = mesh.positions().view().iter().map(|p| p[0] == 0.0).collect();
//!
//! let options = SimplifyOptions::new(Stop::error(Length::OfDiagonal(0.001)));
//! let lighter = simplify_with(Input::new(&mesh).locked(&locked), &options, &mut NoControl)?;
//! assert!(lighter.report.error.bound.is_some_and(|bound| bound <= 0.001 * lighter.report.error.diagonal));
//! assert!(lighter.mesh.uvs().is_some() && lighter.report.locked_vertices == 33);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A chain of levels of detail in one run, and the distance from which each may be shown:
//!
//! ```
//! use lodsmith::lod::error_of;
//! use lodsmith::{Levels, LodOptions, Screen, lod};
//!
//! let mesh = lodsmith::core::shapes::icosphere(5);
//! let chain = lod(&mesh, &LodOptions::new(Levels::Steps { count: 3, factor: 0.5 }))?;
//! let errors = chain.levels.iter().filter_map(|level| error_of(&level.report));
//! let from: Vec<f64> = errors.map(|error| Screen::default().distance(error)).collect();
//! assert!(from.is_sorted() && chain.levels[2].report.faces <= mesh.face_count() / 8);
//! # Ok::<(), lodsmith::SimplifyError>(())
//! ```
//!
//! Several meshes under one budget: [`simplify_scene`]. All levels in one structure: [`Progressive`]. Repair:
//! [`clean()`]. Options: [`SimplifyOptions`]; result: [`Report`].

mod attributes;
mod chunks;
pub mod clean;
pub mod cluster_lod;
mod collapse;
mod constraints;
pub mod control;
mod cost;
mod deviation;
mod error;
mod fit;
mod input;
pub mod lod;
mod methods;
pub mod options;
mod pieces;
mod pipeline;
mod progressive;
pub mod proposal;
mod prune;
pub mod report;
mod run;
pub mod scene;
#[cfg(test)]
mod test_support;
mod two_sided;

pub use clean::{CleanOptions, CleanReport, Cleaned, NonManifold, Sheets, clean};
pub use cluster_lod::{BuiltClusterLod, ClusterLodOptions, ClusterLodReport, cluster_lod};
pub use control::{Control, NoControl, Stage, Verdict};
pub use error::SimplifyError;
pub use lod::{Levels, LodChain, LodOptions, SceneChain, Screen, lod, lod_scene, lod_with};
pub use lodsmith_core as core;
use lodsmith_core::TriMesh;

pub use input::{Input, MeshData, OwnedMeshData};
pub use methods::remesh;
pub use options::{
    AttributeWeights, BlockSizes, BorderPolicy, Bound, Effort, Fit, Guards, Length, Measure, Method,
    MethodKind, Placement, Preset, Remesh, RemeshPattern, SimplifyOptions, Stop, TopologyPolicy,
};
pub use progressive::{ChangedRanges, Progressive, ProgressiveScene};
pub use proposal::{Change, Proposal};
pub use prune::Pruned;
pub use report::{Cleanup, Clustered, ErrorReport, Escalation, Refusal, Report, Simplified, StoppedBy};

pub use attributes::textures::{Texture, Textures};
pub use scene::{MeshCounts, Part, Place, SimplifiedScene, Starved, simplify_scene};
pub use two_sided::two_sided_faces;

/// Reduces the number of triangles of a mesh and keeps the result as close to it as possible.
///
/// The default method ([`Method::Memoryless`]) collapses edges, the cheapest first, until a [`Stop`] is met,
/// and then moves the remaining vertices towards the input by least squares ([`Fit`]). One collapse merges
/// the vertices u and v into w, at the position of least cost, and the two faces at the edge vanish:
///
/// ```text
/// o-------o-------o        o-------o-------o
/// | `.   / \   .' |        | `.    |    .' |
/// |   `./   \.'   |        |   `.  |  .'   |
/// |    u-----v    |   →    |     `.w.'     |
/// |   .'\   /`.   |        |   .'  |  `.   |
/// | .'   \ /   `. |        | .'    |    `. |
/// o-------o-------o        o-------o-------o
/// ```
///
/// # Input
/// Any [`TriMesh`], in any unit and of either precision: open, closed or non-manifold, a triangle soup, with
/// holes or unused vertices. Vertices at equal positions count as one, and so do vertices of two borders that
/// differ only by rounding (2^-22 of the largest coordinate, in double precision of the extent); degenerate
/// and duplicate faces and faces with NaN or infinite positions are left out, and [`Report::cleanup`] counts
/// them. Lengths among the options are in the units of the mesh or a share of the diagonal of its bounding
/// box ([`Length`]); angles are in degrees.
///
/// # Output
/// [`Simplified::mesh`] has the units, the precision of positions and the attributes of the input (normals,
/// texture coordinates, colours, skins, morph targets, named values; [`Report::dropped`] lists the
/// exceptions), and its regions. Faces, vertices and wedges are renumbered. [`Simplified::report`] says what
/// was done; its lengths are in the units of the mesh.
///
/// # Promises
/// - The stop is met if the report says so ([`Report::reached`]); otherwise [`Report::stopped_by`] and
///   [`Report::proposals`] say why not and what would help.
/// - With [`Bound::OneSided`] no point of the result lies farther from the input than [`ErrorReport::bound`];
///   with [`Bound::TwoSided`], the default of a stop at an error, no point of the input lies farther from the
///   result either. This is proven, not sampled.
/// - The [`TopologyPolicy`], the [`BorderPolicy`] and the [`Guards`] are kept; only [`Method::Cluster`] and
///   [`Method::Remesh`] with voxels create a new topology. Locked vertices keep their positions and
///   attributes to the bit, and every vertex that did not move keeps its position to the bit.
/// - The same mesh, options and seed give the same bytes, on every processor and with any number of threads.
///   (A [`Verdict::Finish`] ends a run wherever it is, so the result depends on when it comes.)
///
/// # Cost
/// One sort along a Morton curve, then sweeps over the vertices: 1.2 to 1.45 s for a million triangles
/// (prototype, docs/decisions/0002), 0.01 s for 16,192 (README). A second pass follows where parts or handles
/// block the target (docs/decisions/0020). A stop at an error takes about eight runs that share their first
/// part, usually one proof, and one measurement (docs/decisions/0008).
///
/// Peak memory beyond the mesh, for each of its triangles, positions alone: 119 to 128 bytes at 0.2 million
/// triangles and 75 at 2 million with most edge collapses, 177 and 107 with [`Method::Quadric`], 58 and 37
/// with [`Method::Cluster`]; other methods take 195 to 630. Edge collapses of large meshes may take twice as much while
/// the mesh is cut into blocks (docs/decisions/0032). Each value of an attribute adds 29 and 20,
/// [`Measure::Always`] 100, and a stop at an error 150 to 760. (Measured: docs/decisions/0022.)
///
/// Large meshes (from 400,000 faces on), [`Method::Cluster`] and the measurement use the caller's rayon pool, other runs one
/// thread; the result does not depend on their number.
///
/// # Other data of the mesh
/// For data that the mesh does not hold, [`correspondence`](lodsmith_core::correspondence::correspondence)
/// says where each wedge of the result comes from:
///
/// ```
/// use lodsmith::core::{correspondence, shapes};
/// use lodsmith::{SimplifyOptions, Stop, simplify};
///
/// let mesh = shapes::icosphere(4);
/// // Any data that an engine stores at vertices: here the height, in place of baked light.
/// let light: Vec<f32> = mesh.positions().view().iter().map(|p| p[2] as f32).collect();
///
/// let lighter = simplify(&mesh, &SimplifyOptions::new(Stop::ratio(0.2)))?.mesh;
/// let transferred = correspondence(&mesh, &lighter)?.transfer(&light, 1)?;
///
/// assert_eq!(transferred.len(), lighter.wedge_count());
/// for (p, light) in lighter.positions().view().iter().zip(transferred) {
///     assert!((light - p[2] as f32).abs() < 0.01);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// - [`SimplifyError::NoFaces`] if no face has an area.
/// - [`SimplifyError::BadOption`] if a number of the options is out of range, or if a cell, a voxel, an edge length or
///   a number of subdivisions of the [`Method`] does not suit this mesh (a grid that is too fine, or one in which no
///   face is left).
/// - [`SimplifyError::NotOfMethod`] if one of the options that several methods share is set and the method does not
///   have it.
/// - [`SimplifyError::NotTogether`] if two options exclude each other.
/// - [`SimplifyError::Mesh`] if the result is not a valid mesh, such as one with more elements than 32-bit
///   ids can address.
///
/// # Panics
/// Never because of a mesh or an option; a panic is a bug of this crate.
///
/// # Source
/// Costs without memory: [Lindstrom-Turk 1998]; the link condition: [Dey 1999]; attributes: [Hoppe 1999],
/// without memory. The variants of [`Method`] give the sources of the other methods.
pub fn simplify(mesh: &TriMesh, options: &SimplifyOptions) -> Result<Simplified, SimplifyError> {
    simplify_with(mesh, options, &mut NoControl)
}

/// [`simplify`] with data of the mesh (locked vertices, importance, images), or of a borrowed surface, and with a
/// [`Control`] that sees the progress and can end the run.
///
/// # Errors
/// Those of [`simplify`]; [`SimplifyError::WrongLength`] if [`MeshData::locked`] or [`MeshData::importance`] does
/// not have one entry for each vertex, [`SimplifyError::Cancelled`] if the control answered [`Verdict::Cancel`].
pub fn simplify_with<'a>(
    input: impl Into<Input<'a>>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Simplified, SimplifyError> {
    pipeline::simplify(&input.into(), options, control).map(|done| done.0)
}
