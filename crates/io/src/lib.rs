//! Readers and writers of mesh files, with limits.
//!
//! A format is one module with `read(bytes, options) -> Loaded` and `write(mesh, options, out) -> warnings`.
//! The content of a file selects its reader ([`sniff`]), the extension of a file selects its writer.

pub mod assets;
mod attributes;
mod corners;
pub mod dae;
mod distinct;
pub mod drive;
pub mod error;
mod excerpt;
#[cfg(feature = "fbx")]
pub mod fbx;
mod files;
mod finite;
pub mod format;
mod frame;
pub mod gltf;
pub mod limits;
mod lines;
mod loaded;
mod losses;
pub mod lpm;
pub mod machine;
mod material;
pub mod model;
mod numbers;
pub mod obj;
pub mod off;
mod options;
pub mod ply;
pub mod read;
mod sizes;
pub mod sniff;
pub mod stl;
pub mod three_mf;
pub mod vertex_cache;
pub mod write;
mod xml;

pub use assets::AssetScope;
pub use error::{ReadError, Warning, WriteError};
pub use format::Format;
pub use frame::{Frame, Unit};
pub use limits::Limits;
pub use lpm::{Lpm, LpmOptions, LpmReader};
pub use model::{BaseColor, ModelFile, ModelSource, read_model_bytes, read_model_path};
pub use obj::{Regions, Textures};
pub use read::{
    Contents, Loaded, ReadOptions, SharedProgress, read_bytes, read_path, read_scene_bytes, read_scene_path,
    read_stream, sizes_of_path,
};
pub use sizes::Sizes;
pub use write::{
    WriteOptions, write_levels_path, write_levels_to, write_path, write_scene_path, write_scene_to, write_to,
};
