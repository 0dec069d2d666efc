//! Options of a run. All defaults are defined here: command, viewer and bindings convert to these types.

pub mod by_name;
mod check;
mod length;
mod method;
pub(crate) mod names;
pub(crate) mod shared;

pub use length::Length;
pub use method::{Method, MethodKind, Remesh, RemeshPattern};

/// Use of the final least-squares step towards the original.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// Used with [`Method::Memoryless`] and optimal placement, where it helps.
    #[default]
    Auto,
    /// Always used, unless the placement forbids vertices to move.
    On,
    /// Never used.
    Off,
}

/// Placement of the merged vertex of a collapse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Placement {
    /// At the point of least cost.
    #[default]
    Optimal,
    /// At the better of the two ends: the vertices of the result, with their attributes, are a subset of the
    /// vertices of the input.
    Endpoint,
    /// At the midpoint of the edge.
    Midpoint,
}

/// Treatment of open borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BorderPolicy {
    /// Border edges are held in place by weighted line tensors.
    #[default]
    Keep,
    /// Border vertices move along the border only: a border edge collapses onto one of its ends.
    Slide,
    /// Border vertices are not changed, and a part that has any is never removed.
    Lock,
    /// Borders are not considered.
    Free,
}

/// Permitted changes of the topology.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TopologyPolicy {
    /// The counts of non-manifold edges, border edges, flipped faces and duplicate faces do not increase. Handles
    /// and necks are cut and whole parts removed, cheapest first, only if the target cannot be met otherwise
    /// or the result would be measurably farther from the input; each is counted.
    #[default]
    Relaxed,
    /// Manifold stays manifold; holes, handles and parts are kept.
    Preserve,
    /// Handles and necks are cut and whole parts removed wherever that is cheapest; each is counted. The two
    /// sides of a cut may touch.
    Free,
}

/// Stopping criteria. If several are set, the first one met stops the run. If none is set, nothing is
/// simplified.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Stops at this number of triangles, or fewer.
    pub faces: Option<usize>,
    /// Stops at this number of vertices, or fewer.
    pub vertices: Option<usize>,
    /// Stops at this fraction of the triangles, above 0 and up to 1.
    pub ratio: Option<f64>,
    /// Stops when nothing more can be removed within this distance of the input, in the sense of
    /// [`SimplifyOptions::bound`]; the result is proven to be within it.
    ///
    /// Methods that collapse edges test every collapse against it (docs/decisions/0030): a distance a few percent larger
    /// can give a few triangles more. For the others it is the coarsest level within it: levels are the results of runs
    /// to fixed counts, each 5 % below the previous count, which do not depend on the distance. Those whose error is
    /// limited by steps are tried with smaller and smaller steps.
    pub error: Option<Length>,
}

impl Stop {
    /// Stops at this number of triangles.
    pub fn faces(n: usize) -> Self {
        Self { faces: Some(n), ..Self::default() }
    }
    /// Stops at this number of vertices.
    pub fn vertices(n: usize) -> Self {
        Self { vertices: Some(n), ..Self::default() }
    }
    /// Stops at this fraction of the triangles.
    pub fn ratio(r: f64) -> Self {
        Self { ratio: Some(r), ..Self::default() }
    }
    /// Stops before the measured deviation exceeds this.
    pub fn error(limit: Length) -> Self {
        Self { error: Some(limit), ..Self::default() }
    }
}

/// Limits on the shape of the result, each off by default. A collapse that would exceed a limit is refused and
/// counted; the [fit](SimplifyOptions::fit) moves vertices only as far as the limits allow. Faces and edges
/// that exceed a limit in the input may remain, but do not get worse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guards {
    /// Largest rotation of a face normal by one collapse, and by the fit, in degrees.
    pub max_normal_deg: Option<f64>,
    /// Minimum quality of a new face: 1 is equilateral, 0 flat. If a face was worse before, new faces may be as
    /// bad, but not worse.
    pub min_quality: Option<f64>,
    /// Largest number of edges at a merged vertex. A merged vertex may have as many as either of its two ends
    /// had.
    pub max_valence: Option<usize>,
    /// Largest length of an edge. An edge that is longer in the input may move, but does not get longer.
    pub max_edge: Option<Length>,
}

