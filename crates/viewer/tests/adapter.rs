//! Adapter for tests; a software adapter is sufficient.

use lodsmith_viewer::gpu::Context;

/// Returns an adapter; without one prints a note and skips, unless `LODSMITH_REQUIRE_GPU` requires one.
pub(crate) fn context() -> Option<Context> {
    match Context::headless() {
        Ok(context) => Some(context),
        Err(e) if std::env::var_os("LODSMITH_REQUIRE_GPU").is_some_and(|v| v == "1") => {
            unreachable!("an adapter is demanded: {e}")
        }
        Err(e) => {
            let _ = std::io::Write::write_all(&mut std::io::stderr(), format!("SKIPPED: {e}\n").as_bytes());
            None
        }
    }
}
