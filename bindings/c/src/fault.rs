//! Errors: a code, and a text that the calling thread can query. No panic leaves the library.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use lodsmith::SimplifyError;
use lodsmith_bindings::indices::IndexError;
use lodsmith_core::MeshError;

/// The call succeeded.
pub const LODSMITH_OK: i32 = 0;
/// An argument is not valid: a null pointer, a stride that is too small, an index that is out of range.
pub const LODSMITH_ERROR_ARGUMENT: i32 = 1;
/// An option is unknown or out of range, or is incompatible with the method, with another option or with the file.
pub const LODSMITH_ERROR_OPTION: i32 = 2;
/// The mesh cannot be simplified or baked: no face has an area.
pub const LODSMITH_ERROR_MESH: i32 = 3;
/// The progress function cancelled the run.
pub const LODSMITH_ERROR_CANCELLED: i32 = 4;
/// An internal error of the library.
pub const LODSMITH_ERROR_INTERNAL: i32 = 5;
/// A file cannot be read or written.
pub const LODSMITH_ERROR_FILE: i32 = 6;
/// A limit on memory, sizes or time forbids the job.
pub const LODSMITH_ERROR_LIMIT: i32 = 7;
/// The job is done, but with losses or missed targets, which the option `strict` turns into errors.
pub const LODSMITH_ERROR_STRICT: i32 = 8;

/// An error for the caller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    pub(crate) code: i32,
    pub(crate) text: String,
}

impl Fault {
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self { code: LODSMITH_ERROR_ARGUMENT, text: text.into() }
    }
    pub(crate) fn internal(text: impl Into<String>) -> Self {
        Self { code: LODSMITH_ERROR_INTERNAL, text: text.into() }
    }
    /// The text for users.
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl From<SimplifyError> for Fault {
    fn from(error: SimplifyError) -> Self {
        let code = match error {
            SimplifyError::NoFaces { .. } => LODSMITH_ERROR_MESH,
            SimplifyError::Cancelled => LODSMITH_ERROR_CANCELLED,
            SimplifyError::Mesh(_)
            | SimplifyError::WrongLength { .. }
            | SimplifyError::BadVertexValue { .. } => LODSMITH_ERROR_ARGUMENT,
            _ => LODSMITH_ERROR_OPTION,
        };
        Self { code, text: error.to_string() }
    }
}

impl From<IndexError> for Fault {
    fn from(error: IndexError) -> Self {
        match error {
            IndexError::Engine(error) => error.into(),
            IndexError::Argument(text) => Self::argument(text),
            other => Self::internal(other.to_string()),
        }
    }
}

impl From<MeshError> for Fault {
    fn from(error: MeshError) -> Self {
        Self::argument(error.to_string())
    }
}

thread_local! {
    static LAST: RefCell<Option<CString>> = const { RefCell::new(None) };
}

fn remember(text: Option<&str>) {
    let text = text.map(|text| CString::new(text.replace('\0', " ")).unwrap_or_default());
    // While a thread ends, its storage may already be destroyed.
    _ = LAST.try_with(|last| {
        if let Ok(mut last) = last.try_borrow_mut() {
            *last = text;
        }
    });
}

/// Runs the body of a function of the interface; a panic becomes a fault. Stores the text of a fault for the calling
/// thread, replacing the previous text.
pub(crate) fn guarded<T>(body: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    // (After a panic, no value of the body is used again.)
    let outcome = catch_unwind(AssertUnwindSafe(body));
    let outcome = outcome.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("unknown");
        let fault = Fault::internal(format!("internal error: {text}"));
        // The payload could panic again when it is dropped.
        std::mem::forget(panic);
        Err(fault)
    });
    remember(outcome.as_ref().err().map(|fault| fault.text.as_str()));
    outcome
}

/// The code of an outcome.
pub(crate) fn code(outcome: &Result<(), Fault>) -> i32 {
    outcome.as_ref().err().map_or(LODSMITH_OK, |fault| fault.code)
}

/// Returns the text of the error of the last call on this thread, in English, as UTF-8; null if that call
/// succeeded. The text is valid until the next call on this thread; copy it to keep it. (Functions that only read a
/// value, such as `lodsmith_result_vertex_count`, do not change it.)
#[unsafe(no_mangle)]
pub extern "C" fn lodsmith_error_message() -> *const c_char {
    LAST.try_with(|last| {
        last.try_borrow().ok().and_then(|last| last.as_ref().map(|text| text.as_ptr())).unwrap_or(ptr::null())
    })
    .unwrap_or(ptr::null())
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;

    use super::*;

    fn message() -> Option<String> {
        let text = lodsmith_error_message();
        // SAFETY: the text is null or a string of this thread, and no other call is made before it is copied.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
    }

    #[test]
    fn a_panic_becomes_an_error_and_the_next_call_clears_it() {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(|_| {}));
        let outcome = guarded::<()>(|| panic!("number {}", 7));
        std::panic::set_hook(hook);
        assert_eq!(code(&outcome), LODSMITH_ERROR_INTERNAL);
        assert_eq!(message().as_deref(), Some("internal error: number 7"));
        assert_eq!(guarded(|| Ok(3)), Ok(3));
        assert_eq!(message(), None);
    }

    #[test]
    fn each_thread_has_its_own_text() {
        _ = guarded::<()>(|| Err(Fault::argument("here")));
        std::thread::spawn(|| assert_eq!(message(), None)).join().unwrap();
        assert_eq!(message().as_deref(), Some("here"));
    }
}
