//! Options of a run. No defaults are defined elsewhere: command, viewer and bindings convert into these
//! types.

pub mod by_name;
mod check;
pub(crate) mod names;
pub(crate) mod shared;

/// Method of simplification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Edge collapse by the tensors of the present star, and a final fit: the default. After the finding of
    /// [Lindstrom-Turk 1998] that costs without memory are better.
    #[default]
    Memoryless,
    /// Edge collapse by accumulated plane quadrics, weighted by area. [Garland-Heckbert 1997]
    Quadric,
    /// Edge collapse that preserves volume and borders, judged by the present surface alone.
    /// [Lindstrom-Turk 1998]
    LindstromTurk,
    /// Half-edge collapse by length times curvature, onto vertices of the input. [Melax 1998]
    Melax,
    /// Edge collapse in order of edge length, onto the midpoint.
    ShortestEdge,
    /// One vertex for each cell of a grid. [Rossignac-Borrel 1993] [Lindstrom 2000]
    Cluster,
    /// Removal of vertices, nearest to the plane of their neighbours first; the holes are filled.
    /// [Schroeder et al. 1992]
    VertexRemoval,
    /// Coplanar regions are replaced by as few triangles as their outlines need. [Hinker-Hansen 1993]
    /// [Kalvin-Taylor 1996]
    Planar,
    /// Reverses 4:1 subdivision where the mesh has its pattern. [Taubin 2001]
    Unsubdivide,
    /// A new mesh on the old surface. [Botsch-Kobbelt 2004]
    Remesh,
}

impl Method {
    /// True if an error limit bounds each step of the method, instead of their number.
    pub(crate) const fn limits_error_by_step(self) -> bool {
        matches!(self, Self::Planar | Self::Unsubdivide)
    }
}

/// Options of single methods. Those that are not set have a default or follow from the stop. Setting one that
/// the method does not have is an error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct MethodOptions {
    /// [`Method::Memoryless`], [`Method::Quadric`]: pairs of vertices closer than this that share no edge are
    /// contracted too. A second run without pairs is made, and its result is taken if it alone meets the stop
    /// or is closer by a quarter.
    pub pairs: Option<Length>,
    /// [`Method::Cluster`]: edge length of a cell.
    pub cell: Option<Length>,
    /// [`Method::Cluster`]: clusters only down to a multiple of the stop, then continues with
    /// [`Method::Memoryless`].
    pub two_stage: bool,
    /// [`Method::ShortestEdge`]: edges up to this length are collapsed. [`Method::Remesh`]: length of the new
    /// edges.
    pub edge_length: Option<Length>,
    /// [`Method::Planar`]: largest angle, in degrees, between a face and the plane of its region; 5 by
    /// default. [`Method::VertexRemoval`], [`Method::Remesh`]: edges with a larger dihedral angle are
    /// creases, which are kept.
    pub angle_deg: Option<f64>,
    /// [`Method::Planar`]: largest distance of a vertex from the plane of its region, and of a removed vertex
    /// from the edge of the simplified outline. By default 2e-7 of the diagonal, or the error of the stop.
    pub flat: Option<Length>,
    /// [`Method::Unsubdivide`]: largest number of levels to undo. [`Method::Remesh`]: number of rounds.
    pub iterations: Option<usize>,
    /// [`Method::Remesh`]: edge length of a voxel; the result is a closed surface around the input, whatever
    /// the state of the input.
    pub voxel: Option<Length>,
    /// [`Method::Remesh`]: makes a semi-regular mesh, a base mesh subdivided this many times.
    /// [Eck et al. 1995]
    pub subdivisions: Option<usize>,
    /// [`Method::Remesh`]: makes edges shorter where the surface is curved.
    pub adaptive: bool,
}

impl MethodOptions {
    /// Returns the names of the options that are set, each with the methods that have it.
    pub(crate) fn set_options(&self) -> impl Iterator<Item = (&'static str, &'static [Method])> {
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

    /// Returns true if a run of this method ends without a stop.
    pub fn ends_without_stop(&self, method: Method) -> bool {
        match method {
            Method::Planar | Method::Unsubdivide => true,
            Method::ShortestEdge => self.edge_length.is_some(),
            Method::Cluster => self.cell.is_some() && !self.two_stage,
            Method::Remesh => self.edge_length.is_some() || self.voxel.is_some(),
            _ => false,
        }
    }
}

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
    /// At the better of the two ends: the vertices of the result are a subset of the input's, attributes
    /// included.
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
    /// The counts of non-manifold edges, border edges, flipped faces and duplicate faces do not rise. Only if
    /// the target cannot be met otherwise, or the result would be measurably farther off, handles and necks
    /// are cut and whole parts removed, cheapest first; each is counted.
    #[default]
    Relaxed,
    /// Manifold stays manifold; holes, handles and parts are kept.
    Preserve,
    /// Handles and necks are cut and whole parts removed wherever that is cheapest; each is counted. The two
    /// sides of a cut may touch.
    Free,
}

/// A length in the units of the mesh, or as a share of the diagonal of its bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Length {
    /// In the units of the mesh.
    Units(f64),
    /// A share of the diagonal: 0.001 is a tenth of a per cent.
    OfDiagonal(f64),
}

