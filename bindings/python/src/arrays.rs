//! NumPy arrays: inputs are borrowed if they have the layout of a mesh; buffers of results are moved, not copied.

use std::borrow::Cow;

use lodsmith::core::mesh::MeshBuffers;
use lodsmith::core::{
    Attribute, IntegerType, MeshError, Positions, PositionsView, RegionId, Semantic, Surface, TriMesh,
    VertexId, WedgeId,
};
use lodsmith_bindings::names::{name_of, semantic};
use numpy::{
    IntoPyArray as _, PyArrayMethods as _, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods as _,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{bad_face, mesh_error};

/// Positions as an array of either precision, `(n, 3)` and contiguous.
pub(crate) enum VertexArray<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

impl<'py> VertexArray<'py> {
    fn of(any: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = any.extract() {
            return Ok(Self::F32(array));
        }
        any.extract()
            .map(Self::F64)
            .map_err(|_| PyTypeError::new_err("vertices: float32 or float64 is expected"))
    }

    /// Borrows the positions.
    pub(crate) fn view(&self) -> PyResult<PositionsView<'_>> {
        Ok(match self {
            Self::F32(array) => PositionsView::F32(rows(array.as_slice()?, array.shape(), "vertices")?),
            Self::F64(array) => PositionsView::F64(rows(array.as_slice()?, array.shape(), "vertices")?),
        })
    }
}

/// Returns an array as rows of `N` values.
fn rows<'a, T: numpy::Element, const N: usize>(
    values: &'a [T],
    shape: &[usize],
    name: &str,
) -> PyResult<&'a [[T; N]]> {
    if shape.get(1) != Some(&N) {
        return Err(PyValueError::new_err(format!("{name}: a shape of (n, {N}) is expected, not {shape:?}")));
    }
    Ok(values.as_chunks().0)
}

