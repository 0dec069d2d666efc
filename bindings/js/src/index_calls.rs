//! The functions with the arguments of meshoptimizer.

use js_sys::{Array, Float32Array, Uint32Array};
use lodsmith_bindings::indices::{
    IndexAttributes, IndexCall, IndexError, IndexResult, simplify_indices as simplify, simplify_with_update,
};
use wasm_bindgen::prelude::*;

use crate::errors::{wrong_type, wrong_value};
use crate::mesh::indices_of;
use crate::options::property;

/// The arrays of a call.
struct IndexArrays {
    indices: Vec<u32>,
    positions: Vec<f32>,
    position_stride: usize,
    attributes: Vec<f32>,
    attribute_stride: usize,
    weights: Vec<f32>,
    locks: Option<Vec<u8>>,
    target_index_count: usize,
    target_error: f32,
    flags: u32,
}

impl IndexArrays {
    /// Reads the properties of an object.
    fn of(given: &JsValue) -> Result<Self, JsValue> {
        let number = |name: &str| property(given, name).and_then(|x| x.as_f64()).unwrap_or(0.0);
        let floats = |name: &str| -> Result<Vec<f32>, JsValue> {
            let Some(value) = property(given, name) else { return Ok(Vec::new()) };
            let array: Float32Array =
                value.dyn_into().map_err(|_| wrong_type(&format!("{name}: a Float32Array is expected")))?;
            Ok(array.to_vec())
        };
        let locks = property(given, "locks").map(|value| {
            let array: Result<js_sys::Uint8Array, _> = value.dyn_into();
            array.map(|a| a.to_vec()).map_err(|_| wrong_type("locks: a Uint8Array is expected"))
        });
        Ok(Self {
            indices: indices_of(&property(given, "indices").unwrap_or_default())?,
            positions: floats("positions")?,
            position_stride: number("positionStride") as usize,
            attributes: floats("attributes")?,
            attribute_stride: number("attributeStride") as usize,
            weights: floats("weights")?,
            locks: locks.transpose()?,
            target_index_count: number("targetIndexCount") as usize,
            target_error: number("targetError") as f32,
            flags: number("flags") as u32,
        })
    }

    /// Returns the number of vertices.
    ///
    /// # Errors
    /// If the lengths of arrays do not agree.
    fn vertex_count(&self) -> Result<usize, JsValue> {
        if self.position_stride < 3 {
            let text = format!("vertex_positions_stride: {} is less than 3", self.position_stride);
            return Err(wrong_value(&text));
        }
        let count = self.positions.len() / self.position_stride;
        let rows = self.attributes.len().checked_div(self.attribute_stride).unwrap_or(0);
        if !self.weights.is_empty() && (self.attribute_stride < self.weights.len() || rows < count) {
            return Err(wrong_value(&format!("vertex_attributes: {rows} rows for {count} vertices")));
        }
        if let Some(locks) = self.locks.as_ref().filter(|locks| locks.len() < count) {
            return Err(wrong_value(&format!("vertex_lock: {} flags for {count} vertices", locks.len())));
        }
        Ok(count)
    }

    /// Runs one of the functions of the library with these arrays.
    fn run<T>(&self, run: impl FnOnce(&IndexCall<'_>) -> Result<T, IndexError>) -> Result<T, JsValue> {
        let vertex_count = self.vertex_count()?;
        let value = |i: usize, k: usize| self.attributes[i * self.attribute_stride + k];
        let lock = |i: usize| self.locks.as_ref().map_or(0, |locks| locks[i]);
        let attributes = IndexAttributes { value: &value, weights: &self.weights };
        let call = IndexCall {
            indices: &self.indices,
            vertex_count,
            position: &|i| std::array::from_fn(|k| self.positions[i * self.position_stride + k]),
            attributes: (!self.weights.is_empty()).then_some(attributes),
            vertex_flags: self.locks.as_ref().map(|_| &lock as &dyn Fn(usize) -> u8),
            target_index_count: self.target_index_count,
            target_error: self.target_error,
            flags: self.flags,
        };
        run(&call).map_err(|error| wrong_value(&error.to_string()))
    }
}

/// Returns the remaining indices and the error.
///
/// # Errors
/// If the lengths of arrays or indices are wrong.
#[wasm_bindgen(js_name = simplifyIndices)]
pub fn simplify_indices(given: &JsValue) -> Result<Array, JsValue> {
    let IndexResult { indices, error } = IndexArrays::of(given)?.run(simplify)?;
    let all: [JsValue; 2] = [Uint32Array::from(&indices[..]).into(), error.into()];
    Ok(all.iter().collect())
}

/// Returns the remaining indices, the error, and all positions and attributes, some of which have changed.
///
/// # Errors
/// If the lengths of arrays or indices are wrong.
#[wasm_bindgen(js_name = updateIndices)]
pub fn update_indices(given: &JsValue) -> Result<Array, JsValue> {
    let mut arrays = IndexArrays::of(given)?;
    let updated = arrays.run(simplify_with_update)?;
    for vertex in &updated.vertices {
        let row = vertex.index as usize;
        arrays.positions[row * arrays.position_stride..][..3].copy_from_slice(&vertex.position);
        for (column, x) in updated.columns.iter().zip(&vertex.values) {
            arrays.attributes[row * arrays.attribute_stride + column] = *x;
        }
    }
    let all: [JsValue; 4] = [
        Uint32Array::from(&updated.indices[..]).into(),
        updated.error.into(),
        Float32Array::from(&arrays.positions[..]).into(),
        Float32Array::from(&arrays.attributes[..]).into(),
    ];
    Ok(all.iter().collect())
}
