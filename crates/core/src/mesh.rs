//! The triangle mesh: flat buffers, validated on construction, plain values afterwards.

use std::borrow::Cow;

use crate::ids::{RegionId, VertexId, WedgeId};

pub mod attributes;
pub mod compact;
pub mod creases;
pub mod defects;
pub mod normals;
pub mod part;
pub mod weld;

pub use attributes::{Attribute, IntegerType, Morphed, Semantic};

/// Reasons why buffers do not form a valid mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A triangle refers to a wedge or vertex that does not exist.
    #[error("face {face} uses vertex {index}, but the mesh has {count}")]
    IndexOutOfRange {
        /// Index of the triangle.
        face: usize,
        /// The index that it uses.
        index: u32,
        /// Number of wedges or vertices.
        count: usize,
    },
    /// A wedge refers to a vertex that does not exist.
    #[error("wedge {wedge} belongs to vertex {index}, but the mesh has {count}")]
    WedgeOutOfRange {
        /// Index of the wedge.
        wedge: usize,
        /// The vertex that it refers to.
        index: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A buffer does not have one entry for each wedge (regions: for each face).
    #[error("{name}: {got} entries, expected {wanted}")]
    WrongLength {
        /// Name of the buffer.
        name: &'static str,
        /// Its length.
        got: usize,
        /// The number of wedges, or faces.
        wanted: usize,
    },
    /// A list of indices does not have three for each triangle.
    #[error("{count} indices are not a whole number of triangles")]
    NotTriangles {
        /// Number of indices.
        count: usize,
    },
    /// More elements than 32-bit ids can number.
    #[error("{count} {what} are too many for 32-bit ids")]
    TooLarge {
        /// Name of the elements.
        what: &'static str,
        /// Number of elements.
        count: usize,
    },
}

/// Positions in the user's units, in the precision of their source.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Positions {
    /// Single precision, as in most files.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
    F32(Vec<[f32; 3]>),
    /// Double precision, if the source had it.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
    F64(Vec<[f64; 3]>),
}

impl Positions {
    /// Number of positions.
    pub fn len(&self) -> usize {
        self.view().len()
    }
    /// True if there are no positions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Borrows the positions.
    pub fn view(&self) -> PositionsView<'_> {
        match self {
            Self::F32(p) => PositionsView::F32(p),
            Self::F64(p) => PositionsView::F64(p),
        }
    }
}

/// Borrowed positions, one for each vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PositionsView<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision.
    F64(&'a [[f64; 3]]),
}

impl PositionsView<'_> {
    /// Number of positions.
    #[inline]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(p) => p.len(),
            Self::F64(p) => p.len(),
        }
    }
    /// True if there are no positions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// The position of a vertex, widened to double precision.
    ///
    /// # Panics
    /// If there is no such vertex.
    #[inline]
    pub fn get(&self, vertex: VertexId) -> [f64; 3] {
        match self {
            Self::F32(p) => p[vertex.index()].map(f64::from),
            Self::F64(p) => p[vertex.index()],
        }
    }
    /// All positions in double precision, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [f64; 3]> + '_ {
        (0..self.len()).map(|i| self.get(VertexId(i as u32)))
    }
    /// Returns the bounding box of the finite positions; `None` if there are none.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(self.iter())
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: [f64; 3],
    /// Largest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// The box of no points.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// Returns the bounding box of the finite points; `None` if there are none.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Option<Self> {
        let finite = points.into_iter().filter(|p| p.iter().all(|x| x.is_finite()));
        finite.fold(None, |all: Option<Self>, p| Some(all.unwrap_or(Self::EMPTY).with(p)))
    }
    /// Returns the smallest box around this one and a point.
    #[must_use]
    pub fn with(self, p: [f64; 3]) -> Self {
        Self { min: [0, 1, 2].map(|k| self.min[k].min(p[k])), max: [0, 1, 2].map(|k| self.max[k].max(p[k])) }
    }
    /// Length of the diagonal, in the units of the positions; [`f64::MAX`] if it is longer than that.
    pub fn diagonal(&self) -> f64 {
        let d = [0, 1, 2].map(|k| self.max[k] - self.min[k]);
        // Scaled first: the square of 1e200 overflows a double.
        let largest = d.iter().fold(0f64, |a, &b| a.max(b));
        if largest > 0.0 {
            let diagonal = largest * d.iter().map(|x| (x / largest) * (x / largest)).sum::<f64>().sqrt();
            // An extent beyond the range gives NaN.
            if diagonal.is_finite() { diagonal } else { f64::MAX }
        } else {
            0.0
        }
    }
}