/// Triangles as an array of an integer type, `(n, 3)` and contiguous.
pub(crate) enum FaceArray<'py> {
    I32(PyReadonlyArray2<'py, i32>),
    U32(PyReadonlyArray2<'py, u32>),
    I64(PyReadonlyArray2<'py, i64>),
}

impl<'py> FaceArray<'py> {
    fn of(any: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = any.extract() {
            return Ok(Self::I32(array));
        }
        if let Ok(array) = any.extract() {
            return Ok(Self::U32(array));
        }
        any.extract()
            .map(Self::I64)
            .map_err(|_| PyTypeError::new_err("faces: int32, uint32 or int64 is expected"))
    }

    /// Borrows the triangles; 64-bit indices are converted. `count` is the number of vertices.
    fn triangles(&self, py: Python<'_>, count: usize) -> PyResult<Cow<'_, [[VertexId; 3]]>> {
        match self {
            Self::I32(array) => {
                let triangles = rows::<i32, 3>(array.as_slice()?, array.shape(), "faces")?;
                // A negative index becomes larger than any number of vertices.
                if let Some((face, index)) = first_bad(triangles, i64::from, count) {
                    return Err(bad_face(py, face, index, count));
                }
                Ok(Cow::Borrowed(bytemuck::cast_slice(triangles)))
            }
            Self::U32(array) => {
                let triangles = rows::<u32, 3>(array.as_slice()?, array.shape(), "faces")?;
                if let Some((face, index)) = first_bad(triangles, i64::from, count) {
                    return Err(bad_face(py, face, index, count));
                }
                Ok(Cow::Borrowed(bytemuck::cast_slice(triangles)))
            }
            Self::I64(array) => {
                let triangles = rows::<i64, 3>(array.as_slice()?, array.shape(), "faces")?;
                if let Some((face, index)) = first_bad(triangles, |i| i, count) {
                    return Err(bad_face(py, face, index, count));
                }
                Ok(Cow::Owned(triangles.iter().map(|t| t.map(|i| VertexId(i as u32))).collect()))
            }
        }
    }
}

/// Returns the first face with a vertex that does not exist, and the index of the vertex.
fn first_bad<T: Copy>(triangles: &[[T; 3]], wide: fn(T) -> i64, count: usize) -> Option<(usize, i64)> {
    let limit = i64::try_from(count).unwrap_or(i64::MAX).min(i64::from(u32::MAX));
    let is_bad = |i: &T| !(0..limit).contains(&wide(*i));
    // Without an early exit, so that the loop is vectorized.
    const CHUNK_TRIANGLES: usize = 1 << 10;
    let is_bad_chunk = |some: &[[T; 3]]| some.as_flattened().iter().fold(false, |any, i| any | is_bad(i));
    let chunk = triangles.chunks(CHUNK_TRIANGLES).position(is_bad_chunk)? * CHUNK_TRIANGLES;
    let (face, triangle) = triangles[chunk..].iter().enumerate().find(|(_, t)| t.iter().any(is_bad))?;
    triangle.iter().find(|i| is_bad(i)).map(|i| (chunk + face, wide(*i)))
}

/// The arrays of a mesh, as prepared by the Python code: contiguous, of the expected types.
#[derive(FromPyObject)]
pub(crate) struct MeshArrays<'py> {
    vertices: Bound<'py, PyAny>,
    faces: Bound<'py, PyAny>,
    normals: Option<PyReadonlyArray2<'py, f32>>,
    uvs: Option<PyReadonlyArray2<'py, f32>>,
    colors: Option<PyReadonlyArray2<'py, f32>>,
    regions: Option<PyReadonlyArray1<'py, u32>>,
    vertex_map: Option<PyReadonlyArray1<'py, u32>>,
    /// Values by name: `(n, width)`.
    attributes: Bound<'py, PyDict>,
}

/// Arrays with known types.
pub(crate) struct TypedArrays<'py> {
    pub(crate) vertices: VertexArray<'py>,
    pub(crate) faces: FaceArray<'py>,
}

impl<'py> MeshArrays<'py> {
    /// Returns positions and triangles.
    pub(crate) fn typed(&self) -> PyResult<TypedArrays<'py>> {
        Ok(TypedArrays { vertices: VertexArray::of(&self.vertices)?, faces: FaceArray::of(&self.faces)? })
    }

    /// Returns true if there are only positions and triangles.
    pub(crate) fn is_bare(&self) -> bool {
        let none = self.normals.is_none() && self.uvs.is_none() && self.colors.is_none();
        none && self.regions.is_none() && self.vertex_map.is_none() && self.attributes.is_empty()
    }

    /// Copies the arrays into a mesh.
    pub(crate) fn mesh(&self, py: Python<'_>) -> PyResult<TriMesh> {
        let typed = self.typed()?;
        let view = typed.vertices.view()?;
        let triangles = typed.faces.triangles(py, view.len())?.into_owned();
        let mut mesh = match &self.vertex_map {
            None => {
                let positions = match view {
                    PositionsView::F32(p) => Positions::F32(p.to_vec()),
                    PositionsView::F64(p) => Positions::F64(p.to_vec()),
                };
                TriMesh::new(positions, triangles).map_err(|e| mesh_error(py, &e))?
            }
            Some(map) => {
                let map = map.as_slice()?;
                if map.len() != view.len() {
                    let (got, wanted) = (map.len(), view.len());
                    let error = MeshError::WrongLength { name: "vertex_map", got, wanted };
                    return Err(mesh_error(py, &error));
                }
                let positions = by_vertex(view, map)?;
                let triangles = triangles.iter().map(|t| t.map(|v| WedgeId(v.0))).collect();
                let map = map.iter().map(|v| VertexId(*v)).collect();
                TriMesh::with_wedges(positions, map, triangles).map_err(|e| mesh_error(py, &e))?
            }
        };
        self.add_attributes(py, &mut mesh)?;
        Ok(mesh)
    }

    fn add_attributes(&self, py: Python<'_>, mesh: &mut TriMesh) -> PyResult<()> {
        let wrong = |e: MeshError| mesh_error(py, &e);
        if let Some(a) = &self.normals {
            mesh.set_normals(Some(rows(a.as_slice()?, a.shape(), "normals")?.to_vec())).map_err(wrong)?;
        }
        if let Some(a) = &self.uvs {
            mesh.set_uvs(Some(rows(a.as_slice()?, a.shape(), "uvs")?.to_vec())).map_err(wrong)?;
        }
        if let Some(a) = &self.colors {
            mesh.set_colors(Some(rows(a.as_slice()?, a.shape(), "colors")?.to_vec())).map_err(wrong)?;
        }
        for (name, values) in self.attributes.iter() {
            let name: String = name.extract()?;
            let (values, integer): (PyReadonlyArray2<'_, f32>, Option<String>) = values.extract()?;
            let width = values.shape()[1];
            let semantic = match integer {
                None => semantic(&name),
                Some(word) => Semantic::Discrete { name: name.clone(), of: integer_type(&word)? },
            };
            let (got, wanted) = (values.shape()[0], mesh.wedge_count());
            if got != wanted {
                return Err(PyValueError::new_err(format!(
                    "attributes: {name} has {got} entries for {wanted}"
                )));
            }
            let values = values.as_slice()?.to_vec();
            mesh.add_attribute(Attribute { semantic, width, values }).map_err(wrong)?;
        }
        if let Some(regions) = &self.regions {
            let regions = regions.as_slice()?.iter().map(|r| RegionId(*r)).collect();
            mesh.set_regions(Some(regions)).map_err(wrong)?;
        }
        Ok(())
    }
}

impl TypedArrays<'_> {
    /// Borrows the surface.
    pub(crate) fn surface(&self, py: Python<'_>) -> PyResult<OwnedOrBorrowed<'_>> {
        let view = self.vertices.view()?;
        Ok(OwnedOrBorrowed { view, triangles: self.faces.triangles(py, view.len())? })
    }
}

/// Positions and triangles: borrowed, or with converted triangles.
pub(crate) struct OwnedOrBorrowed<'a> {
    view: PositionsView<'a>,
    triangles: Cow<'a, [[VertexId; 3]]>,
}

