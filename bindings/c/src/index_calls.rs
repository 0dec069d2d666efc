//! The functions with the arguments of meshoptimizer, in its order.

use lodsmith_bindings::indices::{
    IndexAttributes, IndexCall, IndexError, IndexResult, UpdateResult, simplify_indices as run_indices,
    simplify_with_update,
};

use crate::fault::{Fault, guarded};
use crate::memory::{self, Rows, RowsMut};

/// The buffers that a call reads.
struct Buffers<'a> {
    indices: Vec<u32>,
    positions: Rows<'a, f32>,
    vertex_count: usize,
    attributes: Option<Rows<'a, f32>>,
    weights: Vec<f32>,
    vertex_lock: Option<Rows<'a, u8>>,
}

/// The limits of a call, and its flags.
#[derive(Clone, Copy)]
struct IndexTarget {
    target_index_count: usize,
    target_error: f32,
    flags: u32,
}

impl Buffers<'_> {
    /// Runs one of the functions of the library with these buffers.
    fn run<T>(
        &self,
        target: IndexTarget,
        run: impl FnOnce(&IndexCall<'_>) -> Result<T, IndexError>,
    ) -> Result<T, Fault> {
        let value = |i: usize, k: usize| self.attributes.as_ref().map_or(0.0, |rows| rows.get(i, k));
        let flags = |i: usize| self.vertex_lock.as_ref().map_or(0, |rows| rows.get(i, 0));
        if self.attributes.is_none() && self.weights.iter().any(|w| *w > 0.0) {
            return Err(Fault::argument("vertex_attributes is null"));
        }
        let attributes = IndexAttributes { value: &value, weights: &self.weights };
        let call = IndexCall {
            indices: &self.indices,
            vertex_count: self.vertex_count,
            position: &|i| self.positions.row(i),
            attributes: (!self.weights.is_empty()).then_some(attributes),
            vertex_flags: self.vertex_lock.as_ref().map(|_| &flags as &dyn Fn(usize) -> u8),
            target_index_count: target.target_index_count,
            target_error: target.target_error,
            flags: target.flags,
        };
        Ok(run(&call)?)
    }
}

/// The arguments that describe the buffers to read.
struct Arguments {
    indices: *const u32,
    index_count: usize,
    vertex_positions: *const f32,
    vertex_count: usize,
    vertex_positions_stride: usize,
    vertex_attributes: *const f32,
    vertex_attributes_stride: usize,
    attribute_weights: *const f32,
    attribute_count: usize,
    vertex_lock: *const u8,
}

impl Arguments {
    /// Returns views of the buffers, and copies of the indices and the weights.
    ///
    /// # Safety
    /// The buffers must have these extents, and not be written during `'a`.
    unsafe fn buffers<'a>(&self) -> Result<Buffers<'a>, Fault> {
        let vertices = self.vertex_count;
        // SAFETY: promised by the caller.
        unsafe {
            let shape = [vertices, 3, self.vertex_positions_stride];
            let positions = Rows::new("vertex_positions", self.vertex_positions, shape)?;
            let weights = memory::numbers("attribute_weights", self.attribute_weights, self.attribute_count)?;
            let shape = [vertices, self.attribute_count, self.vertex_attributes_stride];
            let attributes = match weights.iter().any(|w| *w > 0.0) {
                true => Rows::new("vertex_attributes", self.vertex_attributes, shape)?,
                false => None,
            };
            Ok(Buffers {
                indices: memory::numbers("indices", self.indices, self.index_count)?,
                positions: positions.ok_or_else(|| Fault::argument("vertex_positions is null"))?,
                vertex_count: vertices,
                attributes,
                weights,
                vertex_lock: Rows::new("vertex_lock", self.vertex_lock, [vertices, 1, 1])?,
            })
        }
    }
}