/// A borrowed surface: positions and triangles, nothing else. Measures and engines work on it.
#[derive(Clone, Debug)]
pub struct Surface<'a> {
    positions: PositionsView<'a>,
    triangles: Cow<'a, [[VertexId; 3]]>,
}

impl<'a> Surface<'a> {
    /// Makes a surface over borrowed buffers; vertices of a triangle counter-clockwise seen from outside.
    ///
    /// # Errors
    /// [`MeshError::IndexOutOfRange`] if a triangle refers to a vertex beyond the positions, [`MeshError::TooLarge`].
    pub fn new(positions: PositionsView<'a>, triangles: &'a [[VertexId; 3]]) -> Result<Self, MeshError> {
        check_size("vertices", positions.len())?;
        check_triangles(bytemuck::cast_slice(triangles), positions.len())?;
        Ok(Self { positions, triangles: Cow::Borrowed(triangles) })
    }
    /// Makes a surface over borrowed positions and owned triangles.
    ///
    /// # Errors
    /// As [`Surface::new`].
    pub fn with_triangles(
        positions: PositionsView<'a>,
        triangles: Vec<[VertexId; 3]>,
    ) -> Result<Self, MeshError> {
        check_size("vertices", positions.len())?;
        check_triangles(bytemuck::cast_slice(&triangles), positions.len())?;
        Ok(Self { positions, triangles: Cow::Owned(triangles) })
    }
    /// The positions, one for each vertex.
    #[inline]
    pub fn positions(&self) -> PositionsView<'a> {
        self.positions
    }
    /// Three vertices for each face.
    #[inline]
    pub fn triangles(&self) -> &[[VertexId; 3]] {
        &self.triangles
    }
}

/// The owned buffers of a mesh; the methods of [`TriMesh`] with the same names borrow them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeshBuffers {
    /// Three wedges for each face.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
    pub triangles: Vec<[WedgeId; 3]>,
    /// The vertex of each wedge; `None` where wedge i is vertex i.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    pub vertex_map: Option<Vec<VertexId>>,
    /// One position for each vertex.
    pub positions: Positions,
    /// Normals, one for each wedge.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates, one for each wedge.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Colours, one for each wedge; see [`TriMesh::colors`].
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    pub colors: Option<Vec<[f32; 4]>>,
    /// All other attributes.
    pub further: Vec<Attribute>,
    /// The region of each face.
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    pub regions: Option<Vec<RegionId>>,
}

/// A triangle mesh with wedges.
///
/// A *vertex* is a position; a *wedge* is one set of attributes at a vertex. Triangles refer to wedges,
/// counter-clockwise seen from outside. A mesh without seams has one wedge for each vertex, with the same number, and
/// stores no map.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "MeshBuffers"))]
pub struct TriMesh {
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
    triangles: Vec<[WedgeId; 3]>,
    #[cfg_attr(feature = "serde", serde(rename = "vertex_map", with = "crate::wire::optional"))]
    vertex_of: Option<Vec<VertexId>>,
    positions: Positions,
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    normals: Option<Vec<[f32; 3]>>,
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    uvs: Option<Vec<[f32; 2]>>,
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    colors: Option<Vec<[f32; 4]>>,
    further: Vec<Attribute>,
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::optional"))]
    regions: Option<Vec<RegionId>>,
}

impl TryFrom<MeshBuffers> for TriMesh {
    type Error = MeshError;