/// Weights of attributes and borders in the cost, as factors on their defaults; 0 ignores them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeWeights {
    /// Normals.
    pub normal: f64,
    /// Texture coordinates.
    pub uv: f64,
    /// Colours.
    pub color: f64,
    /// Displacements of positions by morph targets. At 1 a distance in a key pose counts like a distance at
    /// rest.
    pub morph: f64,
    /// Skins. At 1 a shift of a vertex's mean joint position counts like a tenth of that distance at rest.
    pub skin: f64,
    /// All other attributes.
    pub other: f64,
    /// Open borders and non-manifold curves; ignored with [`BorderPolicy::Free`].
    pub border: f64,
}

impl Default for AttributeWeights {
    fn default() -> Self {
        Self { normal: 1.0, uv: 1.0, color: 1.0, morph: 1.0, skin: 1.0, other: 1.0, border: 1.0 }
    }
}

/// Named sets of options for a purpose. (docs/decisions/0013)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// All options at their defaults: the smallest distance.
    #[default]
    Auto,
    /// Noisy scans: normals are ignored, and vertices that differ by rounding are merged.
    Scan,
    /// Machine parts: borders slide along themselves; holes and parts are kept.
    Cad,
    /// For display: normals have more weight; a mesh without normals is treated as if it had the normals of its shape.
    Visual,
    /// For 3D printing: closed surfaces stay closed, holes and parts are kept, attributes are ignored.
    Print,
}

/// Guarantee on the largest distance between the input and the result. It is proven, not sampled: see
/// [`proof`](lodsmith_core::measure::proof).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bound {
    /// [`Bound::TwoSided`] with a stop at an error, otherwise [`Bound::Estimate`].
    #[default]
    Auto,
    /// No guarantee: a stop at an error is only checked with samples.
    Estimate,
    /// No point of the result lies farther from the input than the bound. Details of the input may be lost.
    OneSided,
    /// No point of the result lies farther from the input than the bound, and no point of the input lies farther
    /// from the result.
    TwoSided,
}

/// Work that is done for a small largest distance at a given count of faces or vertices.
///
/// Only methods that collapse edges have a choice. With a stop at an error there is none: every collapse is tested
/// against it anyway.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// One run.
    #[default]
    Default,
    /// Runs to the same count, of which every collapse stays within a share of the largest distance of a plain run;
    /// the result is the one with the smallest share whose mean and RMS distances are at most 8 % above those of
    /// the plain run (1 % in the geometric mean of many). Its vertices are fitted repeatedly. Takes four to twenty times as long as one run
    /// (docs/decisions/0031).
    Best,
    /// [`Effort::Best`] for inputs of at most [`Effort::MAX_SMALL_FACES`] triangles, but [`Effort::Default`] for the
    /// levels of a chain.
    Auto,
}

impl Effort {
    /// Largest number of triangles of the input for which [`Effort::Auto`] is [`Effort::Best`]: about half a second.
    pub const MAX_SMALL_FACES: usize = 2_000;

    /// True if inputs of this many triangles get the best result.
    pub fn is_best_for(self, faces: usize) -> bool {
        match self {
            Self::Default => false,
            Self::Best => true,
            Self::Auto => faces <= Self::MAX_SMALL_FACES,
        }
    }
}

/// Measurement of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Measures with a stop at an error or a guaranteed bound; otherwise the report only has the engine's
    /// estimate.
    #[default]
    Auto,
    /// Always measures in both directions at the end.
    Always,
}

/// Settings of one quick pass, for the functions of the C interface that replace functions of another library: no
/// late phase, no search and no proposals.
#[doc(hidden)]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuickPass {
    /// Estimate of the RMS distance at which the pass ends, if its target count is not reached before.
    pub max_estimate: Option<Length>,
    /// Weight of the squared displacement of a vertex along the surface, relative to the squared distance from it:
    /// above 0, faces are more regular.
    pub move_weight: f32,
}

/// Sizes of the blocks that large meshes are swept in: they decide the result, whatever the number of threads.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSizes {
    /// Number of faces from which a mesh is cut into blocks.
    pub min_faces: usize,
    /// Number of vertices of a block.
    pub vertices: usize,
}

impl Default for BlockSizes {
    fn default() -> Self {
        Self { min_faces: 400_000, vertices: 24_000 }
    }
}

