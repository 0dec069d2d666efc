//! The functions that have the arguments of meshoptimizer's, in its order.

use crate::fault::{Fault, guarded};
use crate::flags::*;
use crate::memory::{self, Rows, RowsMut};
use crate::quick::{QuickInput, QuickRules};
use crate::update::{self, MovedValues};
use crate::used::UsedVertices;

/// All flags that there are.
const ALL_FLAGS: u32 = 511;

/// Largest number of attributes. (As many as meshoptimizer takes.)
const MAX_ATTRIBUTES: usize = 32;

/// What all calls have in common.
struct Call<'a> {
    indices: Vec<u32>,
    positions: Rows<'a, f32>,
    vertex_count: usize,
    target_index_count: usize,
    target_error: f32,
    flags: u32,
}

/// A call after the first step: its input, with the index of each of its vertices.
struct Prepared {
    input: QuickInput,
    used: UsedVertices,
    extent: f64,
    /// Errors are in this unit.
    unit: f64,
}

impl Call<'_> {
    fn prepare(&self) -> Result<Prepared, Fault> {
        let &Call { ref indices, positions, vertex_count, target_index_count, target_error, flags } = self;
        if flags & !ALL_FLAGS != 0 {
            return Err(Fault::argument(format!("unknown bits in the options: {:#x}", flags & !ALL_FLAGS)));
        }
        if target_error.is_nan() || target_error < 0.0 {
            return Err(Fault::argument(format!("the target error is {target_error}")));
        }
        let has = |flag: u32| flags & flag != 0;
        let used = UsedVertices::new(indices, vertex_count)?;
        let points: Vec<[f32; 3]> = used.indices.iter().map(|&i| positions.row(i as usize)).collect();
        let extent = match has(LODSMITH_SIMPLIFY_SPARSE) {
            true => largest_extent(points.iter().copied()),
            false => largest_extent((0..vertex_count).map(|i| positions.row(i))),
        };
        let unit = if has(LODSMITH_SIMPLIFY_ERROR_ABSOLUTE) { 1.0 } else { extent };
        let limit = f64::from(target_error) * unit;
        let regularity = match () {
            () if has(LODSMITH_SIMPLIFY_REGULARIZE) => 2,
            () => u8::from(has(LODSMITH_SIMPLIFY_REGULARIZE_LIGHT)),
        };
        let input = QuickInput {
            positions: points,
            triangles: used.triangles.clone(),
            values: None,
            flags: None,
            target_faces: target_index_count / 3,
            // Nothing is farther away than this.
            error_limit: (limit < 2.0 * extent).then_some(limit),
            rules: QuickRules {
                locks_border: has(LODSMITH_SIMPLIFY_LOCK_BORDER),
                prunes: has(LODSMITH_SIMPLIFY_PRUNE),
                regularity,
                is_permissive: has(LODSMITH_SIMPLIFY_PERMISSIVE),
            },
        };
        Ok(Prepared { input, used, extent, unit })
    }
}

/// The largest side of the bounding box of the finite points.
fn largest_extent(points: impl Iterator<Item = [f32; 3]>) -> f64 {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in points.filter(|p| p.iter().all(|x| x.is_finite())) {
        for k in 0..3 {
            (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
        }
    }
    (0..3).map(|k| f64::from(max[k]) - f64::from(min[k])).fold(0.0, f64::max)
}

impl Prepared {
    fn of_input(&self, faces: &[[u32; 3]]) -> Vec<u32> {
        faces.as_flattened().iter().map(|&v| self.used.indices[v as usize]).collect()
    }

    /// An error in the unit of the call.
    fn error(&self, error: f64) -> f32 {
        if self.unit > 0.0 { (error / self.unit) as f32 } else { 0.0 }
    }

    /// Flags of the used vertices.
    fn set_flags(&mut self, flags: Option<Rows<'_, u8>>) {
        self.input.flags =
            flags.map(|flags| self.used.indices.iter().map(|&i| flags.get(i as usize, 0)).collect());
    }
}

/// The attributes of a call.
struct Attributes<'a> {
    rows: Rows<'a, f32>,
    /// Columns that count, with their weights.
    columns: Vec<(usize, f32)>,
}

impl Attributes<'_> {
    /// Values of the used vertices, each times its factor.
    fn of(&self, used: &UsedVertices, factor: impl Fn(f32) -> f32) -> Vec<f32> {
        let value = |i: u32, &(k, weight): &(usize, f32)| {
            let x = self.rows.get(i as usize, k) * factor(weight);
            // (NaN and infinity cannot be compared.)
            if x.is_finite() { x } else { 0.0 }
        };
        let row = |&i: &u32| self.columns.iter().map(move |column| value(i, column));
        used.indices.iter().flat_map(row).collect()
    }
}

