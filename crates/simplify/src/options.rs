//! What a run is asked for. Nothing else holds defaults: command, viewer and bindings convert into these.

mod check;
mod shared;

use std::sync::Arc;

use lodsmith_core::RegionId;

use crate::textures::Textures;

/// How a mesh is simplified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Edge collapse by the tensors of the present star, and a final fit: the default. After [Lindstrom-Turk 1998]'s
    /// finding that costs without memory are the better ones.
    #[default]
    Memoryless,
    /// Edge collapse by accumulated plane quadrics, weighted by area. [Garland-Heckbert 1997]
    Quadric,
    /// Edge collapse that keeps volume and borders, by the present surface alone. [Lindstrom-Turk 1998]
    LindstromTurk,
    /// Half-edge collapse by length times curvature, onto vertices of the input. [Melax 1998]
    Melax,
    /// The shortest edge first, onto its middle.
    ShortestEdge,
    /// One vertex for each cell of a grid. [Rossignac-Borrel 1993] [Lindstrom 2000]
    Cluster,
    /// Vertices go, nearest to the plane of their neighbours first, and the holes are filled. [Schroeder et al. 1992]
    VertexRemoval,
    /// Coplanar regions become as few triangles as their outline needs. [Hinker-Hansen 1993] [Kalvin-Taylor 1996]
    Planar,
    /// Undoes 4:1 subdivision where it fits. [Taubin 2001]
    Unsubdivide,
    /// A new mesh on the old surface. [Botsch-Kobbelt 2004]
    Remesh,
}

impl Method {
    /// All of them, in the order of lists.
    pub const ALL: [Self; 10] = [
        Self::Memoryless,
        Self::Quadric,
        Self::LindstromTurk,
        Self::Melax,
        Self::ShortestEdge,
        Self::Cluster,
        Self::VertexRemoval,
        Self::Planar,
        Self::Unsubdivide,
        Self::Remesh,
    ];

    /// The word for it, as in `lindstrom-turk`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Memoryless => "memoryless",
            Self::Quadric => "quadric",
            Self::LindstromTurk => "lindstrom-turk",
            Self::Melax => "melax",
            Self::ShortestEdge => "shortest-edge",
            Self::Cluster => "cluster",
            Self::VertexRemoval => "vertex-removal",
            Self::Planar => "planar",
            Self::Unsubdivide => "unsubdivide",
            Self::Remesh => "remesh",
        }
    }
}

/// What single methods can be told. Without, each has a default or goes by the stop alone. One that the method has no use
/// for is an error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct MethodOptions {
    /// [`Method::Memoryless`], [`Method::Quadric`]: vertices closer than this that share no edge are contracted too. The run
    /// is made without as well, and that result is taken if it alone meets the stop or is closer by a quarter.
    pub pairs: Option<Length>,
    /// [`Method::Cluster`]: edge of a cell.
    pub cell: Option<Length>,
    /// [`Method::Cluster`]: clusters only to a multiple of the stop, and goes on with [`Method::Memoryless`].
    pub two_stage: bool,
    /// [`Method::ShortestEdge`]: edges up to this length go. [`Method::Remesh`]: length of the new edges.
    pub edge_length: Option<Length>,
    /// [`Method::Planar`]: largest angle, in degrees, between a face and the plane of its region; 5 by default.
    /// [`Method::VertexRemoval`], [`Method::Remesh`]: edges bent by more are creases, which are kept.
    pub angle_deg: Option<f64>,
    /// [`Method::Planar`]: largest distance of a vertex from the plane of its region, and of one that goes from the edge of
    /// the outline that takes its place. By default 2e-7 of the diagonal, or the error of the stop.
    pub flat: Option<Length>,
    /// [`Method::Unsubdivide`]: levels to undo, at most. [`Method::Remesh`]: rounds.
    pub iterations: Option<usize>,
    /// [`Method::Remesh`]: edge of a voxel: a closed surface around the input, whatever state it is in.
    pub voxel: Option<Length>,
    /// [`Method::Remesh`]: a semi-regular mesh: a base, subdivided so many times. [Eck et al. 1995]
    pub subdivisions: Option<usize>,
    /// [`Method::Remesh`]: edges are short where the surface is curved.
    pub adaptive: bool,
}