impl OwnedOrBorrowed<'_> {
    /// Returns the surface of the arrays.
    pub(crate) fn surface(&self) -> Result<Surface<'_>, MeshError> {
        Surface::new(self.view, &self.triangles)
    }
}

/// Returns the position of each vertex, which is the position of its first wedge.
fn by_vertex(of_wedge: PositionsView<'_>, map: &[u32]) -> PyResult<Positions> {
    fn first<T: Copy>(of_wedge: &[[T; 3]], map: &[u32], zero: T) -> PyResult<Vec<[T; 3]>> {
        let count = map.iter().max().map_or(0, |v| *v as usize + 1);
        if count > map.len() {
            let text = format!("vertex_map: has vertex {}, but there are {} rows", count - 1, map.len());
            return Err(PyValueError::new_err(text));
        }
        let mut positions = vec![[zero; 3]; count];
        for (p, v) in of_wedge.iter().zip(map).rev() {
            positions[*v as usize] = *p;
        }
        Ok(positions)
    }
    Ok(match of_wedge {
        PositionsView::F32(p) => Positions::F32(first(p, map, 0.0)?),
        PositionsView::F64(p) => Positions::F64(first(p, map, 0.0)?),
    })
}

const INTEGER_TYPES: [(&str, IntegerType); 6] = [
    ("int8", IntegerType::I8),
    ("uint8", IntegerType::U8),
    ("int16", IntegerType::I16),
    ("uint16", IntegerType::U16),
    ("int32", IntegerType::I32),
    ("uint32", IntegerType::U32),
];

fn integer_type(word: &str) -> PyResult<IntegerType> {
    let found = INTEGER_TYPES.into_iter().find(|(name, _)| *name == word);
    found.map(|x| x.1).ok_or_else(|| PyTypeError::new_err(format!("attributes: integers of type {word}")))
}

/// Moves the buffers of a mesh into arrays, one row for each wedge.
pub(crate) fn to_arrays<'py>(py: Python<'py>, mesh: TriMesh) -> PyResult<Bound<'py, PyDict>> {
    let MeshBuffers { triangles, vertex_map, positions, normals, uvs, colors, further, regions, .. } =
        mesh.into_buffers();
    let all = PyDict::new(py);
    all.set_item(
        "vertices",
        match positions {
            Positions::F32(p) => matrix(py, by_wedge(p, vertex_map.as_deref()).into_flattened(), 3)?,
            Positions::F64(p) => matrix(py, by_wedge(p, vertex_map.as_deref()).into_flattened(), 3)?,
        },
    )?;
    let triangles: Vec<[u32; 3]> = bytemuck::allocation::cast_vec(triangles);
    all.set_item("faces", matrix(py, triangles.into_flattened(), 3)?)?;
    all.set_item("normals", normals.map(|a| matrix(py, a.into_flattened(), 3)).transpose()?)?;
    all.set_item("uvs", uvs.map(|a| matrix(py, a.into_flattened(), 2)).transpose()?)?;
    all.set_item("colors", colors.map(|a| matrix(py, a.into_flattened(), 4)).transpose()?)?;
    let ids = |ids: Vec<u32>| ids.into_pyarray(py);
    all.set_item("regions", regions.map(|r| ids(bytemuck::allocation::cast_vec(r))))?;
    all.set_item("vertex_map", vertex_map.map(|v| ids(bytemuck::allocation::cast_vec(v))))?;
    let named = PyDict::new(py);
    for Attribute { semantic, width, values } in further {
        let array = matrix(py, values, width)?;
        let integer = match &semantic {
            Semantic::Discrete { of, .. } => INTEGER_TYPES.iter().find(|x| x.1 == *of).map(|x| x.0),
            _ => None,
        };
        named.set_item(name_of(&semantic), (array, integer))?;
    }
    all.set_item("attributes", named)?;
    Ok(all)
}

/// Returns the position of each wedge.
fn by_wedge<T: Copy>(positions: Vec<[T; 3]>, map: Option<&[VertexId]>) -> Vec<[T; 3]> {
    match map {
        None => positions,
        Some(map) => map.iter().map(|v| positions[v.index()]).collect(),
    }
}

/// Moves values into an array of rows.
pub(crate) fn matrix<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / width.max(1);
    Ok(values.into_pyarray(py).reshape([rows, width])?.into_any())
}

/// Moves positions into an array.
pub(crate) fn positions_array<'py>(py: Python<'py>, positions: Positions) -> PyResult<Bound<'py, PyAny>> {
    match positions {
        Positions::F32(p) => matrix(py, p.into_flattened(), 3),
        Positions::F64(p) => matrix(py, p.into_flattened(), 3),
    }
}
