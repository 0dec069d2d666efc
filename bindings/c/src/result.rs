//! `lodsmith_result`, its accessors, and `lodsmith_report`.

use lodsmith::{Refusal, Simplified, StoppedBy};
use lodsmith_core::measure::TwoWay;
use lodsmith_core::{Semantic, TriMesh, WedgeId};

use crate::fault::{Fault, code, guarded};
use crate::memory::{self, CStructure, Number, RowsMut};

/// The target number of triangles was reached.
pub const LODSMITH_STOPPED_BY_FACES: i32 = 0;
/// The target number of vertices was reached.
pub const LODSMITH_STOPPED_BY_VERTICES: i32 = 1;
/// The target fraction of the triangles was reached.
pub const LODSMITH_STOPPED_BY_RATIO: i32 = 2;
/// The next step would exceed the error limit.
pub const LODSMITH_STOPPED_BY_ERROR: i32 = 3;
/// Topology and guards permit no further step.
pub const LODSMITH_STOPPED_BY_REFUSALS: i32 = 4;
/// The method has nothing more to remove.
pub const LODSMITH_STOPPED_BY_EXHAUSTED: i32 = 5;
/// The progress function ended the run with the best mesh so far.
pub const LODSMITH_STOPPED_BY_CALLER: i32 = 6;
/// No target was given, or the input met it already.
pub const LODSMITH_STOPPED_BY_NOTHING: i32 = 7;

/// A simplified mesh and the report of the run. Free it with `lodsmith_result_free`. Several threads may read it at the
/// same time.
pub struct LodsmithResult {
    pub(crate) done: Simplified,
    /// The meanings of the attributes of the input, in its order.
    pub(crate) attributes: Vec<Semantic>,
    pub(crate) seconds: f64,
}

/// A distance in both directions, in the units of the positions.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LodsmithDistance {
    /// From the input to the result.
    pub forward: f64,
    /// From the result to the input.
    pub backward: f64,
    /// Both directions together: the larger of two maxima, the mean of two means.
    pub symmetric: f64,
}

/// The report of a run. Set `size` before the call. Lengths are in the units of the positions.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LodsmithReport {
    /// `sizeof(lodsmith_report)` of the caller's header.
    pub size: usize,
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Positions of the result; at seams there are more vertices than positions.
    pub positions: usize,
    /// 1 if a target was met, else 0.
    pub reached: i32,
    /// One of `LODSMITH_STOPPED_BY_...`.
    pub stopped_by: i32,
    /// Estimate of the root-mean-square distance.
    pub estimate: f64,
    /// 1 if the distances below were measured, else 0.
    pub is_measured: i32,
    /// 1 if the final fit ran, else 0.
    pub is_fitted: i32,
    /// Measured mean distance.
    pub mean: LodsmithDistance,
    /// Measured root-mean-square distance.
    pub rms: LodsmithDistance,
    /// Largest measured distance.
    pub max: LodsmithDistance,
    /// Proven bound on the distance of any point; negative if none is guaranteed.
    pub bound: f64,
    /// Diagonal of the bounding box of the input.
    pub diagonal: f64,
    /// Collapses done.
    pub collapses: u64,
    /// Removed parts.
    pub parts_removed: usize,
    /// Necks that were cut.
    pub necks_cut: usize,
    /// Input vertices merged with another at the same position, or within the weld distance.
    pub welded_vertices: usize,
    /// Input faces that were dropped: degenerate, duplicate, or with positions that are not finite.
    pub dropped_faces: usize,
    /// Number of proposals: tested changes of the options that would let a stuck run continue.
    pub proposals: usize,
    /// Time of the run in seconds.
    pub seconds: f64,
    /// Collapses refused by the stop at an error: with them the result would be farther from the input.
    pub refused_by_error: u64,
    /// 1 if there is a largest measured distance above 0, whose place is below, else 0.
    pub has_max_point: i32,
    /// 1 if that place is on the input, 0 if it is on the result.
    pub is_max_on_input: i32,
    /// The place where the measured distance is largest.
    pub max_point: [f64; 3],
    /// The point of the other surface that is nearest to it.
    pub max_nearest: [f64; 3],
}

// SAFETY: `repr(C)`, all fields are numbers, and the first is a `usize`.
unsafe impl CStructure for LodsmithReport {
    const NAME: &'static str = "lodsmith_report";
}

fn distance(d: TwoWay) -> LodsmithDistance {
    LodsmithDistance { forward: d.forward, backward: d.backward, symmetric: d.symmetric }
}

