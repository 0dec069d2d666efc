//! GPU renderer: draws models into pictures. No graphics driver type is visible outside this module.
//!
//! [`Context`] is the device, cheap to clone and usable from any thread: a worker thread uploads with it
//! while the window keeps running. [`Gpu`] holds the pipelines and draws a [`Frame`] into a [`RenderTarget`],
//! unless the target already shows the same frame.

mod adapter;
mod buffer;
mod context;
mod draw_calls;
mod environment;
mod frame;
mod layout;
mod marks;
mod matcap;
mod model;
mod pack;
mod pick;
mod pipeline;
pub mod preview_mesh;
mod renderer;
pub mod shown;
mod surface_shader;
mod target;
mod texture;
mod timer;
mod uniforms;

pub use adapter::Adapter;
pub use context::{BufferLimits, Context, GpuError};
pub use environment::EnvironmentMap;
pub use frame::{DrawStats, Frame, PlacedModel};
pub use marks::Marks;
pub use matcap::Matcap;
pub use model::DrawModel;
pub use pick::PickHit;
pub use renderer::Gpu;
pub use surface_shader::{ShaderError, SurfaceShader};
pub use target::RenderTarget;
pub use uniforms::TINTS;