impl MethodOptions {
    /// Those that are set: their names, and the methods that take them.
    pub(crate) fn set(&self) -> impl Iterator<Item = (&'static str, &'static [Method])> {
        use Method::{
            Cluster, Memoryless, Planar, Quadric, Remesh, ShortestEdge, Unsubdivide, VertexRemoval,
        };
        let all: [(&str, bool, &[Method]); 10] = [
            ("pairs", self.pairs.is_some(), &[Memoryless, Quadric]),
            ("cell", self.cell.is_some(), &[Cluster]),
            ("two-stage", self.two_stage, &[Cluster]),
            ("edge-length", self.edge_length.is_some(), &[ShortestEdge, Remesh]),
            ("angle", self.angle_deg.is_some(), &[Planar, VertexRemoval, Remesh]),
            ("flat", self.flat.is_some(), &[Planar]),
            ("iterations", self.iterations.is_some(), &[Unsubdivide, Remesh]),
            ("voxel", self.voxel.is_some(), &[Remesh]),
            ("subdivisions", self.subdivisions.is_some(), &[Remesh]),
            ("adaptive", self.adaptive, &[Remesh]),
        ];
        all.into_iter().filter(|x| x.1).map(|x| (x.0, x.2))
    }

    /// Whether a run of this method comes to an end by itself, without a stop.
    pub fn ends(&self, method: Method) -> bool {
        match method {
            Method::Planar | Method::Unsubdivide => true,
            Method::ShortestEdge => self.edge_length.is_some(),
            Method::Cluster => self.cell.is_some() && !self.two_stage,
            Method::Remesh => self.edge_length.is_some() || self.voxel.is_some(),
            _ => false,
        }
    }
}

/// Whether the last least-squares step towards the original is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// Where it helps: with [`Method::Memoryless`] and optimal placement.
    #[default]
    Auto,
    /// Always, unless placement forbids that vertices move.
    On,
    /// Never.
    Off,
}

/// Where the merged vertex of a collapse goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// To the point of least cost.
    #[default]
    Optimal,
    /// To the better of the two ends: the result's vertices are a subset of the input's, attributes included.
    Endpoint,
    /// To the middle of the edge.
    Midpoint,
}

/// What happens to open borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BorderPolicy {
    /// They are held in place by weighted lines.
    #[default]
    Keep,
    /// Their vertices move along them only: a border edge collapses onto one of its ends.
    Slide,
    /// Their vertices are not touched, and a part that has any is never removed.
    Lock,
    /// No care is taken.
    Free,
}

/// What may happen to the topology.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TopologyPolicy {
    /// Counts of non-manifold edges, border edges, flipped and duplicate faces do not rise. Only when the target cannot be
    /// met otherwise, or the rest would be measurably farther off, handles and thin places are cut and whole parts go,
    /// cheapest first, and each is counted.
    #[default]
    Relaxed,
    /// Manifold stays manifold; holes, handles and parts stay.
    Preserve,
    /// Handles and necks are cut and whole parts go wherever that is cheapest, and each is counted. The two sides of a cut
    /// may touch.
    Free,
}

/// A length in the units of the mesh, or as a share of the diagonal of its bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// In the units of the mesh.
    Units(f64),
    /// A share of the diagonal: 0.001 is a tenth of a percent.
    OfDiagonal(f64),
}

impl Length {
    /// The length in the units of a mesh with this diagonal.
    pub fn in_units(self, diagonal: f64) -> f64 {
        match self {
            Self::Units(x) => x,
            Self::OfDiagonal(x) => x * diagonal,
        }
    }
}

/// When to stop. Several may stand together: the first one met stops. With none, nothing is done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// At this number of triangles, or fewer.
    pub faces: Option<usize>,
    /// At this number of vertices, or fewer.
    pub vertices: Option<usize>,
    /// At this part of the triangles, above 0 and up to 1.
    pub ratio: Option<f64>,
    /// At the lightest level that keeps within this distance of the input, as [`SimplifyOptions::bound`] has it.
    ///
    /// Levels are what runs to certain counts make, each 5 % below the one before, whatever the distance: a larger one
    /// never gives more triangles.
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
    /// Stops at this part of the triangles.
    pub fn ratio(r: f64) -> Self {
        Self { ratio: Some(r), ..Self::default() }
    }
    /// Stops before the measured deviation passes this.
    pub fn error(limit: Length) -> Self {
        Self { error: Some(limit), ..Self::default() }
    }
}

