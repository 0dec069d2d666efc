//! The window from a program of one's own: `cargo run -p lodsmith-viewer --example window -- FILE...`

use lodsmith_viewer::{ViewError, ViewOptions, run};

fn main() -> Result<(), ViewError> {
    let mut options = ViewOptions::default();
    options.inputs = std::env::args_os().skip(1).map(Into::into).collect();
    (options.remember, options.use_system_dialogs) = (false, false);
    run(&options)
}
