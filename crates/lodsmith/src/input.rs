//! Input of a run: a mesh, and data that belong only to it.

use std::borrow::Cow;

use lodsmith_core::{MeshError, Positions, PositionsView, RegionId, Surface, TriMesh, VertexId};

use crate::SimplifyError;
use crate::attributes::textures::Textures;

/// Data of one mesh besides its buffers: which vertices stay, which matter more, and what its regions look
/// like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct MeshData<'a> {
    /// Lock of each vertex.
    ///
    /// A locked vertex keeps its position and its attributes, to the bit, and a face whose vertices are all
    /// locked is kept. (Clustering can leave a locked vertex without faces; then it is dropped.) The faces
    /// around are simplified up to it and stay connected to it; a part with a locked vertex is never removed.
    /// Vertices at one position are locked together; a weld moves others onto locked vertices, never a locked
    /// one. Of duplicate faces one is removed even if locked.
    pub locked: Option<&'a [bool]>,
    /// Importance of each vertex: the requested density of triangles there, relative to a place of the same
    /// shape elsewhere. 1 is neutral; values are clamped to 0.001 to 1000.
    ///
    /// The cost of a collapse is multiplied by the importance to the power 2.5, and the merged vertex keeps
    /// the larger value of its two ends. Costs fall with the third power of the density of triangles where
    /// the surface is smooth and with its square where it is rough, so 4 means about 3 on smooth surfaces and
    /// 6 on rough ones. Flat places need no triangles, however important they are. The stop still determines
    /// the total. (docs/decisions/0013)
    pub importance: Option<&'a [f32]>,
    /// Share of the error limit at each vertex, from 0 to 1, linear on each face, for runs with [`Stop::error`]. A point
    /// of the input lies within its share of the limit of the result, and a point of the result within the share at the
    /// point of the input that is closest to it. (Up to two millionths of the largest extent of the mesh, for the
    /// precision of a run.)
    ///
    /// A vertex at 0 is locked as by [`MeshData::locked`]. Of vertices at one position the least share counts.
    ///
    /// [`Stop::error`]: crate::Stop::error()
    pub error_map: Option<&'a [f32]>,
    /// Base-colour images of the regions of the mesh. If one is a palette (almost every face of the input shows
    /// one colour), a face of the result whose blended texture coordinates show other colours than the input
    /// there takes some of the input's coordinates. Nothing else in a run reads images, and
    /// [`Method::Cluster`](crate::Method::Cluster) and progressive meshes do not read them at all.
    pub textures: Option<&'a Textures>,
    /// Class of each region of the mesh, given as the first region of the class: where two regions of one
    /// class meet, the border is a crease that may move, as between smoothing groups. Without the list, and
    /// for regions beyond its end, each region is a class of its own, and borders are exact.
    pub region_classes: Option<&'a [RegionId]>,
    /// Values of the wedges that count in the cost of a quick pass with
    /// [`Placement::Endpoint`](crate::Placement::Endpoint), as many for each; a difference of 1 along an edge
    /// counts like a distance of the edge's length.
    #[doc(hidden)]
    pub wedge_values: Option<&'a [f32]>,
}

/// [`MeshData`] in buffers of its own.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct OwnedMeshData {
    /// See [`MeshData::locked`].
    pub locked: Option<Vec<bool>>,
    /// See [`MeshData::importance`].
    pub importance: Option<Vec<f32>>,
    /// See [`MeshData::error_map`].
    pub error_map: Option<Vec<f32>>,
    /// See [`MeshData::textures`].
    pub textures: Option<Textures>,
    /// See [`MeshData::region_classes`].
    pub region_classes: Option<Vec<RegionId>>,
    #[doc(hidden)]
    pub wedge_values: Option<Vec<f32>>,
}

impl OwnedMeshData {
    /// Splits the lists of vertices of several meshes, one mesh after the other, into those of each; `counts` are their
    /// numbers of vertices.
    ///
    /// # Errors
    /// [`SimplifyError::WrongLength`] for a list that does not have one entry for each vertex of all meshes.
    pub fn split(&self, counts: &[usize]) -> Result<Vec<Self>, SimplifyError> {
        let wanted: usize = counts.iter().sum();
        let lengths = [
            ("locked", self.locked.as_ref().map(Vec::len)),
            ("importance", self.importance.as_ref().map(Vec::len)),
            ("error map", self.error_map.as_ref().map(Vec::len)),
        ];
        for (option, got) in lengths {
            if let Some(got) = got.filter(|n| *n != wanted) {
                return Err(SimplifyError::WrongLength { option, wanted, got });
            }
        }
        let mut first = 0;
        let part = |count: &usize| {
            let own = first..first + count;
            first = own.end;
            let locked = self.locked.as_ref().map(|list| list[own.clone()].to_vec());
            let importance = self.importance.as_ref().map(|list| list[own.clone()].to_vec());
            let error_map = self.error_map.as_ref().map(|list| list[own].to_vec());
            Self { locked, importance, error_map, ..Self::default() }
        };
        Ok(counts.iter().map(part).collect())
    }

