//! Drawing on the graphics card: models in, pictures out. Nothing outside this module sees a type of the driver.
//!
//! [`Context`] is the device, cheap to clone and usable from any thread: a worker uploads with it while the window goes
//! on. [`Gpu`] holds pipelines and draws a [`Frame`] into a [`Target`], unless the target shows that very frame already.

mod adapter;
mod buffer;
mod context;
mod environment;
mod frame;
mod layout;
mod marks;
mod model;
mod pack;
mod parts;
mod pick;
mod pipeline;
mod renderer;
mod surface_shader;
mod target;
mod texture;
mod timer;
mod uniforms;

pub use adapter::Adapter;
pub use context::{Context, GpuError, Split};
pub use environment::Surroundings;
pub use frame::{Drawn, Frame, Placed};
pub use marks::Marks;
pub use model::DrawModel;
pub use pick::Picked;
pub use renderer::{Gpu, Matcap};
pub use surface_shader::{ShaderError, SurfaceShader};
pub use target::Target;
pub use uniforms::TINTS;