/// All options of a run.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SimplifyOptions {
    /// Stopping criteria.
    pub stop: Stop,
    /// Method of simplification, with its own options.
    pub method: Method,
    /// Use of the final least-squares step.
    pub fit: Fit,
    /// Work for a small largest distance at a given count.
    pub effort: Effort,
    /// Placement of merged vertices.
    pub placement: Placement,
    /// Treatment of open borders.
    pub border: BorderPolicy,
    /// Permitted changes of the topology.
    pub topology: TopologyPolicy,
    /// Limits on the shape of the result.
    pub guards: Guards,
    /// Edges of the input whose dihedral angle exceeds this, in degrees, are features: their vertices stay on
    /// the feature line, as border vertices do, and merge only along it, as long as any other collapse is
    /// possible. Above 0 and below 180; `None` marks no edges.
    pub sharp_deg: Option<f64>,
    /// Weights of attributes and borders in the cost.
    pub weights: AttributeWeights,
    /// Guarantee on the largest distance: it defines the bound in the report, and the distance that is compared
    /// with a stop at an error.
    pub bound: Bound,
    /// Measurement of the result.
    pub measure: Measure,
    /// Vertices closer than this are merged first. Vertices at equal positions are always merged; without this
    /// option, border vertices that differ by rounding are merged too ([`simplify`](crate::simplify()) has the
    /// tolerance).
    pub weld: Option<Length>,
    /// Connected parts whose bounding box has a smaller diagonal than this are removed first; the largest
    /// part is always kept. Distances are measured from the remaining parts. A fraction refers to the diagonal of
    /// the whole input.
    pub prune: Option<Length>,
    /// If the target is not reached, tries pairs and looser topology policies one after the other. The border policy
    /// and the guards are kept.
    pub escalate: bool,
    /// For scenes: the stop applies to each mesh separately, instead of all instances of all meshes together.
    pub per_mesh: bool,
    /// If the mesh has no normals, normals of its shape count in the cost; the result does not have them. (In a
    /// scene: if no mesh has normals.)
    pub shape_normals: bool,
    /// Makes one quick pass, if set.
    #[doc(hidden)]
    pub quick: Option<QuickPass>,
    /// Sizes of blocks.
    #[doc(hidden)]
    pub blocks: BlockSizes,
    /// Seed of all random choices: equal seeds give equal bytes.
    pub seed: u64,
}

impl SimplifyOptions {
    /// Returns true if the options have a target, or if the method ends by itself with its options.
    pub fn has_end(&self) -> bool {
        self.stop != Stop::default() || self.method.ends_without_stop()
    }

    /// Returns the default options with this stop.
    pub fn new(stop: Stop) -> Self {
        Self { stop, ..Self::default() }
    }
    /// Converts all lengths to units; fractions refer to `diagonal`.
    pub(crate) fn lengths_to_units(&mut self, diagonal: f64) {
        let of_run = [&mut self.stop.error, &mut self.guards.max_edge, &mut self.weld, &mut self.prune];
        for length in of_run.into_iter().flatten().chain(self.method.lengths_mut()) {
            *length = Length::Units(length.in_units(diagonal));
        }
    }
    /// Returns the guarantee in effect: never [`Bound::Auto`].
    pub fn effective_bound(&self) -> Bound {
        match (self.bound, self.stop.error) {
            (Bound::Auto, Some(_)) => Bound::TwoSided,
            (Bound::Auto, None) => Bound::Estimate,
            (bound, _) => bound,
        }
    }
    /// Returns the options of a preset with this stop. All can be changed afterwards.
    pub fn preset(preset: Preset, stop: Stop) -> Self {
        let mut options = Self::new(stop);
        match preset {
            Preset::Auto => {}
            Preset::Scan => {
                options.weights.normal = 0.0;
                options.weld = Some(Length::OfDiagonal(SCAN_WELD));
            }
            Preset::Cad => {
                options.effort = Effort::Auto;
                options.border = BorderPolicy::Slide;
                options.topology = TopologyPolicy::Preserve;
            }
            Preset::Visual => {
                options.shape_normals = true;
                options.weights.normal = VISUAL_NORMAL;
            }
            Preset::Print => {
                options.effort = Effort::Auto;
                options.topology = TopologyPolicy::Preserve;
                let none =
                    AttributeWeights { normal: 0.0, uv: 0.0, color: 0.0, ..AttributeWeights::default() };
                options.weights = AttributeWeights { morph: 0.0, skin: 0.0, other: 0.0, ..none };
            }
        }
        options
    }
}

/// Distance within which vertices of scans are merged, as a fraction of the diagonal. (Guessed: about the rounding of
/// single precision.)
const SCAN_WELD: f64 = 1e-6;
/// Weight of normals in [`Preset::Visual`]. (docs/decisions/0013)
const VISUAL_NORMAL: f64 = 2.0;