fn report(result: &LodsmithResult) -> LodsmithReport {
    let r = &result.done.report;
    let measured = r.error.measured.as_ref();
    let farthest = measured.and_then(|m| m.farthest.as_ref());
    let refused = r.refusals.iter().find(|refused| refused.0 == Refusal::ErrorLimit);
    let (cleanup, of) = (&r.cleanup, |d: Option<TwoWay>| d.map_or_else(LodsmithDistance::default, distance));
    LodsmithReport {
        size: size_of::<LodsmithReport>(),
        input_faces: r.input_faces,
        input_vertices: r.input_vertices,
        faces: r.faces,
        positions: r.vertices,
        reached: i32::from(r.reached),
        stopped_by: match r.stopped_by {
            StoppedBy::Faces => LODSMITH_STOPPED_BY_FACES,
            StoppedBy::Vertices => LODSMITH_STOPPED_BY_VERTICES,
            StoppedBy::Ratio => LODSMITH_STOPPED_BY_RATIO,
            StoppedBy::Error => LODSMITH_STOPPED_BY_ERROR,
            StoppedBy::Exhausted => LODSMITH_STOPPED_BY_EXHAUSTED,
            StoppedBy::Caller => LODSMITH_STOPPED_BY_CALLER,
            StoppedBy::Nothing => LODSMITH_STOPPED_BY_NOTHING,
            _ => LODSMITH_STOPPED_BY_REFUSALS,
        },
        estimate: r.error.estimate,
        is_measured: i32::from(measured.is_some()),
        is_fitted: i32::from(r.fitted),
        mean: of(measured.map(|m| m.mean)),
        rms: of(measured.map(|m| m.rms)),
        max: of(measured.map(|m| m.hausdorff)),
        bound: r.error.bound.unwrap_or(-1.0),
        diagonal: r.error.diagonal,
        collapses: r.collapses,
        parts_removed: r.parts_removed,
        necks_cut: r.necks_cut,
        welded_vertices: cleanup.welded_vertices,
        dropped_faces: cleanup.degenerate_faces + cleanup.duplicate_faces + cleanup.non_finite_faces,
        proposals: r.proposals.len(),
        seconds: result.seconds,
        refused_by_error: refused.map_or(0, |(_, count)| *count),
        has_max_point: i32::from(farthest.is_some()),
        is_max_on_input: i32::from(farthest.is_some_and(|f| f.is_forward)),
        max_point: farthest.map_or([0.0; 3], |f| f.point),
        max_nearest: farthest.and_then(|f| f.nearest).unwrap_or_default(),
    }
}

/// Borrows the mesh of a result.
///
/// # Safety
/// The pointer must be null or a result that was not freed.
unsafe fn mesh<'a>(result: *const LodsmithResult) -> Result<&'a TriMesh, Fault> {
    // SAFETY: promised by the caller.
    unsafe { result.as_ref() }.map(|r| &r.done.mesh).ok_or_else(|| Fault::argument("the result is null"))
}

/// Writes rows into a buffer of the caller.
///
/// # Safety
/// `to` must have room for `capacity` rows, `stride` bytes apart.
unsafe fn copy<T: Number, const N: usize>(
    (to, capacity, stride): (*mut T, usize, usize),
    rows: impl ExactSizeIterator<Item = [T; N]>,
) -> Result<(), Fault> {
    let count = rows.len();
    if count > capacity {
        return Err(Fault::argument(format!("{count} rows do not fit into {capacity}")));
    }
    // SAFETY: the caller promises room for `capacity` rows, which are at least as many.
    unsafe { RowsMut::new("the destination", to, [count, N, stride]) }?.set_rows(rows);
    Ok(())
}

/// Frees a result; null is allowed.
///
/// # Safety
/// `result` must come from `lodsmith_simplify`, and is not valid afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_free(result: *mut LodsmithResult) {
    if !result.is_null() {
        // SAFETY: the pointer comes from `Box::into_raw`, and the caller returns it.
        let result = unsafe { Box::from_raw(result) };
        _ = guarded(|| {
            drop(result);
            Ok(())
        });
    }
}

/// Returns the number of vertices of a result; several vertices at the same position are the sides of a seam. 0 for
/// null.
///
/// # Safety
/// `result` must be null or a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_vertex_count(result: *const LodsmithResult) -> usize {
    // SAFETY: promised by the caller.
    unsafe { mesh(result) }.map_or(0, TriMesh::wedge_count)
}

/// Returns the number of indices of a result, three for each triangle. 0 for null.
///
/// # Safety
/// `result` must be null or a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_index_count(result: *const LodsmithResult) -> usize {
    // SAFETY: promised by the caller.
    unsafe { mesh(result) }.map_or(0, |mesh| 3 * mesh.face_count())
}

/// Copies the indices, three for each triangle, into a buffer for `capacity` indices.
///
/// # Safety
/// `result` must be null or a result, and `indices` must have that capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_indices(
    result: *const LodsmithResult,
    indices: *mut u32,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let all = mesh(result)?.triangles().as_flattened();
            copy((indices, capacity, size_of::<u32>()), all.iter().map(|w| [w.0]))
        }
    }))
}

