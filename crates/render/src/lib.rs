//! Software rendering of triangle meshes on the CPU: the same result everywhere, without driver or display.
//!
//! Cameras, looks, lights and colour maps are defined here too, also for other renderers.
//!
//! ```
//! use lodsmith_core::shapes;
//! use lodsmith_render::{StandardView, Subject, View, render};
//!
//! let subject = Subject::of_mesh(shapes::icosphere(3))?;
//! let bounds = subject.bounds().expect("a ball has faces");
//! let picture = render(&subject, &View::of(&bounds, StandardView::Iso, 320, 240))?;
//! assert_eq!((picture.width(), picture.height()), (320, 240));
//! # Ok::<(), lodsmith_render::RenderError>(())
//! ```

pub mod animation;
mod backdrop;
pub mod camera;
pub mod colormap;
mod draw;
pub mod environment;
pub mod file;
mod font;
pub mod framing;
pub mod image_error;
pub mod light;
pub mod linear;
pub mod look;
pub mod marks;
mod occlusion;
mod projection;
mod raster;
mod shade;
pub mod sheet;
mod subject;
mod surfaces;
pub mod texture;
mod turntable;
mod view;

pub use animation::{AnimationError, AnimationOptions, encode_animation};
pub use camera::{Camera, Lens, StandardView};
pub use colormap::ColorMap;
pub use draw::render;
pub use environment::Environment;
pub use file::{PictureError, PictureFormat, decode, encode, encode_gray16};
pub use framing::Framing;
pub use glam::{DMat4, DQuat, DVec3};
pub use image_error::{ImageError, image_error};
pub use light::{Ambient, Light, LightKind, Lighting};
pub use look::{Background, Look, Shading};
pub use sheet::{Legend, Panel, sheet};
pub use subject::Subject;
pub use texture::{TexelKind, Texture, TextureSet};
pub use view::{Ground, MAX_SIDE_PX, RenderError, View};
