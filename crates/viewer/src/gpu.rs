//! Drawing on the graphics card: models in, pictures out. Nothing outside this module sees a type of the driver.
//!
//! [`Context`] is the device, cheap to clone and usable from any thread: a worker uploads with it while the window goes
//! on. [`Gpu`] holds pipelines and draws a [`Frame`] into a [`Target`], unless the target shows that very frame already.

mod buffer;
mod context;
mod frame;
mod layout;
mod model;
mod pack;
mod pipeline;
mod renderer;
mod target;
mod uniforms;

pub use context::{Context, GpuError, Split};
pub use frame::{Drawn, Frame, Placed};
pub use model::DrawModel;
pub use renderer::Gpu;
pub use target::Target;