/// Guards of the result, each off by default. A collapse that would break one is refused and counted; the
/// [fit](SimplifyOptions::fit) moves vertices only as far as they allow. What breaks one already may stay, and gets no worse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guards {
    /// Largest turn of a face by one collapse, and by the fit, in degrees.
    pub max_normal_deg: Option<f64>,
    /// Least shape of a new face: 1 is equilateral, 0 flat. Where a face was worse, no new one there is worse than that.
    pub min_quality: Option<f64>,
    /// Largest number of edges at a merged vertex. One may have as many as one of the two that it was made of.
    pub max_valence: Option<usize>,
    /// Greatest length of an edge. One that was longer may move, but gets no longer.
    pub max_edge: Option<Length>,
}

/// How much attributes and borders count in the cost, times what they count by default; 0 gives them no say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeWeights {
    /// Normals.
    pub normal: f64,
    /// Texture coordinates.
    pub uv: f64,
    /// Colours.
    pub color: f64,
    /// What morph targets add to positions. At 1 a distance in a key pose counts like one at rest.
    pub morph: f64,
    /// Which joints pull a vertex. At 1 a distance by which the middle of its joints moves counts like a tenth of it at rest.
    pub skin: f64,
    /// Everything else.
    pub other: f64,
    /// Open borders and non-manifold curves, unless [`BorderPolicy::Free`] leaves them out anyway.
    pub border: f64,
}

impl Default for AttributeWeights {
    fn default() -> Self {
        Self { normal: 1.0, uv: 1.0, color: 1.0, morph: 1.0, skin: 1.0, other: 1.0, border: 1.0 }
    }
}

/// Options for a purpose, by name. (docs/decisions/0013)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// Everything by default: the least distance.
    #[default]
    Auto,
    /// Noisy scans: normals have no say, and vertices that rounding parted are joined.
    Scan,
    /// Machine parts: borders slide along themselves, holes and parts stay.
    Cad,
    /// For the eye: normals count more, also those of a surface without any.
    Visual,
    /// For printing: closed stays closed, holes and parts stay, attributes have no say.
    Print,
}

/// The promise that a run makes on the largest distance between the input and the result. It is proven, not sampled: see
/// [`proof`](lodsmith_core::measure::proof).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bound {
    /// [`Bound::TwoSided`] where the stop has an error, else [`Bound::Estimate`].
    #[default]
    Auto,
    /// No promise: where the stop has an error, it is kept as far as samples see.
    Estimate,
    /// No point of the result lies farther from the input than the bound. Details of the input may be gone.
    OneSided,
    /// No point of the result lies farther from the input than the bound, nor any of the input from the result.
    TwoSided,
}

/// Whether the result is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Where the stop has an error or a bound is promised, else there is the engine's own estimate alone.
    #[default]
    Auto,
    /// Both ways at the end, whatever the stop.
    Always,
}

