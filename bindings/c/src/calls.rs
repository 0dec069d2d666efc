//! `lodsmith_simplify` and `lodsmith_version`.

use std::ffi::{CStr, c_char, c_void};
use std::time::Instant;

use lodsmith::{Control, Input, NoControl, Stage, Verdict, simplify_with};
use lodsmith_core::Attribute;

use crate::fault::{Fault, code, guarded};
use crate::memory;
use crate::mesh_view::LodsmithMeshView;
use crate::options::LodsmithOptions;
use crate::result::LodsmithResult;

/// Continue the run.
pub const LODSMITH_CONTINUE: i32 = 0;
/// End the run soon, with the best mesh so far.
pub const LODSMITH_FINISH: i32 = 1;
/// End the run soon, with `LODSMITH_ERROR_CANCELLED`.
pub const LODSMITH_CANCEL: i32 = 2;

/// Welding, ordering and building the connectivity.
pub const LODSMITH_STAGE_PREPARE: i32 = 0;
/// Collapsing edges, or the main stage of another method.
pub const LODSMITH_STAGE_SIMPLIFY: i32 = 1;
/// The final fit.
pub const LODSMITH_STAGE_FIT: i32 = 2;
/// Measuring the result.
pub const LODSMITH_STAGE_MEASURE: i32 = 3;
/// Reading the input. This and the following stages occur only in jobs on files.
pub const LODSMITH_STAGE_READ: i32 = 4;
/// Cleaning the meshes.
pub const LODSMITH_STAGE_CLEAN: i32 = 5;
/// Inspecting the meshes.
pub const LODSMITH_STAGE_INSPECT: i32 = 6;
/// Baking maps.
pub const LODSMITH_STAGE_BAKE: i32 = 7;
/// Writing the output.
pub const LODSMITH_STAGE_WRITE: i32 = 8;

/// Receives the progress: the stage, one of `LODSMITH_STAGE_...`, and the fraction of it that is done, from 0 to 1; in
/// a job on files, the fraction of the whole job. Returns `LODSMITH_CONTINUE`, `LODSMITH_FINISH` or `LODSMITH_CANCEL`.
/// It is called often, on the calling thread, and must not throw an exception or jump out (`longjmp`).
pub type LodsmithProgress = Option<unsafe extern "C" fn(user: *mut c_void, stage: i32, done: f64) -> i32>;

/// Returns the number of a stage in C.
pub(crate) fn stage_number(stage: Stage) -> i32 {
    match stage {
        Stage::Prepare => LODSMITH_STAGE_PREPARE,
        Stage::Fit => LODSMITH_STAGE_FIT,
        Stage::Measure => LODSMITH_STAGE_MEASURE,
        _ => LODSMITH_STAGE_SIMPLIFY,
    }
}

/// Converts the answer of a progress function.
pub(crate) fn verdict_of(answer: i32) -> Verdict {
    match answer {
        LODSMITH_CONTINUE => Verdict::Continue,
        LODSMITH_FINISH => Verdict::Finish,
        _ => Verdict::Cancel,
    }
}

/// Passes the progress to the caller.
struct Callback {
    call: unsafe extern "C" fn(*mut c_void, i32, f64) -> i32,
    user: *mut c_void,
    stage: i32,
}

impl Control for Callback {
    fn stage(&mut self, stage: Stage) {
        self.stage = stage_number(stage);
    }
    fn progress(&mut self, done: f64) -> Verdict {
        // SAFETY: the caller promises a function of this type that may be called with its pointer.
        verdict_of(unsafe { (self.call)(self.user, self.stage, done) })
    }
}

/// Simplifies a mesh with the best quality: the closest mesh for the count, with all attributes.
///
/// Returns `LODSMITH_OK` and a new result in `*result`, which the caller frees with `lodsmith_result_free`; or an error
/// code, with a text in `lodsmith_error_message` and null in `*result`. The mesh is only read, and not used after the
/// call. `progress` may be null; `user` is passed to it. The same mesh, options and seed give the same result.
///
/// # Safety
/// The structures must have the sizes that they state, and the buffers that they refer to the stated extents.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_simplify(
    mesh: *const LodsmithMeshView,
    options: *const LodsmithOptions,
    progress: LodsmithProgress,
    user: *mut c_void,
    result: *mut *mut LodsmithResult,
) -> i32 {
    code(&guarded(|| {
        if result.is_null() {
            return Err(Fault::argument("result is null"));
        }
        // SAFETY: the caller promises a pointer that may be written, and structures and buffers of their extents.
        let (mesh, options, data) = unsafe {
            result.write_unaligned(std::ptr::null_mut());
            let view = memory::sized(mesh, LodsmithMeshView::EMPTY)?;
            let options = memory::sized(options, LodsmithOptions::default())?;
            let mut data = options.data()?;
            view.add_data(&mut data)?;
            (view.mesh()?, options.get()?, data)
        };
        let input = Input::new(&mesh).with(data.view());
        let started = Instant::now();
        let done = match progress {
            Some(call) => simplify_with(&input, &options, &mut Callback { call, user, stage: 0 }),
            None => simplify_with(&input, &options, &mut NoControl),
        }?;
        let seconds = started.elapsed().as_secs_f64();
        let attributes = mesh.further_attributes().iter().map(|a: &Attribute| a.semantic.clone()).collect();
        let made = Box::into_raw(Box::new(LodsmithResult { done, attributes, seconds }));
        // SAFETY: the caller promises a pointer that may be written.
        unsafe { result.write_unaligned(made) };
        Ok(())
    }))
}

const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => c"",
};

/// Returns the version of the library, such as `0.1.0`: a text that is always valid.
#[unsafe(no_mangle)]
pub extern "C" fn lodsmith_version() -> *const c_char {
    VERSION.as_ptr()
}
