//! Display of warnings.

use lodsmith_io::Warning;

use crate::output::{self, Output};

/// Shows the warnings of a file. With `strict`, lost data are shown as an error even if warnings are
/// silenced, and the result is `true`.
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

/// Prints that a target was not reached, with the reason. Returns true if that is a fault, with `--strict`.
pub(crate) fn show_not_reached(out: &Output, name: &str, why: &str, strict: bool) -> bool {
    let text = format!("{name}: {why}");
    if strict {
        output::error(&text);
    } else {
        out.warning(&text);
    }
    strict
}
