//! What a window begins with, how it is opened, and why there is none.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;

use eframe::egui;
use lodsmith_io::AssetScope;

use crate::{app, display, gpu};

/// What a window begins with.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// Files to open, or a session.
    pub inputs: Vec<PathBuf>,
    /// Which files a model or a session may name.
    pub assets: AssetScope,
    /// Whether recent files and the theme are kept for the next time.
    pub remember: bool,
    /// Whether files are chosen by the system's own dialog, where there is one.
    pub use_system_dialogs: bool,
    /// The theme; `None` takes the one of the last time.
    pub is_light: Option<bool>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            inputs: Vec::new(),
            assets: AssetScope::Folder,
            remember: true,
            use_system_dialogs: true,
            is_light: None,
        }
    }
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// There is no screen.
    #[error(
        "there is no display to open a window on ({reason}). On a server, `lodsmith render` makes pictures without one; \
         a virtual display is `xvfb-run lodsmith view` (on Debian and Ubuntu: apt install xvfb libxkbcommon-x11-0 \
         mesa-vulkan-drivers libvulkan1)"
    )]
    NoDisplay {
        /// What the system says.
        reason: String,
    },
    /// The system lacks a library that every window needs.
    #[error("{library} is missing, and no window opens without it. Install it: {how}")]
    NoLibrary {
        /// Its name.
        library: String,
        /// How it is installed.
        how: String,
    },
    /// There is nothing that draws.
    #[error(transparent)]
    NoGpu(#[from] gpu::GpuError),
    /// Something else.
    #[error("the window cannot be opened: {reason}")]
    Window {
        /// What the system says.
        reason: String,
    },
}

/// Opens the window; comes back when it is closed.
///
/// # Errors
/// Each [`ViewError`].
pub fn run(options: &ViewOptions) -> Result<(), ViewError> {
    let mut native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Lodsmith")
            .with_app_id("lodsmith")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([720.0, 480.0])
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        ..eframe::NativeOptions::default()
    };
    native.wgpu_options.wgpu_setup = gpu::Context::setup();
    let create: eframe::AppCreator<'_> = Box::new(move |cc| Ok(Box::new(app::App::new(cc, options)?)));
    // Where a library of the system is missing, the window library panics.
    let opened = catch_unwind(AssertUnwindSafe(|| eframe::run_native("lodsmith", native, create)));
    match opened {
        Ok(ended) => ended.map_err(told),
        Err(panic) => match display::missing_library(&display::words(&*panic)) {
            Some((library, packages)) => Err(ViewError::NoLibrary { library, how: packages.how() }),
            None => resume_unwind(panic),
        },
    }
}

fn told(error: eframe::Error) -> ViewError {
    if let Some((library, packages)) = display::missing_library(&error.to_string()) {
        return ViewError::NoLibrary { library, how: packages.how() };
    }
    match error {
        eframe::Error::WinitEventLoop(e) => ViewError::NoDisplay { reason: display::reason(&e.to_string()) },
        eframe::Error::Winit(e) => ViewError::NoDisplay { reason: display::reason(&e.to_string()) },
        eframe::Error::AppCreation(e) => match e.downcast::<gpu::GpuError>() {
            Ok(gpu) => ViewError::NoGpu(*gpu),
            Err(e) => ViewError::Window { reason: e.to_string() },
        },
        eframe::Error::Wgpu(e) => ViewError::NoGpu(gpu::GpuError::NoAdapter { reason: e.to_string() }),
    }
}