/// Writes the indices of a result, which fit into the buffer of the caller.
///
/// # Safety
/// `to` must have room for `room` numbers.
unsafe fn write(to: *mut u32, room: usize, indices: &[u32]) -> Result<(), Fault> {
    // SAFETY: promised by the caller.
    let mut to = unsafe { RowsMut::new("destination", to, [room, 1, size_of::<u32>()]) }?;
    if indices.len() > room {
        return Err(Fault::internal("more indices than before"));
    }
    to.set_rows(indices.iter().map(|&i| [i]));
    Ok(())
}

/// Simplifies an index buffer, with the arguments of `meshopt_simplify` in the same order.
///
/// Returns the number of indices written to `destination`: three vertices of the input for each triangle. After an
/// error, returns 0, with a text in `lodsmith_error_message`, and writes nothing.
///
/// - `destination`: room for `index_count` indices; may be `indices`.
/// - `indices`: three for each triangle, counter-clockwise seen from outside. Vertices at equal positions with
///   different indices are the sides of a seam; the sides stay together, and seams keep their lines.
/// - `vertex_positions`: three floats every `vertex_positions_stride` bytes, for `vertex_count` vertices.
/// - `target_index_count`: the run ends at this number of indices, or earlier if topology and seams permit no further
///   collapse. Holes, handles and parts are kept, unless `options` has `LODSMITH_SIMPLIFY_PRUNE`.
/// - `target_error`: the run ends before the estimate of the error exceeds this fraction of the largest extent of the
///   positions, or this length with `LODSMITH_SIMPLIFY_ERROR_ABSOLUTE`; `FLT_MAX` for no limit.
/// - `options`: flags `LODSMITH_SIMPLIFY_...`, or 0.
/// - `result_error`: null, or receives the estimate of the error, in the same unit. (It is computed from the estimated
///   root-mean-square distance, scaled so that an error limit leaves about as many triangles as in meshoptimizer.)
///
/// Faces without area or with positions that are not finite are removed, unless the target is met already. The same
/// input gives the same output. Uses one thread.
///
/// # Safety
/// The buffers must have these extents; only `destination` is written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_simplify_indices(
    destination: *mut u32,
    indices: *const u32,
    index_count: usize,
    vertex_positions: *const f32,
    vertex_count: usize,
    vertex_positions_stride: usize,
    target_index_count: usize,
    target_error: f32,
    options: u32,
    result_error: *mut f32,
) -> usize {
    // SAFETY: the buffers have the extents that the caller promises; there are no attributes and no locks.
    unsafe {
        lodsmith_simplify_indices_with_attributes(
            destination,
            indices,
            index_count,
            vertex_positions,
            vertex_count,
            vertex_positions_stride,
            std::ptr::null(),
            0,
            std::ptr::null(),
            0,
            std::ptr::null(),
            target_index_count,
            target_error,
            options,
            result_error,
        )
    }
}

/// Simplifies an index buffer with attributes in the cost, with the arguments of `meshopt_simplifyWithAttributes` in
/// the same order.
///
/// Like `lodsmith_simplify_indices`, with these additional arguments:
/// - `vertex_attributes`: `attribute_count` floats (up to 32) every `vertex_attributes_stride` bytes.
/// - `attribute_weights`: the weight of each attribute: with weight w, a difference of 1 over a length counts like a
///   distance of w times the length. Attributes with weight 0 are not read.
/// - `vertex_lock`: null, or flags `LODSMITH_VERTEX_...` for each vertex.
///
/// # Safety
/// The buffers must have these extents; only `destination` is written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_simplify_indices_with_attributes(
    destination: *mut u32,
    indices: *const u32,
    index_count: usize,
    vertex_positions: *const f32,
    vertex_count: usize,
    vertex_positions_stride: usize,
    vertex_attributes: *const f32,
    vertex_attributes_stride: usize,
    attribute_weights: *const f32,
    attribute_count: usize,
    vertex_lock: *const u8,
    target_index_count: usize,
    target_error: f32,
    options: u32,
    result_error: *mut f32,
) -> usize {
    let outcome = guarded(|| {
        if index_count == 0 {
            return Ok((0, 0.0));
        }
        let arguments = Arguments {
            indices,
            index_count,
            vertex_positions,
            vertex_count,
            vertex_positions_stride,
            vertex_attributes,
            vertex_attributes_stride,
            attribute_weights,
            attribute_count,
            vertex_lock,
        };
        let target = IndexTarget { target_index_count, target_error, flags: options };
        // SAFETY: the caller promises the extents of all buffers.
        let buffers = unsafe { arguments.buffers() }?;
        let IndexResult { indices, error } = buffers.run(target, run_indices)?;
        // SAFETY: the caller promises room for `index_count` indices; the input has been read.
        unsafe { write(destination, index_count, &indices) }?;
        Ok((indices.len(), error))
    });
    // SAFETY: the caller promises that it is null or a number.
    unsafe { memory::set(result_error, outcome.as_ref().map_or(0.0, |done| done.1)) };
    outcome.map_or(0, |done| done.0)
}