/// Returns the attributes of a call, unless none counts.
///
/// # Safety
/// The rows must be readable, and `weights` must be null or have `count` numbers.
unsafe fn attributes<'a>(
    [first, weights]: [*const f32; 2],
    [vertices, stride, count]: [usize; 3],
) -> Result<Option<Attributes<'a>>, Fault> {
    if count > MAX_ATTRIBUTES {
        return Err(Fault::argument(format!("{count} attributes are more than {MAX_ATTRIBUTES}")));
    }
    // SAFETY: promised by the caller.
    let weights = unsafe { memory::numbers("attribute_weights", weights, count) }?;
    if let Some(bad) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
        return Err(Fault::argument(format!("a weight of an attribute is {bad}")));
    }
    // SAFETY: promised by the caller.
    let rows = unsafe { Rows::new("vertex_attributes", first, [vertices, count, stride]) }?;
    let columns: Vec<(usize, f32)> = weights.into_iter().enumerate().filter(|x| x.1 > 0.0).collect();
    match rows {
        _ if columns.is_empty() => Ok(None),
        Some(rows) => Ok(Some(Attributes { rows, columns })),
        None => Err(Fault::argument("vertex_attributes is null")),
    }
}

/// Returns the call of these arguments.
///
/// # Safety
/// `indices` must have `index_count` numbers, and the rows of positions must be readable.
unsafe fn call<'a>(
    indices: *const u32,
    index_count: usize,
    vertex_positions: *const f32,
    [vertex_count, stride]: [usize; 2],
    target_index_count: usize,
    target_error: f32,
    flags: u32,
) -> Result<Call<'a>, Fault> {
    // SAFETY: promised by the caller.
    let indices = unsafe { memory::numbers("indices", indices, index_count) }?;
    // SAFETY: promised by the caller.
    let positions = unsafe { Rows::new("vertex_positions", vertex_positions, [vertex_count, 3, stride]) }?;
    let positions = positions.ok_or_else(|| Fault::argument("vertex_positions is null"))?;
    Ok(Call { indices, positions, vertex_count, target_index_count, target_error, flags })
}

/// Writes the indices of a result, which are no more than the caller has room for.
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

/// Simplifies an index buffer: the arguments are those of `meshopt_simplify`, in the same order.
///
/// Returns the number of indices written to `destination`, three for each triangle, all of them vertices of the
/// input; 0 with a text in `lodsmith_error_message` after an error, and then nothing was written.
///
/// - `destination`: room for `index_count` indices; may be `indices`.
/// - `indices`: three for each triangle, counter-clockwise seen from outside. Vertices at equal positions under
///   different indices are the sides of a seam; its sides stay together, and seams stay where they are.
/// - `vertex_positions`: three floats every `vertex_positions_stride` bytes, for `vertex_count` vertices.
/// - `target_index_count`: the run ends at this number of indices, or before where topology or seams leave nothing to
///   collapse. Holes, handles and parts are kept, unless `options` has `LODSMITH_SIMPLIFY_PRUNE`.
/// - `target_error`: the run ends before the estimate of the error exceeds this share of the largest extent of the
///   positions, or this length with `LODSMITH_SIMPLIFY_ERROR_ABSOLUTE`; `FLT_MAX` for no limit.
/// - `options`: flags `LODSMITH_SIMPLIFY_...`, or 0.
/// - `result_error`: the estimate of the error, in the same unit, if it is not null. (It is three times the estimated
///   root-mean-square distance, as meshoptimizer's is on average.)
///
/// Faces without area or with positions that are not finite are left out, unless there is nothing to simplify. Same
/// input, same output. One thread.
///
/// # Safety
/// The buffers must have these extents; none but `destination` is written.
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
    // SAFETY: the buffers have the extents that the caller promises; no attributes and no locks are there.
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

/// Simplifies an index buffer with attributes in the cost: the arguments are those of
/// `meshopt_simplifyWithAttributes`, in the same order.
///
/// As `lodsmith_simplify_indices`, and:
/// - `vertex_attributes`: `attribute_count` floats (up to 32) every `vertex_attributes_stride` bytes.
/// - `attribute_weights`: the weight of each attribute; a difference of 1 counts like a distance of this share of the
///   largest extent. Attributes with the weight 0 are not read.
/// - `vertex_lock`: null, or flags `LODSMITH_VERTEX_...` for each vertex.
///
/// # Safety
/// The buffers must have these extents; none but `destination` is written.
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
        // SAFETY: the caller promises the extents of all buffers.
        let (call, attributes, locks) = unsafe {
            let positions = [vertex_count, vertex_positions_stride];
            let shape = [vertex_count, vertex_attributes_stride, attribute_count];
            (
                call(
                    indices,
                    index_count,
                    vertex_positions,
                    positions,
                    target_index_count,
                    target_error,
                    options,
                )?,
                attributes([vertex_attributes, attribute_weights], shape)?,
                Rows::new("vertex_lock", vertex_lock, [vertex_count, 1, 1])?,
            )
        };
        let mut prepared = call.prepare()?;
        prepared.set_flags(locks);
        prepared.input.values = attributes.map(|a| a.of(&prepared.used, |weight| weight).into());
        let input = std::mem::replace(&mut prepared.input, empty());
        let result = input.run()?;
        let left = prepared.of_input(&result.faces);
        // SAFETY: the caller promises room for `index_count` indices; the input has been read.
        unsafe { write(destination, index_count, &left) }?;
        Ok((left.len(), prepared.error(result.error)))
    });
    // SAFETY: the caller promises that it is null or a number.
    unsafe { memory::set(result_error, outcome.as_ref().map_or(0.0, |done| done.1)) };
    outcome.map_or(0, |done| done.0)
}