/// Returns the position of each wedge of a mesh.
fn positions(mesh: &TriMesh) -> impl ExactSizeIterator<Item = [f64; 3]> {
    let view = mesh.positions().view();
    (0..mesh.wedge_count()).map(move |w| view.get(mesh.vertex_of(WedgeId::new(w))))
}

/// Copies the positions, three floats every `stride` bytes, into a buffer for `capacity` vertices.
///
/// # Safety
/// `result` must be null or a result, and `positions` must have that capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_positions(
    result: *const LodsmithResult,
    positions: *mut f32,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let all = self::positions(mesh(result)?).map(|p| p.map(|x| x as f32));
            copy((positions, capacity, stride), all)
        }
    }))
}

/// Copies the positions, three doubles every `stride` bytes, into a buffer for `capacity` vertices.
///
/// # Safety
/// `result` must be null or a result, and `positions` must have that capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_positions_f64(
    result: *const LodsmithResult,
    positions: *mut f64,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe { copy((positions, capacity, stride), self::positions(mesh(result)?)) }
    }))
}

fn there<T>(values: Option<T>, name: &str) -> Result<T, Fault> {
    values.ok_or_else(|| Fault::argument(format!("the result has no {name}")))
}

/// Copies the normals, three floats every `stride` bytes; an error if the input had none.
///
/// # Safety
/// `result` must be null or a result, and `normals` must have room for `capacity` vertices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_normals(
    result: *const LodsmithResult,
    normals: *mut f32,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let all = there(mesh(result)?.normals(), "normals")?;
            copy((normals, capacity, stride), all.iter().copied())
        }
    }))
}

/// Copies the texture coordinates, two floats every `stride` bytes; an error if the input had none.
///
/// # Safety
/// `result` must be null or a result, and `uvs` must have room for `capacity` vertices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_uvs(
    result: *const LodsmithResult,
    uvs: *mut f32,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let all = there(mesh(result)?.uvs(), "texture coordinates")?;
            copy((uvs, capacity, stride), all.iter().copied())
        }
    }))
}

/// Copies the colours, four floats every `stride` bytes; an error if the input had none.
///
/// # Safety
/// `result` must be null or a result, and `colors` must have room for `capacity` vertices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_colors(
    result: *const LodsmithResult,
    colors: *mut f32,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let all = there(mesh(result)?.colors(), "colours")?;
            copy((colors, capacity, stride), all.iter().copied())
        }
    }))
}

/// Copies the values of the attribute with index `attribute` in the view of the input: its `width` floats every
/// `stride` bytes. An error if the result does not have the attribute.
///
/// # Safety
/// `result` must be null or a result, and `values` must have room for `capacity` vertices.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_attribute(
    result: *const LodsmithResult,
    attribute: usize,
    values: *mut f32,
    stride: usize,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        let (mesh, result) = unsafe { (mesh(result)?, there(result.as_ref(), "mesh")?) };
        let semantic = there(result.attributes.get(attribute), "attribute of this number")?;
        let all = mesh.further_attributes().iter().find(|a| a.semantic == *semantic);
        let all = there(all, "values of this attribute")?;
        let count = mesh.wedge_count();
        if count > capacity {
            return Err(Fault::argument(format!("{count} rows do not fit into {capacity}")));
        }
        // SAFETY: promised by the caller.
        let mut to = unsafe { RowsMut::new("values", values, [count, all.width, stride]) }?;
        for (i, row) in all.values.chunks_exact(all.width).enumerate() {
            row.iter().enumerate().for_each(|(k, &x)| to.set(i, k, x));
        }
        Ok(())
    }))
}

/// Copies the region of each triangle into a buffer for `capacity` triangles; all are 0 if the input had no regions.
///
/// # Safety
/// `result` must be null or a result, and `regions` must have that capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_copy_regions(
    result: *const LodsmithResult,
    regions: *mut u32,
    capacity: usize,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let mesh = mesh(result)?;
            let of = |f: usize| [mesh.regions().map_or(0, |regions| regions[f].0)];
            copy((regions, capacity, size_of::<u32>()), (0..mesh.face_count()).map(of))
        }
    }))
}

/// Fills the report of a run. Set its `size` first.
///
/// # Safety
/// `result` must be null or a result, and `report` must be null or as large as its size states.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_result_report(
    result: *const LodsmithResult,
    report: *mut LodsmithReport,
) -> i32 {
    code(&guarded(|| {
        // SAFETY: promised by the caller.
        unsafe {
            let result = result.as_ref().ok_or_else(|| Fault::argument("the result is null"))?;
            memory::set_sized(report, &self::report(result))
        }
    }))
}