/// Simplifies an index buffer in place and moves vertices to minimise the error, with the arguments of
/// `meshopt_simplifyWithUpdate` in the same order.
///
/// Like `lodsmith_simplify_indices_with_attributes`, but changes `indices`, the positions and the attributes with a
/// weight above 0: vertices that the remaining indices refer to get new values, other vertices keep theirs. A position
/// has a seam if a weighted attribute differs between its vertices; otherwise its vertices are merged.
/// `LODSMITH_SIMPLIFY_PERMISSIVE` has no effect here.
///
/// # Safety
/// The buffers must have these extents, and all but `attribute_weights` and `vertex_lock` must be writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_simplify_indices_with_update(
    indices: *mut u32,
    index_count: usize,
    vertex_positions: *mut f32,
    vertex_count: usize,
    vertex_positions_stride: usize,
    vertex_attributes: *mut f32,
    vertex_attributes_stride: usize,
    attribute_weights: *const f32,
    attribute_count: usize,
    vertex_lock: *const u8,
    target_index_count: usize,
    target_error: f32,
    options: u32,
    result_error: *mut f32,
) -> usize {
    let outcome = guarded(|| {
        if index_count == 0 {
            return Ok((0, 0.0));
        }
        let arguments = Arguments {
            indices,
            index_count,
            vertex_positions,
            vertex_count,
            vertex_positions_stride,
            vertex_attributes,
            vertex_attributes_stride,
            attribute_weights,
            attribute_count,
            vertex_lock,
        };
        let target = IndexTarget { target_index_count, target_error, flags: options };
        // SAFETY: the caller promises the extents of all buffers.
        let buffers = unsafe { arguments.buffers() }?;
        let result = buffers.run(target, simplify_with_update)?;
        drop(buffers);
        let UpdateResult { indices: left, error, vertices, columns } = result;
        // SAFETY: the caller promises that these buffers are writable; the views for reading no longer exist.
        unsafe {
            write(indices, index_count, &left)?;
            let shape = [vertex_count, 3, vertex_positions_stride];
            let mut positions = RowsMut::new("vertex_positions", vertex_positions, shape)?;
            let rows = if columns.is_empty() { 0 } else { vertex_count };
            let shape = [rows, attribute_count, vertex_attributes_stride];
            let mut values = RowsMut::new("vertex_attributes", vertex_attributes, shape)?;
            for vertex in &vertices {
                let row = vertex.index as usize;
                (0..3).for_each(|k| positions.set(row, k, vertex.position[k]));
                columns.iter().zip(&vertex.values).for_each(|(k, &x)| values.set(row, *k, x));
            }
        }
        Ok((left.len(), error))
    });
    // SAFETY: the caller promises that it is null or a number.
    unsafe { memory::set(result_error, outcome.as_ref().map_or(0.0, |done| done.1)) };
    outcome.map_or(0, |done| done.0)
}
