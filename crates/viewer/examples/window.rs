//! Opens the window from another program: `cargo run -p lodsmith-viewer --example window -- FILE...`.

use lodsmith_viewer::{ViewError, ViewOptions, run};

fn main() -> Result<(), ViewError> {
    let inputs = std::env::args_os().skip(1).map(Into::into).collect();
    let options =
        ViewOptions { inputs, remember: false, use_system_dialogs: false, ..ViewOptions::default() };
    run(&options)
}
