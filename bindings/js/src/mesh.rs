//! Typed arrays as meshes and back.

use js_sys::{
    Array, Float32Array, Float64Array, Int8Array, Int16Array, Int32Array, Object, Uint8Array, Uint16Array,
    Uint32Array,
};
use lodsmith_bindings::names::{name_of, semantic};
use lodsmith_core::mesh::MeshBuffers;
use lodsmith_core::{Attribute, IntegerType, MeshError, Positions, RegionId, Semantic, TriMesh, VertexId};
use wasm_bindgen::{JsCast as _, JsValue};

use crate::errors::{wrong_type, wrong_value};
use crate::options::{entries, property};
use crate::report::{object, set};

/// The largest whole number up to which single precision represents all exactly.
const MAX_EXACT: f64 = 16_777_216.0;

/// Returns the error for buffers that are not a mesh.
pub(crate) fn mesh_error(error: &MeshError) -> JsValue {
    wrong_value(&error.to_string())
}

/// A mesh of the caller, and the types of its arrays.
pub(crate) struct GivenMesh {
    pub(crate) mesh: TriMesh,
    /// Number of values for each colour: 3 or 4.
    color_size: usize,
}

/// Values of an attribute, and the integer type of its array, if any.
struct Values {
    values: Vec<f32>,
    integer: Option<IntegerType>,
}

impl GivenMesh {
    /// Copies the arrays of an object into a mesh.
    pub(crate) fn of(given: &JsValue) -> Result<Self, JsValue> {
        let positions = positions(given)?;
        let count = positions.view().len();
        let mut mesh = TriMesh::new(positions, triangles(given, count)?).map_err(|e| mesh_error(&e))?;
        let floats = |name: &str| -> Result<Option<Vec<f32>>, JsValue> {
            let Some(value) = property(given, name) else { return Ok(None) };
            let array: Float32Array =
                value.dyn_into().map_err(|_| wrong_type(&format!("{name}: a Float32Array is expected")))?;
            Ok(Some(array.to_vec()))
        };
        let wrong = |e: MeshError| mesh_error(&e);
        if let Some(values) = floats("normals")? {
            mesh.set_normals(Some(rows("normals", &values, count)?)).map_err(wrong)?;
        }
        if let Some(values) = floats("uvs")? {
            mesh.set_uvs(Some(rows("uvs", &values, count)?)).map_err(wrong)?;
        }
        let mut color_size = 4;
        if let Some(values) = floats("colors")? {
            let colors = if values.len() == 3 * count {
                color_size = 3;
                rows::<_, 3>("colors", &values, count)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
            } else {
                rows("colors", &values, count)?
            };
            mesh.set_colors(Some(colors)).map_err(wrong)?;
        }
        if let Some(values) = floats("tangents")? {
            let values = rows::<_, 4>("tangents", &values, count)?.into_flattened();
            mesh.add_attribute(Attribute { semantic: Semantic::Tangent, width: 4, values }).map_err(wrong)?;
        }
        for (name, value) in property(given, "attributes").iter().flat_map(entries) {
            mesh.add_attribute(attribute(&name, &value, count)?).map_err(wrong)?;
        }
        if let Some(value) = property(given, "regions") {
            let regions: Uint32Array =
                value.dyn_into().map_err(|_| wrong_type("regions: a Uint32Array is expected"))?;
            let regions = regions.to_vec().into_iter().map(RegionId).collect();
            mesh.set_regions(Some(regions)).map_err(wrong)?;
        }
        Ok(Self { mesh, color_size })
    }