    fn try_from(buffers: MeshBuffers) -> Result<Self, MeshError> {
        let MeshBuffers { triangles, vertex_map, positions, normals, uvs, colors, further, regions } =
            buffers;
        let mut mesh = match vertex_map {
            Some(map) => Self::with_wedges(positions, map, triangles)?,
            None => Self::new(positions, bytemuck::allocation::cast_vec(triangles))?,
        };
        mesh.set_normals(normals)?;
        mesh.set_uvs(uvs)?;
        mesh.set_colors(colors)?;
        mesh.set_regions(regions)?;
        further.into_iter().try_for_each(|attribute| mesh.add_attribute(attribute))?;
        Ok(mesh)
    }
}

impl TriMesh {
    /// Makes a mesh without attributes: wedge i is vertex i.
    ///
    /// # Errors
    /// [`MeshError::IndexOutOfRange`], [`MeshError::TooLarge`].
    pub fn new(positions: Positions, triangles: Vec<[VertexId; 3]>) -> Result<Self, MeshError> {
        check_size("vertices", positions.len())?;
        check_size("corners", triangles.len().saturating_mul(3))?;
        check_triangles(bytemuck::cast_slice(&triangles), positions.len())?;
        let triangles = bytemuck::allocation::cast_vec(triangles);
        Ok(Self::without_attributes(positions, None, triangles))
    }

    /// Makes a mesh of an index buffer: positions, and three of their numbers for each triangle, counter-clockwise
    /// seen from outside. Copies both.
    ///
    /// ```
    /// use lodsmith_core::TriMesh;
    ///
    /// let mut mesh = TriMesh::from_indexed(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2])?;
    /// mesh.set_uvs(Some(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))?;
    ///
    /// let (positions, indices) = mesh.to_indexed();
    /// assert_eq!((positions.len(), &indices[..]), (3, &[0, 1, 2][..]));
    /// # Ok::<(), lodsmith_core::MeshError>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshError::NotTriangles`] if the number of indices is no multiple of three,
    /// [`MeshError::IndexOutOfRange`], [`MeshError::TooLarge`].
    pub fn from_indexed(positions: &[[f32; 3]], indices: &[u32]) -> Result<Self, MeshError> {
        let (triangles, []) = indices.as_chunks::<3>() else {
            return Err(MeshError::NotTriangles { count: indices.len() });
        };
        let triangles = triangles.iter().map(|t| t.map(VertexId)).collect();
        Self::new(Positions::F32(positions.to_vec()), triangles)
    }

    /// Returns an index buffer: the position of each wedge in single precision, and three wedges for each triangle.
    ///
    /// Normals, texture coordinates, colours and other attributes have the numbers of the wedges too. Without
    /// attributes, the wedges are the vertices, unless the mesh was made with others.
    pub fn to_indexed(&self) -> (Vec<[f32; 3]>, Vec<u32>) {
        let view = self.positions.view();
        let at = |w: usize| view.get(self.vertex_of(WedgeId::new(w))).map(|x| x as f32);
        ((0..self.wedge_count()).map(at).collect(), self.triangles.iter().flatten().map(|w| w.0).collect())
    }

    /// Makes a mesh with several wedges per vertex: `vertex_of[w]` is the vertex of wedge w.
    ///
    /// # Errors
    /// [`MeshError::IndexOutOfRange`], [`MeshError::WedgeOutOfRange`], [`MeshError::TooLarge`].
    pub fn with_wedges(
        positions: Positions,
        vertex_of: Vec<VertexId>,
        triangles: Vec<[WedgeId; 3]>,
    ) -> Result<Self, MeshError> {
        check_size("vertices", positions.len())?;
        check_size("wedges", vertex_of.len())?;
        check_size("corners", triangles.len().saturating_mul(3))?;
        check_triangles(bytemuck::cast_slice(&triangles), vertex_of.len())?;
        let count = positions.len();
        if let Some(wedge) = vertex_of.iter().position(|v| v.index() >= count) {
            return Err(MeshError::WedgeOutOfRange { wedge, index: vertex_of[wedge].0, count });
        }
        Ok(Self::without_attributes(positions, Some(vertex_of), triangles))
    }

    fn without_attributes(
        positions: Positions,
        vertex_of: Option<Vec<VertexId>>,
        triangles: Vec<[WedgeId; 3]>,
    ) -> Self {
        Self {
            triangles,
            vertex_of,
            positions,
            normals: None,
            uvs: None,
            colors: None,
            further: Vec::new(),
            regions: None,
        }
    }