/// An input without anything.
fn empty() -> QuickInput {
    QuickInput {
        positions: Vec::new(),
        triangles: Vec::new(),
        values: None,
        flags: None,
        target_faces: 0,
        error_limit: None,
        rules: QuickRules::default(),
    }
}

/// Simplifies an index buffer in place, with vertices that move for the least error: the arguments are those of
/// `meshopt_simplifyWithUpdate`, in the same order.
///
/// As `lodsmith_simplify_indices_with_attributes`, and `indices`, the positions and the attributes with a weight above 0
/// are changed: the vertices that the indices left name have new values, the others are as before. Values of several
/// indices at one position stay apart. The regularity of faces and permissive seams have no effect here.
///
/// # Safety
/// The buffers must have these extents, and be writable but for `attribute_weights` and `vertex_lock`.
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
        let shape = [vertex_count, vertex_attributes_stride, attribute_count];
        // SAFETY: the caller promises the extents of all buffers.
        let (call, attributes, locks) = unsafe {
            let positions = [vertex_count, vertex_positions_stride];
            (
                call(
                    indices,
                    index_count,
                    vertex_positions,
                    positions,
                    target_index_count,
                    target_error,
                    options,
                )?,
                attributes([vertex_attributes, attribute_weights], shape)?,
                Rows::new("vertex_lock", vertex_lock, [vertex_count, 1, 1])?,
            )
        };
        let mut prepared = call.prepare()?;
        prepared.set_flags(locks);
        if prepared.input.target_faces >= prepared.input.triangles.len() {
            return Ok((index_count, 0.0));
        }
        let columns = attributes.as_ref().map_or_else(Vec::new, |a| a.columns.clone());
        let moved = MovedValues {
            values: attributes.map_or_else(Vec::new, |a| a.of(&prepared.used, |_| 1.0)),
            weights: columns.iter().map(|column| column.1).collect(),
            extent: prepared.extent,
        };
        let result = update::run(&prepared.input, &moved)?;
        let left = prepared.of_input(&result.faces);
        // SAFETY: the caller promises that these buffers are writable; the views of them that were read are gone.
        unsafe {
            write(indices, index_count, &left)?;
            let shape = [vertex_count, 3, vertex_positions_stride];
            let mut positions = RowsMut::new("vertex_positions", vertex_positions, shape)?;
            let shape = [
                if columns.is_empty() { 0 } else { vertex_count },
                attribute_count,
                vertex_attributes_stride,
            ];
            let mut values = RowsMut::new("vertex_attributes", vertex_attributes, shape)?;
            for (v, p, own) in &result.vertices {
                let row = prepared.used.indices[*v as usize] as usize;
                (0..3).for_each(|k| positions.set(row, k, p[k]));
                columns.iter().zip(own).for_each(|((k, _), &x)| values.set(row, *k, x));
            }
        }
        Ok((left.len(), prepared.error(result.error)))
    });
    // SAFETY: the caller promises that it is null or a number.
    unsafe { memory::set(result_error, outcome.as_ref().map_or(0.0, |done| done.1)) };
    outcome.map_or(0, |done| done.0)
}

/// Simplifies an index buffer in memory of Rust: [`lodsmith_simplify_indices`] for tests and benchmarks.
///
/// # Errors
/// The text of the error.
pub fn simplify_indices(
    indices: &[u32],
    positions: &[[f32; 3]],
    target_index_count: usize,
    target_error: f32,
    options: u32,
) -> Result<(Vec<u32>, f32), String> {
    let mut left = vec![0; indices.len()];
    let mut error = 0.0;
    // SAFETY: the slices have the lengths that are passed, and positions are three floats without gaps.
    let (count, fault) = unsafe {
        let count = lodsmith_simplify_indices(
            left.as_mut_ptr(),
            indices.as_ptr(),
            indices.len(),
            positions.as_ptr().cast(),
            positions.len(),
            size_of::<[f32; 3]>(),
            target_index_count,
            target_error,
            options,
            &raw mut error,
        );
        let fault = crate::lodsmith_error_message();
        let fault =
            (!fault.is_null()).then(|| std::ffi::CStr::from_ptr(fault).to_string_lossy().into_owned());
        (count, fault)
    };
    left.truncate(count);
    match fault {
        Some(fault) => Err(fault),
        None => Ok((left, error)),
    }
}