impl Length {
    /// Returns the length in the units of a mesh with this diagonal.
    pub fn in_units(self, diagonal: f64) -> f64 {
        match self {
            Self::Units(x) => x,
            Self::OfDiagonal(x) => x * diagonal,
        }
    }
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
    /// Stops at the lightest level that stays within this distance of the input, in the sense of
    /// [`SimplifyOptions::bound`].
    ///
    /// The levels are the results of runs to fixed counts, each 5 % below the one before, whatever the
    /// distance: a larger distance never gives more triangles.
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

/// Limits on the shape of the result, each off by default. A collapse that would exceed one is refused and
/// counted; the [fit](SimplifyOptions::fit) moves vertices only as far as the limits allow. What exceeds a
/// limit in the input may stay, but does not get worse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guards {
    /// Largest rotation of a face normal by one collapse, and by the fit, in degrees.
    pub max_normal_deg: Option<f64>,
    /// Least quality of a new face: 1 is equilateral, 0 flat. Where a face was worse, new faces there are no
    /// worse than it.
    pub min_quality: Option<f64>,
    /// Largest number of edges at a merged vertex. A merged vertex may have as many as either of its two ends
    /// had.
    pub max_valence: Option<usize>,
    /// Largest length of an edge. An edge that is longer already may move, but does not get longer.
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
    /// Displacements of positions by morph targets. At 1 a distance in a key pose counts like one at rest.
    pub morph: f64,
    /// Skins. At 1 a shift of the weighted mean of a vertex' joints counts like a tenth of that distance at
    /// rest.
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
    /// All options at their defaults: the least distance.
    #[default]
    Auto,
    /// Noisy scans: normals are ignored, and vertices that rounding separated are merged.
    Scan,
    /// Machine parts: borders slide along themselves; holes and parts are kept.
    Cad,
    /// For display: normals count more, and shape normals count where the mesh has none.
    Visual,
    /// For printing: closed stays closed, holes and parts are kept, attributes are ignored.
    Print,
}

/// Guarantee on the largest distance between the input and the result. It is proven, not sampled: see
/// [`proof`](lodsmith_core::measure::proof).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bound {
    /// [`Bound::TwoSided`] with a stop at an error, otherwise [`Bound::Estimate`].
    #[default]
    Auto,
    /// No guarantee: a stop at an error is kept as far as samples show.
    Estimate,
    /// No point of the result lies farther from the input than the bound. Details of the input may be lost.
    OneSided,
    /// No point of the result lies farther from the input than the bound, and no point of the input farther
    /// from the result.
    TwoSided,
}

/// Measurement of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Measures with a stop at an error or a guaranteed bound; otherwise the report has the engine's estimate
    /// alone.
    #[default]
    Auto,
    /// Always measures both ways at the end.
    Always,
}

/// Settings of one quick pass, for the calls of the C interface that take the place of another library's: no
/// late phase, no search and no proposals.
#[doc(hidden)]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuickPass {
    /// Estimate of the RMS distance at which the pass ends, if its count is not reached before.
    pub max_estimate: Option<Length>,
    /// Weight of the squared step of a vertex along the surface, against the squared distance from it: above 0, faces
    /// are more regular.
    pub move_weight: f32,
}

/// All options of a run.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SimplifyOptions {
    /// Stopping criteria.
    pub stop: Stop,
    /// Method of simplification.
    pub method: Method,
    /// Options that only some methods have.
    pub method_options: MethodOptions,
    /// Use of the final least-squares step.
    pub fit: Fit,
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
    /// Guarantee on the largest distance: it defines the bound in the report, and the distance that a stop at
    /// an error is compared with.
    pub bound: Bound,
    /// Measurement of the result.
    pub measure: Measure,
    /// Vertices closer than this are merged first. Vertices at equal positions always are; without this, so are
    /// those of borders that differ by rounding ([`simplify`](crate::simplify()) says how far).
    pub weld: Option<Length>,
    /// Connected parts whose bounding box has a smaller diagonal than this are removed first; the largest
    /// part is always kept. Distances are measured from the remaining parts. A share is of the diagonal of
    /// the whole input.
    pub prune: Option<Length>,
    /// Tries pairs and looser topology policies in turn if the target is out of reach. Borders and guards are
    /// kept.
    pub escalate: bool,
    /// For scenes: the stop applies to each mesh separately, instead of all instances of all meshes together.
    pub per_mesh: bool,
    /// Counts the shape normals of the surface in the cost if the mesh has no normals. The result does not
    /// carry them. (In a scene, if no mesh has any.)
    pub shape_normals: bool,
    /// Makes one quick pass, if set.
    #[doc(hidden)]
    pub quick: Option<QuickPass>,
    /// Seed of all random choices: equal seeds give equal bytes.
    pub seed: u64,
}

impl SimplifyOptions {
    /// Returns the default options with this stop.
    pub fn new(stop: Stop) -> Self {
        Self { stop, ..Self::default() }
    }
    /// Converts all lengths to units; shares are of `diagonal`.
    pub(crate) fn lengths_to_units(&mut self, diagonal: f64) {
        let own = &mut self.method_options;
        let of_run = [&mut self.stop.error, &mut self.guards.max_edge, &mut self.weld, &mut self.prune];
        let of_method = [&mut own.pairs, &mut own.cell, &mut own.edge_length, &mut own.flat, &mut own.voxel];
        for length in of_run.into_iter().chain(of_method).flatten() {
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

/// Share of the diagonal within which vertices of scans are merged. (Guessed: about the rounding of single
/// precision.)
const SCAN_WELD: f64 = 1e-6;
/// Weight of normals in [`Preset::Visual`]. (docs/decisions/0013)
const VISUAL_NORMAL: f64 = 2.0;
