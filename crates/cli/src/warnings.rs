//! Display of warnings.

use lodsmith_io::Warning;

use crate::output::{self, Output};

/// Prints the warnings of a file. With `strict`, warnings of lost data are printed as errors, even with `--quiet`,
/// and the function returns `true`.
pub(crate) fn show_warnings(out: &Output, path: &str, warnings: &[Warning], strict: bool) -> bool {
    let mut is_fault = false;
    for warning in warnings {
        if strict && warning.data_lost {
            output::error(&format!("{path}: {warning}"));
            is_fault = true;
        } else {
            out.warning(&format!("{path}: {warning}"));
        }
    }
    is_fault
}

/// Prints that a target was not reached, with the reason. Returns true if that is an error, with `--strict`.
pub(crate) fn show_not_reached(out: &Output, name: &str, why: &str, strict: bool) -> bool {
    let text = format!("{name}: {why}");
    if strict {
        output::error(&text);
    } else {
        out.warning(&text);
    }
    strict
}