    /// Returns the arrays of a result of this mesh.
    pub(crate) fn arrays_of(&self, result: TriMesh) -> Object {
        let MeshBuffers { triangles, vertex_map, positions, normals, uvs, colors, further, regions, .. } =
            result.into_buffers();
        let all = Object::new();
        let put = |name: &str, value: JsValue| set(&all, name, &value);
        let map = vertex_map.as_deref();
        put(
            "positions",
            match positions {
                Positions::F32(p) => Float32Array::from(by_wedge(p, map).as_flattened()).into(),
                Positions::F64(p) => Float64Array::from(by_wedge(p, map).as_flattened()).into(),
            },
        );
        let indices: Vec<u32> = triangles.as_flattened().iter().map(|w| w.0).collect();
        put("indices", Uint32Array::from(&indices[..]).into());
        if let Some(normals) = normals {
            put("normals", Float32Array::from(normals.as_flattened()).into());
        }
        if let Some(uvs) = uvs {
            put("uvs", Float32Array::from(uvs.as_flattened()).into());
        }
        if let Some(colors) = colors {
            let kept = colors.iter().flat_map(|c| &c[..self.color_size]).copied();
            put("colors", Float32Array::from(&kept.collect::<Vec<_>>()[..]).into());
        }
        if let Some(regions) = regions {
            let regions: Vec<u32> = regions.iter().map(|r| r.0).collect();
            put("regions", Uint32Array::from(&regions[..]).into());
        }
        let named = Object::new();
        let mut has_names = false;
        for Attribute { semantic, width, values } in further {
            if semantic == Semantic::Tangent {
                put("tangents", Float32Array::from(&values[..]).into());
                continue;
            }
            has_names = true;
            let array = array_of(&values, integer_of(&semantic));
            let entry = object([("array", array), ("itemSize", (width as f64).into())]);
            set(&named, &name_of(&semantic), &entry);
        }
        if has_names {
            put("attributes", named.into());
        }
        all
    }
}

/// Returns the positions of an object.
fn positions(given: &JsValue) -> Result<Positions, JsValue> {
    let value = property(given, "positions").unwrap_or_default();
    if let Some(array) = value.dyn_ref::<Float32Array>() {
        let values = array.to_vec();
        return Ok(Positions::F32(rows("positions", &values, values.len() / 3)?));
    }
    if let Some(array) = value.dyn_ref::<Float64Array>() {
        let values = array.to_vec();
        return Ok(Positions::F64(rows("positions", &values, values.len() / 3)?));
    }
    Err(wrong_type("positions: a Float32Array or a Float64Array is expected"))
}

/// Returns the triangles of an object; without indices, three consecutive vertices form each.
fn triangles(given: &JsValue, count: usize) -> Result<Vec<[VertexId; 3]>, JsValue> {
    let indices = match property(given, "indices") {
        Some(value) => indices_of(&value)?,
        None => (0..count as u32).collect(),
    };
    let (triangles, rest) = indices.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(wrong_value(&format!("indices: {} are not a multiple of three", indices.len())));
    }
    Ok(triangles.iter().map(|t| t.map(VertexId)).collect())
}

/// Returns the values of an array of indices. Negative indices become large ones, which are out of range.
pub(crate) fn indices_of(value: &JsValue) -> Result<Vec<u32>, JsValue> {
    if let Some(array) = value.dyn_ref::<Uint32Array>() {
        return Ok(array.to_vec());
    }
    if let Some(array) = value.dyn_ref::<Int32Array>() {
        return Ok(array.to_vec().into_iter().map(i32::cast_unsigned).collect());
    }
    if let Some(array) = value.dyn_ref::<Uint16Array>() {
        return Ok(array.to_vec().into_iter().map(u32::from).collect());
    }
    if let Some(array) = value.dyn_ref::<Int16Array>() {
        return Ok(array.to_vec().into_iter().map(|x| i32::from(x).cast_unsigned()).collect());
    }
    if let Some(array) = value.dyn_ref::<Uint8Array>() {
        return Ok(array.to_vec().into_iter().map(u32::from).collect());
    }
    Err(wrong_type("indices: an array of integers is expected, such as a Uint32Array"))
}

/// Returns values as one row of `N` for each vertex.
fn rows<T: Copy, const N: usize>(name: &str, values: &[T], count: usize) -> Result<Vec<[T; N]>, JsValue> {
    let (rows, rest) = values.as_chunks::<N>();
    if rows.len() != count || !rest.is_empty() {
        let got = values.len();
        return Err(wrong_value(&format!("{name}: {got} values are not {N} for each of {count} vertices")));
    }
    Ok(rows.to_vec())
}

