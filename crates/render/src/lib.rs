//! Pictures of triangle meshes on the CPU: the same everywhere, no driver and no display needed.
//!
//! The words of seeing (cameras, looks, lights, colour maps) live here too, for whoever draws otherwise.

pub mod camera;
pub mod colormap;
pub mod image_error;
pub mod light;
pub mod look;

pub use camera::{Camera, Lens, StandardView};
pub use colormap::ColorMap;
pub use image_error::{ImageError, image_error};
pub use light::{Ambient, Light, LightKind, Lighting};
pub use look::{Background, Look, Shading};
