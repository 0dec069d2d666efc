//! Options of the window.

use std::path::PathBuf;

use lodsmith_io::AssetScope;

/// Options of the window.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// Files to open, or a session.
    pub inputs: Vec<PathBuf>,
    /// Scope of the files that a model or a session may refer to.
    pub assets: AssetScope,
    /// True if recent files and theme are saved.
    pub remember: bool,
    /// File in which they are saved; `None` for the usual one.
    pub memory: Option<PathBuf>,
    /// True if the system's own file dialogs are used, if it has any.
    pub use_system_dialogs: bool,
    /// True for the light theme; `None` takes the saved one.
    pub is_light: Option<bool>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            inputs: Vec::new(),
            assets: AssetScope::Folder,
            remember: true,
            memory: None,
            use_system_dialogs: true,
            is_light: None,
        }
    }
}