    /// Sets or removes the normals of the wedges, unit length.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one for each wedge.
    pub fn set_normals(&mut self, normals: Option<Vec<[f32; 3]>>) -> Result<(), MeshError> {
        self.normals = self.checked("normals", normals)?;
        Ok(())
    }
    /// Sets or removes the texture coordinates of the wedges; (0, 0) is the lower left corner of the image.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one for each wedge.
    pub fn set_uvs(&mut self, uvs: Option<Vec<[f32; 2]>>) -> Result<(), MeshError> {
        self.uvs = self.checked("texture coordinates", uvs)?;
        Ok(())
    }
    /// Sets or removes the colours of the wedges: red, green, blue, alpha from 0 to 1, as the file had them.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one for each wedge.
    pub fn set_colors(&mut self, colors: Option<Vec<[f32; 4]>>) -> Result<(), MeshError> {
        self.colors = self.checked("colours", colors)?;
        Ok(())
    }

    /// Adds an attribute other than normals, the first texture coordinates and the first colours.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if it does not have `width` values for each wedge.
    pub fn add_attribute(&mut self, attribute: Attribute) -> Result<(), MeshError> {
        let (got, wanted) = (attribute.values.len(), attribute.width * self.wedge_count());
        if attribute.width == 0 || got != wanted {
            return Err(MeshError::WrongLength { name: attribute.semantic.title(), got, wanted });
        }
        self.further.push(attribute);
        Ok(())
    }
    /// Sets or removes the region of each face: a material, a group, a primitive. Borders of regions are
    /// kept.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one for each face.
    pub fn set_regions(&mut self, regions: Option<Vec<RegionId>>) -> Result<(), MeshError> {
        let wanted = self.face_count();
        if let Some(got) = regions.as_ref().map(Vec::len).filter(|&got| got != wanted) {
            return Err(MeshError::WrongLength { name: "regions", got, wanted });
        }
        self.regions = regions;
        Ok(())
    }

