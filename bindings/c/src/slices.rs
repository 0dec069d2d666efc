//! The index calls with slices of Rust, for tests and benchmarks.

use std::ffi::CStr;

use crate::{
    lodsmith_error_message, lodsmith_simplify_indices, lodsmith_simplify_indices_with_attributes,
    lodsmith_simplify_indices_with_update,
};

/// Bytes from one position to the next.
const POSITION_STRIDE: usize = size_of::<[f32; 3]>();

/// The input of an index call.
#[derive(Clone, Copy, Debug, Default)]
pub struct IndexCall<'a> {
    /// Three indices for each triangle.
    pub indices: &'a [u32],
    /// One position for each vertex.
    pub positions: &'a [[f32; 3]],
    /// For each vertex, as many values as there are weights.
    pub attributes: &'a [f32],
    /// The weights of the attributes.
    pub weights: &'a [f32],
    /// Flags of each vertex, or empty.
    pub locks: &'a [u8],
    /// Number of indices to reach.
    pub target_index_count: usize,
    /// Largest error.
    pub target_error: f32,
    /// Flags `LODSMITH_SIMPLIFY_...`.
    pub options: u32,
}

/// The result of an index call.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndexResult {
    /// Three for each triangle.
    pub indices: Vec<u32>,
    /// The returned error.
    pub error: f32,
}

/// The result of an index call that moves vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpdateResult {
    /// Three for each triangle.
    pub indices: Vec<u32>,
    /// One for each vertex of the input.
    pub positions: Vec<[f32; 3]>,
    /// As in the call.
    pub attributes: Vec<f32>,
    /// The returned error.
    pub error: f32,
}

/// Returns the text of the last error of this thread.
fn last_error() -> Option<String> {
    let text = lodsmith_error_message();
    // SAFETY: it is null, or a text that ends with a zero byte and is valid until the next call on this thread.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

impl IndexCall<'_> {
    /// Checks that the slices have as many elements as the calls read.
    fn check(&self) {
        let vertices = self.positions.len();
        assert_eq!(self.attributes.len(), self.weights.len() * vertices, "as many attributes as weights");
        assert!(self.locks.is_empty() || self.locks.len() == vertices, "a flag for each vertex");
    }

    fn locks(&self) -> *const u8 {
        if self.locks.is_empty() { std::ptr::null() } else { self.locks.as_ptr() }
    }

    /// Calls `lodsmith_simplify_indices`, which takes neither attributes nor locks.
    ///
    /// # Errors
    /// The text of the error.
    pub fn simplify(&self) -> Result<IndexResult, String> {
        let (mut indices, mut error) = (vec![0; self.indices.len()], 0.0);
        // SAFETY: the slices have the lengths that are passed, and positions are three floats without gaps.
        let count = unsafe {
            lodsmith_simplify_indices(
                indices.as_mut_ptr(),
                self.indices.as_ptr(),
                self.indices.len(),
                self.positions.as_ptr().cast(),
                self.positions.len(),
                POSITION_STRIDE,
                self.target_index_count,
                self.target_error,
                self.options,
                &raw mut error,
            )
        };
        indices.truncate(count);
        last_error().map_or(Ok(IndexResult { indices, error }), Err)
    }

    /// Calls `lodsmith_simplify_indices_with_attributes`.
    ///
    /// # Errors
    /// The text of the error.
    ///
    /// # Panics
    /// If the lengths of the slices do not agree.
    pub fn with_attributes(&self) -> Result<IndexResult, String> {
        self.check();
        let (mut indices, mut error) = (vec![0; self.indices.len()], 0.0);
        // SAFETY: the slices have the lengths that are passed, as was checked; attributes have no gaps.
        let count = unsafe {
            lodsmith_simplify_indices_with_attributes(
                indices.as_mut_ptr(),
                self.indices.as_ptr(),
                self.indices.len(),
                self.positions.as_ptr().cast(),
                self.positions.len(),
                POSITION_STRIDE,
                self.attributes.as_ptr(),
                size_of_val(self.weights),
                self.weights.as_ptr(),
                self.weights.len(),
                self.locks(),
                self.target_index_count,
                self.target_error,
                self.options,
                &raw mut error,
            )
        };
        indices.truncate(count);
        last_error().map_or(Ok(IndexResult { indices, error }), Err)
    }

    /// Calls `lodsmith_simplify_indices_with_update`, on copies of the input.
    ///
    /// # Errors
    /// The text of the error.
    ///
    /// # Panics
    /// If the lengths of the slices do not agree.
    pub fn with_update(&self) -> Result<UpdateResult, String> {
        self.check();
        let mut result = UpdateResult {
            indices: self.indices.to_vec(),
            positions: self.positions.to_vec(),
            attributes: self.attributes.to_vec(),
            error: 0.0,
        };
        // SAFETY: the vectors have the lengths that are passed, as was checked, and are borrowed by this call only.
        let count = unsafe {
            lodsmith_simplify_indices_with_update(
                result.indices.as_mut_ptr(),
                result.indices.len(),
                result.positions.as_mut_ptr().cast(),
                result.positions.len(),
                POSITION_STRIDE,
                result.attributes.as_mut_ptr(),
                size_of_val(self.weights),
                self.weights.as_ptr(),
                self.weights.len(),
                self.locks(),
                self.target_index_count,
                self.target_error,
                self.options,
                &raw mut result.error,
            )
        };
        result.indices.truncate(count);
        last_error().map_or(Ok(result), Err)
    }
}