/// All that a run can be told.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SimplifyOptions {
    /// When to stop.
    pub stop: Stop,
    /// How.
    pub method: Method,
    /// What only some methods know.
    pub of_method: MethodOptions,
    /// The last step.
    pub fit: Fit,
    /// Where merged vertices go.
    pub placement: Placement,
    /// Open borders.
    pub border: BorderPolicy,
    /// Topology.
    pub topology: TopologyPolicy,
    /// Guards of the result.
    pub guards: Guards,
    /// Edges of the input whose two faces meet at more than this, in degrees, are features: their vertices keep to their
    /// line as those of borders do, and two of them become one only along it, as long as anything else can go. Above 0 and
    /// below 180; without, no edge is one.
    pub sharp_deg: Option<f64>,
    /// How much attributes count.
    pub weights: AttributeWeights,
    /// What is promised of the largest distance: what the report's bound says, and what an error of the stop is held
    /// against.
    pub bound: Bound,
    /// Whether the result is measured.
    pub measure: Measure,
    /// Vertices closer than this are joined first. Equal positions always are.
    pub weld: Option<Length>,
    /// Connected parts whose bounding box has a diagonal below this go first; the largest stays in any case. What is
    /// measured is the distance from what is left. A share is of the whole input's diagonal.
    pub prune: Option<Length>,
    /// Whether looser topology policies are tried in turn when the target is out of reach. Borders and guards stay.
    pub escalate: bool,
    /// In a scene: whether the stop holds for each mesh by itself, instead of all instances of all together.
    pub per_mesh: bool,
    /// Whether the normals that the surface itself has count in the cost where the mesh brings none. The result does not
    /// carry them. (In a scene, where no mesh brings any.)
    pub shape_normals: bool,
    /// For each region of the mesh its class, as the first region of it: where two of one class meet, the border is a
    /// crease that may move, as between smoothing groups. Without, and for regions beyond the list, each is a class of
    /// its own, and borders are exact. (In a scene the regions of each part are meant.)
    pub region_classes: Option<Arc<[RegionId]>>,
    /// Whether each vertex of the input is locked, where any is: in a scene, of all parts, one after the other.
    ///
    /// A locked vertex keeps its place and all that stands on it, to the bit, and a face whose vertices are all locked
    /// stays. (Clusters can leave one without any face: then it goes.) The faces around are simplified up to it and stay joined to it; a part with a locked vertex never goes.
    /// Vertices at one place are locked together; a weld moves others onto locked ones, never those. Of faces that stand
    /// twice one goes all the same.
    pub locked: Option<Arc<[bool]>>,
    /// How many times as many triangles as elsewhere a place of the same shape is to have, for each vertex of the input:
    /// in a scene, of all parts, one after the other. 1 is as elsewhere; beyond 0.001 and 1000 counts as these.
    ///
    /// A collapse costs so many times more, to the power 2.5, and the merged vertex keeps the larger number of its ends.
    /// With the density of triangles, costs fall by its third power where the surface is smooth and by its square where
    /// it is rough, so 4 means about 3 on the one and 6 on the other. What is flat needs no triangles, however important
    /// it is. The total stays that of the stop. (docs/decisions/0013)
    pub importance: Option<Arc<[f32]>>,
    /// The images that give the surface its colours: of the regions of the mesh, or of those of each part of a scene. Where
    /// one is a palette (almost every face of the input shows one colour), a face of the result whose blended texture
    /// coordinates show other colours than the input there takes some of the input's. No other method of a run looks at
    /// images, and [`Method::Cluster`] and progressive meshes not at all.
    pub textures: Option<Arc<Textures>>,
    /// Whether blended normals far off their faces stay: where they are only lent, or where groups of clusters are joined
    /// again.
    pub(crate) keeps_blended_normals: bool,
    /// Seed of whatever is drawn by chance: equal seeds give equal bytes.
    pub seed: u64,
}

impl SimplifyOptions {
    /// Everything by default but for the stop.
    pub fn new(stop: Stop) -> Self {
        Self { stop, ..Self::default() }
    }
    /// What is promised, in the end: never [`Bound::Auto`].
    pub fn promised(&self) -> Bound {
        match (self.bound, self.stop.error) {
            (Bound::Auto, Some(_)) => Bound::TwoSided,
            (Bound::Auto, None) => Bound::Estimate,
            (bound, _) => bound,
        }
    }
    /// What a preset stands for, with this stop. All can be changed afterwards.
    pub fn preset(preset: Preset, stop: Stop) -> Self {
        let mut options = Self::new(stop);
        match preset {
            Preset::Auto => {}
            Preset::Scan => {
                options.weights.normal = 0.0;
                options.weld = Some(Length::OfDiagonal(SCAN_WELD));
            }
            Preset::Cad => {
                options.border = BorderPolicy::Slide;
                options.topology = TopologyPolicy::Preserve;
            }
            Preset::Visual => {
                options.shape_normals = true;
                options.weights.normal = VISUAL_NORMAL;
            }
            Preset::Print => {
                options.topology = TopologyPolicy::Preserve;
                let none =
                    AttributeWeights { normal: 0.0, uv: 0.0, color: 0.0, ..AttributeWeights::default() };
                options.weights = AttributeWeights { morph: 0.0, skin: 0.0, other: 0.0, ..none };
            }
        }
        options
    }
}

/// Vertices of scans closer than this share of the diagonal are one. (Guessed: about what single precision rounds by.)
const SCAN_WELD: f64 = 1e-6;
/// What normals count for the eye. (docs/decisions/0013)
const VISUAL_NORMAL: f64 = 2.0;
