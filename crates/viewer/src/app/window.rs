//! Opens the window, and reports why it cannot.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use eframe::egui;

use super::options::ViewOptions;
use super::{App, display};
use crate::gpu;

/// Why the window cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// There is no display.
    #[error(
        "there is no display to open a window on ({reason}). On a server, `lodsmith render` renders images without \
         one; a virtual display is `xvfb-run lodsmith view` (on Debian and Ubuntu: apt install xvfb libxkbcommon-x11-0 \
         mesa-vulkan-drivers libvulkan1)"
    )]
    NoDisplay {
        /// Message of the system.
        reason: String,
    },
    /// A shared library that every window needs is missing.
    #[error("{library} is missing and is required to open a window. Install it: {how}")]
    NoLibrary {
        /// Name of the library.
        library: String,
        /// Install commands.
        how: String,
    },
    /// There is no adapter to draw with.
    #[error(transparent)]
    NoGpu(#[from] gpu::GpuError),
    /// Another error.
    #[error("cannot open the window: {reason}")]
    Window {
        /// Message of the system.
        reason: String,
    },
}

/// Opens the window; returns when it is closed.
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
    let create: eframe::AppCreator<'_> = Box::new(move |cc| Ok(Box::new(App::new(cc, options)?)));
    // The window library panics if a system library is missing.
    let opened = catch_unwind(AssertUnwindSafe(|| eframe::run_native("lodsmith", native, create)));
    match opened {
        Ok(ended) => ended.map_err(view_error_of),
        Err(panic) => match display::missing_library(&display::panic_message(&*panic)) {
            Some((library, packages)) => Err(ViewError::NoLibrary { library, how: packages.install_hint() }),
            None => resume_unwind(panic),
        },
    }
}

fn view_error_of(error: eframe::Error) -> ViewError {
    if let Some((library, packages)) = display::missing_library(&error.to_string()) {
        return ViewError::NoLibrary { library, how: packages.install_hint() };
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