/// Returns an attribute from an array, or from an object with an array and the number of values for each vertex.
fn attribute(name: &str, value: &JsValue, count: usize) -> Result<Attribute, JsValue> {
    let (array, size) = match property(value, "array") {
        Some(array) => (array, property(value, "itemSize").and_then(|x| x.as_f64())),
        None => (value.clone(), None),
    };
    let Values { values, integer } = values_of(name, &array)?;
    let width = size.map_or(values.len() / count.max(1), |x| x as usize);
    if width == 0 || values.len() != width * count {
        let text = format!("{name}: {} values are not the same number for {count} vertices", values.len());
        return Err(wrong_value(&text));
    }
    let semantic = match (semantic(name), integer) {
        (Semantic::Custom(name), Some(of)) => Semantic::Discrete { name, of },
        (semantic, _) => semantic,
    };
    Ok(Attribute { semantic, width, values })
}

/// Returns the values of a typed array.
fn values_of(name: &str, array: &JsValue) -> Result<Values, JsValue> {
    if let Some(array) = array.dyn_ref::<Float32Array>() {
        return Ok(Values { values: array.to_vec(), integer: None });
    }
    let (whole, of): (Vec<f64>, _) = if let Some(array) = array.dyn_ref::<Uint8Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::U8)
    } else if let Some(array) = array.dyn_ref::<Int8Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::I8)
    } else if let Some(array) = array.dyn_ref::<Uint16Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::U16)
    } else if let Some(array) = array.dyn_ref::<Int16Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::I16)
    } else if let Some(array) = array.dyn_ref::<Uint32Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::U32)
    } else if let Some(array) = array.dyn_ref::<Int32Array>() {
        (array.to_vec().into_iter().map(f64::from).collect(), IntegerType::I32)
    } else {
        return Err(wrong_type(&format!("{name}: a Float32Array or an array of integers is expected")));
    };
    if whole.iter().any(|x| x.abs() > MAX_EXACT) {
        let text = format!("{name}: integers above {MAX_EXACT} cannot be stored exactly");
        return Err(wrong_value(&text));
    }
    Ok(Values { values: whole.into_iter().map(|x| x as f32).collect(), integer: Some(of) })
}

/// Returns values as a typed array.
fn array_of(values: &[f32], integer: Option<IntegerType>) -> JsValue {
    // (Casts from floats saturate, and all values are whole numbers of the type.)
    match integer {
        None => Float32Array::from(values).into(),
        Some(IntegerType::U8) => {
            Uint8Array::from(&values.iter().map(|x| *x as u8).collect::<Vec<_>>()[..]).into()
        }
        Some(IntegerType::I8) => {
            Int8Array::from(&values.iter().map(|x| *x as i8).collect::<Vec<_>>()[..]).into()
        }
        Some(IntegerType::U16) => {
            Uint16Array::from(&values.iter().map(|x| *x as u16).collect::<Vec<_>>()[..]).into()
        }
        Some(IntegerType::I16) => {
            Int16Array::from(&values.iter().map(|x| *x as i16).collect::<Vec<_>>()[..]).into()
        }
        Some(IntegerType::U32) => {
            Uint32Array::from(&values.iter().map(|x| *x as u32).collect::<Vec<_>>()[..]).into()
        }
        Some(IntegerType::I32) => {
            Int32Array::from(&values.iter().map(|x| *x as i32).collect::<Vec<_>>()[..]).into()
        }
    }
}

/// Returns the integer type of the array of an attribute.
fn integer_of(semantic: &Semantic) -> Option<IntegerType> {
    match semantic {
        Semantic::Discrete { of, .. } => Some(*of),
        Semantic::Joints(_) => Some(IntegerType::U16),
        _ => None,
    }
}

/// Returns the position of each wedge.
fn by_wedge<T: Copy>(positions: Vec<[T; 3]>, map: Option<&[VertexId]>) -> Vec<[T; 3]> {
    match map {
        None => positions,
        Some(map) => map.iter().map(|v| positions[v.index()]).collect(),
    }
}

/// Returns the parts of an array of objects.
pub(crate) fn list_of(value: &JsValue) -> Result<Array, JsValue> {
    value.dyn_ref::<Array>().cloned().ok_or_else(|| wrong_type("an array of meshes is expected"))
}