    /// Borrows the data.
    pub fn view(&self) -> MeshData<'_> {
        MeshData {
            locked: self.locked.as_deref(),
            importance: self.importance.as_deref(),
            error_map: self.error_map.as_deref(),
            textures: self.textures.as_ref(),
            region_classes: self.region_classes.as_deref(),
            wedge_values: self.wedge_values.as_deref(),
        }
    }
}

/// The input of a run: a [`TriMesh`], or a borrowed [`Surface`] without attributes and regions, and the
/// [data](MeshData) that belong to it.
///
/// ```
/// use lodsmith::core::shapes;
/// use lodsmith::{Input, NoControl, SimplifyOptions, Stop, simplify_with};
///
/// let mesh = shapes::icosphere(4);
/// // The lower half stays as it is.
/// let locked: Vec<bool> = mesh.positions().view().iter().map(|p| p[2] < 0.0).collect();
///
/// let input = Input::new(&mesh).locked(&locked);
/// let lighter = simplify_with(input, &SimplifyOptions::new(Stop::ratio(0.6)), &mut NoControl)?;
/// assert!(lighter.report.locked_vertices > 0 && lighter.report.reached);
/// # Ok::<(), lodsmith::SimplifyError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Input<'a> {
    pub(crate) surface: Surface<'a>,
    pub(crate) mesh: Option<&'a TriMesh>,
    pub(crate) data: MeshData<'a>,
    /// The vertex that each vertex was merged with, if a weld came first. Before the preparation: the vertex
    /// that it is to be merged with.
    pub(crate) joined: Option<Vec<VertexId>>,
    /// True if borders that differ by rounding were found before: in a scene each mesh has its own precision.
    pub(crate) knows_borders: bool,
    /// Keeps blended normals that deviate far from their faces: for temporary normals, and where groups of
    /// clusters are joined again.
    pub(crate) keeps_blended_normals: bool,
}

impl<'a> From<&'a TriMesh> for Input<'a> {
    fn from(mesh: &'a TriMesh) -> Self {
        Self::new(mesh)
    }
}

impl<'a> From<Surface<'a>> for Input<'a> {
    fn from(surface: Surface<'a>) -> Self {
        Self::of_surface(surface)
    }
}

impl<'a> From<&Self> for Input<'a> {
    fn from(input: &Self) -> Self {
        input.clone()
    }
}

impl<'a> Input<'a> {
    /// Takes a mesh with its attributes and regions.
    pub fn new(mesh: &'a TriMesh) -> Self {
        Self { mesh: Some(mesh), ..Self::of_surface(mesh.surface()) }
    }

    /// Takes a surface: positions and triangles only. The result has positions of the same precision, and one
    /// wedge for each vertex.
    pub fn of_surface(surface: Surface<'a>) -> Self {
        Self {
            surface,
            mesh: None,
            data: MeshData::default(),
            joined: None,
            knows_borders: false,
            keeps_blended_normals: false,
        }
    }

    /// Returns the mesh, unless the input is a surface.
    pub fn mesh(&self) -> Option<&'a TriMesh> {
        self.mesh
    }

    /// Returns the data of the mesh.
    pub fn data(&self) -> MeshData<'a> {
        self.data
    }

    /// Sets all data of the mesh.
    pub fn with(self, data: MeshData<'a>) -> Self {
        Self { data, ..self }
    }

    /// Locks vertices: see [`MeshData::locked`].
    pub fn locked(mut self, locked: &'a [bool]) -> Self {
        self.data.locked = Some(locked);
        self
    }

    /// Sets the importance of the vertices: see [`MeshData::importance`].
    pub fn importance(mut self, importance: &'a [f32]) -> Self {
        self.data.importance = Some(importance);
        self
    }

    /// Sets the shares of the error limit at the vertices: see [`MeshData::error_map`].
    pub fn error_map(mut self, shares: &'a [f32]) -> Self {
        self.data.error_map = Some(shares);
        self
    }

    /// Gives the images of the regions: see [`MeshData::textures`].
    pub fn textures(mut self, textures: &'a Textures) -> Self {
        self.data.textures = Some(textures);
        self
    }

    /// Sets the classes of the regions: see [`MeshData::region_classes`].
    pub fn region_classes(mut self, classes: &'a [RegionId]) -> Self {
        self.data.region_classes = Some(classes);
        self
    }

    /// Returns the mesh, or a mesh made from the surface alone.
    pub(crate) fn to_mesh(&self) -> Result<Cow<'a, TriMesh>, MeshError> {
        if let Some(mesh) = self.mesh {
            return Ok(Cow::Borrowed(mesh));
        }
        let positions = match self.surface.positions() {
            PositionsView::F32(p) => Positions::F32(p.to_vec()),
            PositionsView::F64(p) => Positions::F64(p.to_vec()),
        };
        TriMesh::new(positions, self.surface.triangles().to_vec()).map(Cow::Owned)
    }

    /// Replaces the mesh by another one of the same surface, if there is one.
    pub(crate) fn with_mesh(self, mesh: Option<&'a TriMesh>) -> Self {
        Self { mesh: mesh.or(self.mesh), ..self }
    }

    /// Returns the vertex of the surface that a vertex of the mesh became.
    pub(crate) fn joined(&self, v: VertexId) -> VertexId {
        self.joined.as_ref().map_or(v, |joined| joined[v.index()])
    }
}