    /// Three wedges for each face.
    #[inline]
    pub fn triangles(&self) -> &[[WedgeId; 3]] {
        &self.triangles
    }
    /// The vertex of each wedge; `None` where wedge i is vertex i.
    #[inline]
    pub fn vertex_map(&self) -> Option<&[VertexId]> {
        self.vertex_of.as_deref()
    }
    /// The vertex of a wedge.
    ///
    /// # Panics
    /// If there is no such wedge.
    #[inline]
    pub fn vertex_of(&self, wedge: WedgeId) -> VertexId {
        match &self.vertex_of {
            None => VertexId(wedge.0),
            Some(map) => map[wedge.index()],
        }
    }
    /// The positions, one for each vertex.
    #[inline]
    pub fn positions(&self) -> &Positions {
        &self.positions
    }
    /// Normals, one for each wedge.
    pub fn normals(&self) -> Option<&[[f32; 3]]> {
        self.normals.as_deref()
    }
    /// Texture coordinates, one for each wedge.
    pub fn uvs(&self) -> Option<&[[f32; 2]]> {
        self.uvs.as_deref()
    }
    /// Colours, one for each wedge: red, green and blue in sRGB, as displayed, and opacity, from 0 to 1. Only meshes of
    /// a glTF scene have linear colours, see [`VertexColors`](crate::model::VertexColors).
    pub fn colors(&self) -> Option<&[[f32; 4]]> {
        self.colors.as_deref()
    }
    /// The attributes other than normals, the first texture coordinates and the first colours.
    pub fn further_attributes(&self) -> &[Attribute] {
        &self.further
    }
    /// Removes the [`TriMesh::further_attributes`] for which `is_left_out` is true.
    #[must_use]
    pub fn without_further(mut self, is_left_out: impl Fn(&Semantic) -> bool) -> Self {
        self.further.retain(|a| !is_left_out(&a.semantic));
        self
    }
    /// Mutable values of one of [`TriMesh::further_attributes`].
    ///
    /// # Panics
    /// If there is no such attribute.
    pub fn further_values_mut(&mut self, index: usize) -> &mut [f32] {
        &mut self.further[index].values
    }
    /// The region of each face; `None` if there is only one.
    pub fn regions(&self) -> Option<&[RegionId]> {
        self.regions.as_deref()
    }
    /// Number of triangles.
    pub fn face_count(&self) -> usize {
        self.triangles.len()
    }
    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }
    /// Number of wedges.
    pub fn wedge_count(&self) -> usize {
        self.vertex_of.as_ref().map_or(self.positions.len(), Vec::len)
    }
    /// True if the wedges have any attribute.
    pub fn has_attributes(&self) -> bool {
        self.normals.is_some() || self.uvs.is_some() || self.colors.is_some() || !self.further.is_empty()
    }

    /// Returns positions and triangles alone, borrowed if wedges and vertices have the same numbers.
    pub fn surface(&self) -> Surface<'_> {
        let triangles = match &self.vertex_of {
            None => Cow::Borrowed(bytemuck::cast_slice(&self.triangles)),
            Some(map) => Cow::Owned(self.triangles.iter().map(|t| t.map(|w| map[w.index()])).collect()),
        };
        Surface { positions: self.positions.view(), triangles }
    }

    /// Converts the mesh to its buffers, without copying them.
    pub fn into_buffers(self) -> MeshBuffers {
        let Self { triangles, vertex_of, positions, normals, uvs, colors, further, regions } = self;
        MeshBuffers { triangles, vertex_map: vertex_of, positions, normals, uvs, colors, further, regions }
    }

    /// Replaces every position by a function of it; the precision stays.
    pub fn map_positions(&mut self, map: impl Fn([f64; 3]) -> [f64; 3]) {
        match &mut self.positions {
            Positions::F32(p) => p.iter_mut().for_each(|p| *p = map(p.map(f64::from)).map(|x| x as f32)),
            Positions::F64(p) => p.iter_mut().for_each(|p| *p = map(*p)),
        }
    }

    /// Gives every wedge its own position. If wedges of one vertex get different positions, each one after
    /// the first that differs becomes a new vertex after all others; a vertex without wedges stays.
    ///
    /// Cost: O(vertices + wedges).
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one position for each wedge, [`MeshError::TooLarge`].
    pub fn set_wedge_positions(&mut self, places: Vec<[f32; 3]>) -> Result<(), MeshError> {
        if places.len() != self.wedge_count() {
            let (got, wanted) = (places.len(), self.wedge_count());
            return Err(MeshError::WrongLength { name: "positions", got, wanted });
        }
        let Some(map) = &mut self.vertex_of else {
            self.positions = Positions::F32(places);
            return Ok(());
        };
        let mut positions: Vec<[f32; 3]> =
            self.positions.view().iter().map(|p| p.map(|x| x as f32)).collect();
        let mut is_placed = vec![false; positions.len()];
        for (vertex, place) in map.iter_mut().zip(places) {
            let at = vertex.index();
            if !std::mem::replace(&mut is_placed[at], true) {
                positions[at] = place;
            } else if positions[at].map(f32::to_bits) != place.map(f32::to_bits) {
                *vertex = VertexId::new(positions.len());
                positions.push(place);
                check_size("vertices", positions.len())?;
            }
        }
        self.positions = Positions::F32(positions);
        Ok(())
    }

    fn checked<T>(&self, name: &'static str, buffer: Option<Vec<T>>) -> Result<Option<Vec<T>>, MeshError> {
        let wanted = self.wedge_count();
        match buffer {
            Some(b) if b.len() != wanted => Err(MeshError::WrongLength { name, got: b.len(), wanted }),
            b => Ok(b),
        }
    }
}

fn check_size(what: &'static str, count: usize) -> Result<(), MeshError> {
    // The largest number is reserved: many tables use it for "none".
    if count >= u32::MAX as usize { Err(MeshError::TooLarge { what, count }) } else { Ok(()) }
}

fn check_triangles(triangles: &[[u32; 3]], count: usize) -> Result<(), MeshError> {
    let bad = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= count);
    // By chunks without an early exit, so that the loop is vectorized.
    let limit = u32::try_from(count).unwrap_or(u32::MAX);
    let is_bad = |some: &[[u32; 3]]| some.as_flattened().iter().fold(false, |any, i| any | (*i >= limit));
    const CHUNK_TRIANGLES: usize = 1 << 10;
    let from =
        triangles.chunks(CHUNK_TRIANGLES).position(is_bad).map_or(triangles.len(), |k| k * CHUNK_TRIANGLES);
    match triangles[from..].iter().position(bad).map(|f| from + f) {
        None => Ok(()),
        Some(face) => {
            let index = triangles[face].into_iter().max().unwrap_or(0);
            Err(MeshError::IndexOutOfRange { face, index, count })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions() -> Positions {
        Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    #[test]
    fn a_bad_index_is_named() {
        let got = TriMesh::new(
            positions(),
            vec![[VertexId(0), VertexId(1), VertexId(2)], [VertexId(0), VertexId(3), VertexId(1)]],
        );
        assert_eq!(got.unwrap_err(), MeshError::IndexOutOfRange { face: 1, index: 3, count: 3 });
    }

    #[test]
    fn an_index_buffer_comes_back_with_a_position_for_each_wedge() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let mesh = TriMesh::from_indexed(&points, &[0, 1, 2, 2, 1, 3]).unwrap();
        assert_eq!(mesh.to_indexed(), (points.to_vec(), vec![0, 1, 2, 2, 1, 3]));
        let not_three = TriMesh::from_indexed(&points, &[0, 1, 2, 3]);
        assert_eq!(not_three.unwrap_err(), MeshError::NotTriangles { count: 4 });
        let beyond = TriMesh::from_indexed(&points, &[0, 1, 4]);
        assert_eq!(beyond.unwrap_err(), MeshError::IndexOutOfRange { face: 0, index: 4, count: 4 });
        // Two wedges at vertex 1.
        let (vertex_of, faces) =
            (vec![0, 1, 2, 1, 3].into_iter().map(VertexId).collect(), [[0, 1, 2], [2, 3, 4]]);
        let faces = faces.map(|t: [u32; 3]| t.map(WedgeId)).to_vec();
        let split = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, faces).unwrap();
        let (positions, indices) = split.to_indexed();
        assert_eq!((positions.len(), positions[3], indices), (5, points[1], vec![0, 1, 2, 2, 3, 4]));
    }

    #[test]
    fn attributes_need_one_entry_a_wedge() {
        let mut mesh = TriMesh::new(positions(), vec![[VertexId(0), VertexId(1), VertexId(2)]]).unwrap();
        assert!(mesh.set_uvs(Some(vec![[0.0; 2]; 2])).is_err());
        assert!(mesh.set_uvs(Some(vec![[0.0; 2]; 3])).is_ok());
        assert!(mesh.has_attributes());
    }

    #[test]
    fn further_attributes_and_regions_are_counted() {
        let mut mesh = TriMesh::new(positions(), vec![[VertexId(0), VertexId(1), VertexId(2)]]).unwrap();
        let tangents = |n| Attribute { semantic: Semantic::Tangent, width: 4, values: vec![0.0; n] };
        let wrong = MeshError::WrongLength { name: "tangents", got: 9, wanted: 12 };
        assert_eq!(mesh.add_attribute(tangents(9)), Err(wrong));
        assert_eq!(mesh.add_attribute(tangents(12)), Ok(()));
        assert!(mesh.has_attributes() && mesh.further_attributes().len() == 1);
        assert!(mesh.set_regions(Some(vec![RegionId(0); 3])).is_err());
        assert!(mesh.set_regions(Some(vec![RegionId(7)])).is_ok());
        assert_eq!(mesh.regions(), Some(&[RegionId(7)][..]));
    }

    #[test]
    fn a_diagonal_does_not_overflow() {
        let bounds = Bounds { min: [0.0; 3], max: [3e200, 4e200, 0.0] };
        assert!((bounds.diagonal() / 5e200 - 1.0).abs() < 1e-15);
        for far in [1.2e308, 1.7e308] {
            let bounds = Bounds { min: [-far; 3], max: [far; 3] };
            assert_eq!(bounds.diagonal(), f64::MAX);
        }
    }
}
